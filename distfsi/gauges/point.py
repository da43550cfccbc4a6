"""The fluid at a point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from distfsi.gauges import Gauge, Kept, PressureRecord, Run, TableProbe, each_step
from distfsi.laws.law import vector


@dataclass(frozen=True)
class PointGauge(Gauge):
    """The fluid at a point: pressure, density, velocity and, of several phases, volume fractions, overpressure and its
    impulse in gauges/NAME.csv. Values are linear between cell centers; covered cells do not count, and in a covered
    cell there is no value (nan)."""

    position: tuple[float, ...] = vector("m", "where")
    every: float | None = each_step()

    def positions(self) -> Mapping[str, Mapping[int, float]]:
        return {"position": dict(enumerate(self.position))}

    def probe(self, run: Run) -> TableProbe:
        return PointProbe(self, run)


class PointProbe(TableProbe):
    """A row of values per sample."""

    def __init__(self, gauge: PointGauge, run: Run):
        self._points, self._record = run.fluid_points(np.array([gauge.position])), PressureRecord(1)
        self.columns = [*self._points.columns, *PressureRecord.columns]

    def rows(self, run: Run) -> np.ndarray:
        values = self._points.values()
        return np.hstack([values, self._record.of(run, values[:, 0])])

    def kept(self) -> Kept:
        return self._record.kept()

    def bring_back(self, kept: Kept) -> None:
        self._record.bring_back(kept)
