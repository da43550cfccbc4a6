"""What is known of a run as a whole: what it computes, by whom, how it ended; `run.json` beside its results."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from distfsi import __version__
from distfsi.errors import DistfsiError, Diverged, Stopped
from distfsi.output.interfaces import Communicator
from distfsi.output.storage import on_root, replace

NAME = "run.json"
RESULTS = (NAME, "*.csv", "*.vtkhdf", "*.vtkhdf.series", "restart-*.h5", "summary.png")
ENDINGS: dict[type[BaseException], str] = {Stopped: "stopped", Diverged: "diverged"}


def set_aside(directory: Path, communicator: Communicator) -> None:
    """Collective. Move the results of an earlier run in `directory`, if there are any, to `earlier-N` in it.

    Raises OutputError on all ranks.
    """
    on_root(communicator, directory, lambda: _move_results(directory))


def _move_results(directory: Path) -> None:
    if not (directory / NAME).exists():
        return
    number = 1 + max((int(path.name[8:]) for path in directory.glob("earlier-*") if path.name[8:].isdigit()), default=0)
    earlier = directory / f"earlier-{number}"
    earlier.mkdir()
    for pattern in RESULTS:
        for path in directory.glob(pattern):
            path.rename(earlier / path.name)
    print(f"the results of an earlier run are now in {earlier}", flush=True)


class Journal:
    """Rank 0 notes that a run goes on, within a `with` block, and how it ended, after it.

    A journal that cannot be written is no reason to end a run.
    """

    def __init__(
        self, directory: Path, scene: Any, communicator: Communicator, threads: int, seconds: Mapping[str, float]
    ):
        """`seconds`: what each part of the steps has taken, as it is known when the run ends."""
        self._path, self._writes = Path(directory) / NAME, communicator.rank == 0
        self._started, self._seconds = clock.monotonic(), seconds
        self._notes = {
            "title": scene.title,
            "end time [s]": scene.time.end,
            "distfsi": __version__,
            "ranks": communicator.size,
            "threads per rank": threads,
            "started": clock.strftime("%Y-%m-%d %H:%M:%S"),
            "status": "running",
        }

    def __enter__(self) -> Journal:
        self._write()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        status = "done" if kind is None else ENDINGS.get(kind, "failed")
        self._notes |= {"status": status, "seconds": round(clock.monotonic() - self._started, 1)}
        self._notes["seconds by part"] = {part: round(seconds, 3) for part, seconds in self._seconds.items()}
        if error is not None:
            self._notes["message"] = (
                str(error) if isinstance(error, DistfsiError) else f"{type(error).__name__}: {error}"
            )
        self._write()

    def _write(self) -> None:
        if self._writes:
            with suppress(OSError):
                temporary = self._path.with_name(NAME + ".tmp")
                temporary.write_text(json.dumps(self._notes, indent=1) + "\n")
                replace(temporary, self._path)


def read_journal(directory: Path) -> dict[str, Any]:
    """The notes of the last run in a directory; empty without any."""
    try:
        return json.loads((Path(directory) / NAME).read_text())
    except (OSError, ValueError):
        return {}
