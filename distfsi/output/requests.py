"""What a run is asked to do while it goes on: to write a restart file, or to stop early."""

from __future__ import annotations

import signal
import time as clock
from enum import IntEnum
from pathlib import Path

from distfsi.output.interfaces import Communicator

SIGNALS = (signal.SIGUSR1, signal.SIGTERM)
SECONDS_BETWEEN_LOOKS = 1.0  # at the stop file


class Request(IntEnum):
    """From the weakest to the strongest; all but the first two end the run."""

    NOTHING = 0
    RESTART_FILE = 1
    STOP_FILE = 2
    WALL_CLOCK = 3
    SIGNAL = 4

    @property
    def stops(self) -> bool:
        return self >= Request.STOP_FILE


class Requests:
    """Collects what this rank is asked for: signals on any rank, the clock and the stop file on rank 0.

    Handlers of SIGUSR1 and SIGTERM are in place within a `with` block; they only note that the signal came. A stop file
    that is there at its start, or that has stopped the run, is removed: it is meant for one run.
    """

    def __init__(
        self, stop_file: Path, wall_clock_limit: float | None, restart_every: float, communicator: Communicator
    ):
        """Starts the clock. `wall_clock_limit` [s] or None; `restart_every` [s] of wall-clock time, 0: never."""
        self._stop_file = Path(stop_file)
        self._limit = wall_clock_limit or float("inf")
        self._restart_every = restart_every or float("inf")
        self._decides = communicator.rank == 0
        self._started = self._saved = self._looked = clock.monotonic()
        self._signaled = False
        self._found = False

    def __enter__(self) -> Requests:
        self._previous = {number: signal.signal(number, self._note) for number in SIGNALS}
        self.remove_stop_file()
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _note(self, *_: object) -> None:
        self._signaled = True

    def remove_stop_file(self) -> None:
        """So that it does not stop the next run."""
        if self._decides:
            self._stop_file.unlink(missing_ok=True)

    def words(self, request: Request) -> str:
        """What asks for an early end."""
        return {
            Request.STOP_FILE: f"the file {self._stop_file}",
            Request.WALL_CLOCK: "time.wall_clock_limit",
            Request.SIGNAL: "a signal",
        }[request]

    def saved(self) -> None:
        """A restart file has been written; the next is due `restart_every` later."""
        self._saved = clock.monotonic()

    def strongest(self) -> Request:
        """What this rank is asked for now."""
        if self._signaled:
            return Request.SIGNAL
        if not self._decides:
            return Request.NOTHING
        now = clock.monotonic()
        if now - self._started >= self._limit:
            return Request.WALL_CLOCK
        if now - self._looked >= SECONDS_BETWEEN_LOOKS:
            self._looked, self._found = now, self._stop_file.exists()
        if self._found:
            return Request.STOP_FILE
        return Request.RESTART_FILE if now - self._saved >= self._restart_every else Request.NOTHING
