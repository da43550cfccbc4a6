"""How far a run is, in a file for who has no terminal on it: `status.txt` in its directory, to be read with cat."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import psutil

from distfsi.errors import OutputError
from distfsi.output.files import write_text
from distfsi.output.interfaces import Communicator
from distfsi.output.journal import ENDINGS
from distfsi.output.manifest import claim

NAME = "status.txt"
SECONDS_BETWEEN_NOTES = 5.0


class Status:
    """Rank 0 notes how far the run is, within a `with` block, and how it ended, after it.

    A file that cannot be written is no reason to end a run.
    """

    def __init__(self, directory: Path, communicator: Communicator):
        self._path, self._writes = Path(directory) / NAME, communicator.rank == 0
        self._goes_on, self._noted_at = False, -SECONDS_BETWEEN_NOTES
        self._lines: dict[str, str] = {}

    def __enter__(self) -> Status:
        self._goes_on = True
        self._write("starting")
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._write("done" if kind is None else ENDINGS.get(kind, "failed"))
        self._goes_on = False

    def note(self, what: str, lines: Mapping[str, str] | None = None) -> None:
        """Note `what` the run does, and `lines` by their names, if the last note is some seconds old."""
        if lines is not None:
            self._lines = dict(lines)
        now = clock.monotonic()
        if self._goes_on and now - self._noted_at >= SECONDS_BETWEEN_NOTES:
            self._noted_at = now
            self._write(what)

    def _write(self, what: str) -> None:
        if not self._writes:
            return
        memory = psutil.Process().memory_info().rss / 1e6
        last = {"memory": f"{memory:,.0f} MB on rank 0", "written": clock.strftime("%Y-%m-%d %H:%M:%S")}
        lines = {"status": what, **self._lines, **last}
        with suppress(OSError, OutputError):
            claim(self._path)
            write_text(self._path, "".join(f"{name:<11}{text}\n" for name, text in lines.items()))


def read_status(directory: Path) -> dict[str, str]:
    """The lines of the status of a run, by their names; empty without any."""
    try:
        lines = (Path(directory) / NAME).read_text().splitlines()
    except OSError:
        return {}
    return {line[:11].strip(): line[11:] for line in lines}
