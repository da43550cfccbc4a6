"""What passes the ends of the domain beside a wall: the fluid's stage, which sees no wall, counts it wrongly."""

from __future__ import annotations

from itertools import product
from math import prod
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.kernels import fluxes as cut_fluxes
from distfsi.coupling.cut_cells.kernels.records import Walls
from distfsi.device.interface import Device, DualArray
from distfsi.fluid.fluid import Fluid
from distfsi.mesh.kernels.grid import BlockGrid

DRIVERS = (cut_fluxes.account_sides,)


class Sides:
    """This rank's cells at the ends of the domain.

    cells   (n,) on the device
    passed  (n, conserved) on host and device: what the fluid counts as having left the domain there beside a wall, and
            has not
    """

    def __init__(self, fluid: Fluid, conserved: int, grid: BlockGrid, device: Device, kernels: SimpleNamespace):
        """`kernels` holds DRIVERS; `conserved`: how many amounts a cell has."""
        self._grid, self._kernels, self._device, self._blocks = grid, kernels, device, fluid.blocks
        blocks = fluid.blocks
        cells = np.arange(blocks.local_count * prod(blocks.shape)).reshape(-1, *blocks.shape)
        found, sides = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for block, (origin, extent) in enumerate(zip(blocks.origin, blocks.extent, strict=True)):
            active = fluid.active(cells, block)
            for axis, side in product(range(blocks.grid.dimensions), (0, 1)):
                if origin[axis] + side * extent[axis] == side * blocks.grid.cells[axis]:
                    found.append(active.take(-side, axis=2 - axis).ravel())
                    sides.append(np.full(len(found[-1]), 2 * axis + side))
        cell, ends = np.concatenate(found), np.concatenate(sides)
        self._block = cell // prod(blocks.shape)
        self.cells, self._side = device.array(cell), device.array(ends)
        self.passed = DualArray(device, np.zeros((len(ends), conserved)))

    def account(self, chosen: Any, U: Any, walls: Walls, dt: float, weight: float) -> None:
        """Add what a stage with the input U gets wrong at the rows `chosen` (m,) of the cells, those in the band; `dt`
        [s] of the step, `weight` [s]: that times the stage's share."""
        given = (chosen, self.cells, self._side, self.passed.device, U, walls, dt, weight, self._grid)
        self._device.run(self._kernels.account_sides, chosen.shape[0], *given)

    def sums(self) -> np.ndarray:
        """`passed` of this rank's blocks (local blocks, conserved)."""
        count, passed = self._blocks.local_count, self.passed.host()
        return np.stack([np.bincount(self._block, amounts, count) for amounts in passed.T], axis=1)

    def restore(self, passed: np.ndarray) -> None:
        """Go on from an earlier `passed`."""
        self.passed.host()[:] = passed
        self.passed.changed()
