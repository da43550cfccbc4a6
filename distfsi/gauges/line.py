"""The fluid along a line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from distfsi.gauges import Gauge, Kept, PressureRecord, Run, TableProbe, each_hundredth
from distfsi.laws.law import entry, vector


@dataclass(frozen=True)
class LineGauge(Gauge):
    """The fluid at equidistant points of a line: one row per point and time, values as for a point."""

    start: tuple[float, ...] = vector("m", "first point", key="from")
    end: tuple[float, ...] = vector("m", "last point", key="to")
    points: int = entry("number of points, the ends included", at_least=2, at_most=1_000_000)
    every: float | None = each_hundredth()

    per_step = False

    def positions(self) -> Mapping[str, Mapping[int, float]]:
        return {"from": dict(enumerate(self.start)), "to": dict(enumerate(self.end))}

    def probe(self, run: Run) -> TableProbe:
        return LineProbe(self, run)


class LineProbe(TableProbe):
    """A row per point, which begins with its position."""

    def __init__(self, gauge: LineGauge, run: Run):
        self._positions = np.linspace(gauge.start, gauge.end, gauge.points)
        self._points, self._record = run.fluid_points(self._positions), PressureRecord(gauge.points)
        positions = [f"{axis} [m]" for axis in run.blocks.grid.coordinates.axes[: self._positions.shape[1]]]
        self.columns = [*positions, *self._points.columns, *PressureRecord.columns]

    def rows(self, run: Run) -> np.ndarray:
        values = self._points.values()
        return np.hstack([self._positions, values, self._record.of(run, values[:, 0])])

    def kept(self) -> Kept:
        return self._record.kept()

    def bring_back(self, kept: Kept) -> None:
        self._record.bring_back(kept)
