"""What is known of a run as a whole: what it computes, by whom, how it ended; `run.json` beside its results."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from distfsi import __version__
from distfsi.errors import DistfsiError, Diverged, OutputError, Stopped
from distfsi.output.files import write_text
from distfsi.output.interfaces import Communicator
from distfsi.output.manifest import claim

NAME = "run.json"
ENDINGS: dict[type[BaseException], str] = {Stopped: "stopped", Diverged: "diverged"}


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
            "ambient pressure [Pa]": scene.ambient_pressure,
            "phases": [phase.name for phase in scene.fluid.phases] if scene.fluid else [],
            "gauges": {name: gauge.location(scene.domain.coordinates.axes) for name, gauge in scene.gauges.items()},
        }
        if scene.origin:
            self._notes["input"] = asdict(scene.origin)

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
            with suppress(OSError, OutputError):
                claim(self._path)
                write_text(self._path, json.dumps(self._notes, indent=1) + "\n")


def read_journal(directory: Path) -> dict[str, Any]:
    """The notes of the last run in a directory; empty without any."""
    try:
        return json.loads((Path(directory) / NAME).read_text())
    except (OSError, ValueError):
        return {}
