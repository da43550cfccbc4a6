"""What passes the ends of the domain beside a wall: the fluid's stage, which sees no wall, counts it wrongly."""

from __future__ import annotations

from itertools import product
from math import prod
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels import fluxes as cut_fluxes
from distfsi.device.interface import DualArray
from distfsi.fluid.fluid import Fluid

DRIVERS = (cut_fluxes.book_sides,)


class Sides:
    """This rank's cells at the ends of the domain.

    passed  (n, conserved) on host and device: what the fluid counts as having left the domain there beside a wall, and
            has not
    """

    def __init__(self, fluid: Fluid, conserved: int, wall: WallGeometry, kernels: SimpleNamespace):
        """`kernels` holds DRIVERS; `conserved`: how many amounts a cell has."""
        self._wall, self._kernels, self._team, blocks = wall, kernels, wall.team, wall.blocks
        cells = np.arange(blocks.local_count * prod(blocks.shape)).reshape(-1, *blocks.shape)
        places, sides = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for block, (origin, extent) in enumerate(zip(blocks.origin, blocks.extent, strict=True)):
            active = fluid.active(cells, block)
            for axis, side in product(range(blocks.grid.dimensions), (0, 1)):
                if origin[axis] + side * extent[axis] == side * blocks.grid.cells[axis]:
                    places.append(active.take(-side, axis=2 - axis).ravel())
                    sides.append(np.full(len(places[-1]), 2 * axis + side))
        cell, side = np.concatenate(places), np.concatenate(sides)
        self._block = cell // prod(blocks.shape)
        self._cells = [self._team.array(a) for a in (cell, side)]
        self.passed = DualArray(self._team, np.zeros((len(side), conserved)))

    def choose(self) -> None:
        """After the band is known: the cells in it count."""
        self._near = self._wall.band_rows(self._cells[0])

    def book(self, U: Any, walls: tuple[Any, ...], rates: Any, weights: Any) -> None:
        """Add what a stage with the input U gets wrong; `walls`, `rates`, `weights` as book_sides() has them."""
        given = (self._near, *self._cells, self.passed.device, U, *walls, rates, weights)
        self._team.run(self._kernels.book_sides, self._near.shape[0], *given)

    def sums(self) -> np.ndarray:
        """`passed` of this rank's blocks (local blocks, conserved)."""
        count, passed = self._wall.blocks.local_count, self.passed.host()
        return np.stack([np.bincount(self._block, amounts, count) for amounts in passed.T], axis=1)

    def restore(self, passed: np.ndarray) -> None:
        """Go on from an earlier `passed`."""
        self.passed.host()[:] = passed
        self.passed.changed()
