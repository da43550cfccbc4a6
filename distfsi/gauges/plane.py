"""A layer of cells."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from distfsi.gauges import AXES, Gauge, Layer, LayerProbe, Run, each_hundredth
from distfsi.laws.law import entry, quantity


@dataclass(frozen=True)
class PlaneGauge(Gauge):
    """The layer of cells that a plane passes through, as field files in gauges/NAME/; 2D and 3D."""

    axis: Literal["x", "y", "z"] = entry("axis that the plane is normal to")
    position: float = quantity("m", "where the plane cuts the axis")
    every: float | None = each_hundredth()

    per_step = False

    def positions(self) -> Mapping[str, Mapping[int, float]]:
        return {"position": {AXES.index(self.axis): self.position}}

    def faults(self, dimensions: int, bodies: Sequence[str]) -> Iterator[tuple[str, str]]:
        if dimensions == 1 or self.axis not in AXES[:dimensions]:
            yield "axis", f"'{self.axis}' in a domain of {dimensions} dimension(s)"

    def probe(self, run: Run) -> LayerProbe:
        return PlaneProbe(self, run)


class PlaneProbe(LayerProbe):
    """The cells of the layer, and of which blocks they are."""

    def __init__(self, gauge: PlaneGauge, run: Run):
        blocks, self._axis = run.blocks, AXES.index(gauge.axis)
        grid, axis = blocks.grid, self._axis
        cell = math.floor((gauge.position - grid.lower[axis]) / grid.spacing[axis])
        cell = min(max(cell, 0), grid.cells[axis] - 1)
        first, self._cell = cell - cell % blocks.block_cells[axis], cell % blocks.block_cells[axis]
        self._chosen = np.flatnonzero(blocks.origin[:, axis] == first)
        origin = blocks.origin[self._chosen].copy()
        origin[:, axis] = 0
        lower = self._with(grid.lower, grid.lower[axis] + cell * grid.spacing[axis])
        thin = replace(grid, cells=self._with(grid.cells, 1), lower=lower)
        self.layer = Layer(thin, self._with(blocks.block_cells, 1), origin)

    def _with(self, values: Sequence[Any], value: Any) -> tuple[Any, ...]:
        """`values` per axis, with `value` for the axis that the plane is normal to."""
        return tuple(value if axis == self._axis else v for axis, v in enumerate(values))

    def fields(self, run: Run) -> dict[str, np.ndarray]:
        fields = run.fluid_fields(self._chosen)
        return {name: np.take(field, [self._cell], axis=3 - self._axis) for name, field in fields.items()}
