"""What bodies do to a wall of the domain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from distfsi.gauges import AXES, Gauge, Kept, Run, TableProbe, each_step, per_extent
from distfsi.gauges.surface import Side
from distfsi.laws.law import entry


@dataclass(frozen=True)
class WallGauge(Gauge):
    """What bodies do to a wall of the domain: their mean force on it in the last step, and the impulse that they have
    given to it so far. The fluid's load is that of a surface gauge."""

    side: Side = entry("end of the domain; a wall")
    every: float | None = each_step()

    needs = "solid"

    @property
    def _end(self) -> tuple[int, int]:
        """Axis and side."""
        return AXES.index(self.side[0]), int(self.side.endswith("high"))

    def location(self, axes: str = AXES) -> str:
        return f"wall {self.side}"

    def walls(self) -> Mapping[str, tuple[int, int]]:
        return {"side": self._end}

    def faults(self, dimensions: int, bodies: Sequence[str]) -> Iterator[tuple[str, str]]:
        if self.side[0] not in AXES[:dimensions]:
            yield "side", f"'{self.side}' in a domain of {dimensions} dimension(s)"

    def probe(self, run: Run) -> TableProbe:
        return WallProbe(self._end, run)


class WallProbe(TableProbe):
    """Force and impulse by axis; both count from when the run began."""

    def __init__(self, end: tuple[int, int], run: Run):
        axes = AXES[: run.particles.dimensions]
        units = {name: per_extent(unit, len(axes)) for name, unit in (("force", "N"), ("impulse", "N s"))}
        self.columns = [f"{name}_{axis} [{unit}]" for name, unit in units.items() for axis in axes]
        self._end = end
        self._impulse = self._before = np.zeros(len(axes))

    def see(self, run: Run) -> None:
        self._before, self._impulse = self._impulse, run.particles.wall_impulse()[self._end]

    def rows(self, run: Run) -> np.ndarray:
        given = self._impulse - self._before
        return np.concatenate([given / run.dt if run.dt > 0.0 else np.full_like(given, np.nan), self._impulse])[None]

    def kept(self) -> Kept:
        return {"before": self._before, "impulse": self._impulse}

    def bring_back(self, kept: Kept) -> None:
        self._before, self._impulse = kept["before"], kept["impulse"]
