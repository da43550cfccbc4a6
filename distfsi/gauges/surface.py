"""What a blast does to an end of the domain."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from distfsi.gauges import AXES, Gauge, Kept, LayerProbe, PressureRecord, Run, TableProbe, each_hundredth, per_extent
from distfsi.gauges.plane import PlaneGauge, PlaneProbe
from distfsi.laws.law import entry

Side = Literal["x_low", "x_high", "y_low", "y_high", "z_low", "z_high"]


@dataclass(frozen=True)
class SurfaceGauge(Gauge):
    """The load on an end of the domain: the force of its overpressure, the impulse of that, and the highest
    overpressure so far in gauges/NAME.csv; maps of overpressure, peak overpressure and impulse in gauges/NAME/. All are
    from the cells beside the end in each step; what bodies cover does not count; 2D and 3D."""

    side: Side = entry("end of the domain")
    every: float | None = each_hundredth()

    per_step = False

    def location(self, axes: str = AXES) -> str:
        return f"end {self.side}"

    def faults(self, dimensions: int, bodies: Sequence[str]) -> Iterator[tuple[str, str]]:
        if self.side[0] not in AXES[:dimensions] or dimensions == 1:
            yield "side", f"'{self.side}' in a domain of {dimensions} dimension(s)"

    def probe(self, run: Run) -> SurfaceProbe:
        return SurfaceProbe(self, run)


class SurfaceProbe(LayerProbe):
    """The cells beside the end, in the order of the grid, on all ranks.

    record, peak (n,)  their overpressure and impulse, and the highest overpressure so far [Pa]
    """

    def __init__(self, gauge: SurfaceGauge, run: Run):
        name: Any = gauge.side[0]
        axis, grid = AXES.index(name), run.blocks.grid
        at = grid.upper[axis] if gauge.side.endswith("high") else grid.lower[axis]
        self.layer = PlaneProbe(PlaneGauge(name, at, None), run).layer
        thin = self.layer.grid
        axes = [low + (np.arange(n) + 0.5) * h for low, n, h in zip(thin.lower, thin.cells, thin.spacing, strict=True)]
        self._shape = thin.cells[::-1]
        points = np.stack([x.ravel() for x in np.meshgrid(*axes[::-1], indexing="ij")[::-1]], axis=1)
        self._points = run.fluid_points(points[:, : grid.dimensions])
        self._record, self.peak = PressureRecord(len(points)), np.zeros(len(points))
        self.loads = np.zeros((len(points), 2))  # overpressure and impulse now
        self.area = math.prod(h for d, h in enumerate(grid.spacing) if d != axis)
        self.table = SurfaceTable(self, grid.dimensions)

    def see(self, run: Run) -> None:
        self.loads = self._record.of(run, self._points.values()[:, 0])
        self.peak = np.fmax(self.peak, self.loads[:, 0])

    def fields(self, run: Run) -> dict[str, np.ndarray]:
        maps = {"overpressure": self.loads[:, 0], "peak_overpressure": self.peak, "impulse": self.loads[:, 1]}
        return {name: self._in_blocks(values.reshape(self._shape)) for name, values in maps.items()}

    def _in_blocks(self, values: np.ndarray) -> np.ndarray:
        """Of the cells (nz, ny, nx) those of this rank's blocks (blocks, bz, by, bx), padded to whole blocks."""
        blocks = np.zeros((len(self.layer.origin), *self.layer.block_cells[::-1]))
        for block, origin in zip(blocks, self.layer.origin, strict=True):
            part = values[tuple(slice(a, a + n) for a, n in zip(origin[::-1], block.shape, strict=True))]
            block[tuple(slice(0, n) for n in part.shape)] = part
        return blocks

    def kept(self) -> Kept:
        return {**self._record.kept(), "peak": self.peak, "loads": self.loads}

    def bring_back(self, kept: Kept) -> None:
        self._record.bring_back(kept)
        self.peak, self.loads = kept["peak"], kept["loads"]


class SurfaceTable(TableProbe):
    """The surface as a whole; forces point out of the domain."""

    def __init__(self, surface: SurfaceProbe, dimensions: int):
        self._surface = surface
        force, impulse = (per_extent(unit, dimensions) for unit in ("N", "N s"))
        self.columns = [f"force [{force}]", f"impulse [{impulse}]", "peak_overpressure [Pa]"]

    def rows(self, run: Run) -> np.ndarray:
        force, impulse = self._surface.area * np.nansum(self._surface.loads, axis=0)
        return np.array([[force, impulse, self._surface.peak.max()]])
