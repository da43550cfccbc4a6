"""Where the time of a run goes: seconds of the named parts of its steps, over all ranks."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence

import numpy as np

from distfsi.device.timers import Timers
from distfsi.mesh.communicator import Communicator

DIGITS = 6  # behind the point, of seconds


class Performance:
    """Gives `performance.csv` its columns and rows: seconds since the last row, of each part the mean over the ranks,
    and those of the rank where it took longest. What the means do not add up to belongs to no part.

    sums  of the means in all rows so far [s], by part
    """

    def __init__(self, parts: Sequence[str], timers: Timers, communicator: Communicator):
        """`parts`: those that `timers` count."""
        self._parts, self._timers, self._communicator = tuple(parts), timers, communicator
        kinds = [f"{part} {kind} [s]" for part in parts for kind in ("mean", "maximum")]
        self.columns = ["step", "time [s]", "wall clock [s]", *kinds]
        self.sums = dict.fromkeys(self._parts, 0.0)
        self._since = clock.perf_counter()

    def row(self, step: int, time: float) -> list[float]:
        """Collective. Values of all columns, up to now."""
        own, now = self._timers.lap(), clock.perf_counter()
        seconds = np.array([[now - self._since, *(own.get(part, 0.0) for part in self._parts)]])
        self._since = now
        ranks = self._communicator.concatenate(seconds)
        mean, maximum = ranks.mean(axis=0), ranks.max(axis=0)
        for part, value in zip(self._parts, mean[1:], strict=True):
            self.sums[part] += float(value)
        values = np.round([maximum[0], *np.stack([mean, maximum], axis=1)[1:].ravel()], DIGITS)
        return [step, time, *values.tolist()]
