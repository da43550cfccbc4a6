"""What a run is asked to do while it goes on: to write a restart file, or to stop early."""

from __future__ import annotations

import os
import time as clock
from enum import IntEnum
from pathlib import Path

from distfsi.errors import InputError
from distfsi.interrupts import interrupts
from distfsi.output.interfaces import Communicator
from distfsi.output.manifest import RESERVED
from distfsi.output.storage import on_root

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

    Signals are noted within a `with` block (distfsi/interrupts.py), and before it where the run is the program. A stop
    file that is there at its start, or that has stopped the run, is removed, since it is meant for one run; but only an
    empty one, which holds nothing that could be lost.
    """

    def __init__(
        self, stop_file: Path, wall_clock_limit: float | None, restart_every: float, communicator: Communicator
    ):
        """Starts the clock, unless it goes since the program's start. `wall_clock_limit` [s] or None; `restart_every`
        [s] of wall-clock time, 0: never."""
        self._stop_file, self._communicator = Path(stop_file), communicator
        self._limit = wall_clock_limit or float("inf")
        self._restart_every = restart_every or float("inf")
        self._decides = communicator.rank == 0
        self._saved = self._looked = clock.monotonic()
        self._started = self._saved if interrupts.began is None else interrupts.began
        self._found = False

    def __enter__(self) -> Requests:
        self._before = interrupts.listen()
        return self

    def __exit__(self, *_: object) -> None:
        interrupts.leave(self._before)

    def check_stop_file(self) -> None:
        """Collective. Remove the one of an earlier run. Raises InputError on all ranks when something else is there."""
        if RESERVED.fullmatch(self._stop_file.name):
            raise InputError([f"output.stop_file: {self._stop_file.name} is the name of a file that runs write"])
        self.remove_stop_file()
        if on_root(self._communicator, self._stop_file, lambda: os.path.lexists(self._stop_file)):
            text = "is there and no empty file, which alone would be removed; move it away or name another"
            raise InputError([f"output.stop_file: {self._stop_file} {text}"])

    def remove_stop_file(self) -> None:
        """Collective. So that it does not stop the next run."""
        on_root(self._communicator, self._stop_file, self._remove_if_empty)

    def _remove_if_empty(self) -> None:
        found = self._stop_file
        if found.is_file() and not found.is_symlink() and found.stat().st_size == 0:
            found.unlink()

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
        if interrupts.heard:
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
