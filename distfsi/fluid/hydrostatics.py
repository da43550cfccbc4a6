"""Columns of ghost cells at those ends of the domain that lie above or below the fluid."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from distfsi.device.interface import Device
from distfsi.fluid.kernels.hydrostatics import weigh_ghosts
from distfsi.fluid.model import FluidModel
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.exchange import GhostExchange

ENDS = {"wall": 1, "symmetry": 1, "outflow": 0}  # kinds of ends with fluid at rest beyond, and whether they mirror it


class WeighedGhosts:
    """The ghosts of this rank's blocks beyond ends of the domain along whose axis a body force acts."""

    def __init__(self, blocks: Blocks, exchange: GhostExchange, device: Device, model: FluidModel, real: str):
        self._device = device
        self._kernel = device.build([weigh_ghosts], model.constants, model.bindings, real).weigh_ghosts
        self._grid = blocks.grid_on(device)
        forces = model.body_force.acceleration
        axes = [axis for axis in range(blocks.grid.dimensions) if forces[axis] != 0.0]
        self._ready, self._waiting = (
            device.array(np.concatenate([np.empty((0, 4), dtype=np.int64), *_columns(blocks, chosen.tolist(), axes)]))
            for chosen in (exchange.ready, exchange.waiting)
        )

    def weigh(self, state: Any, waiting: bool) -> None:
        """Give the ghosts of a `state` their pressure: of the blocks that have been `waiting` for other ranks, or of
        the rest."""
        columns = self._waiting if waiting else self._ready
        self._device.run(self._kernel, columns.shape[0], columns, state, self._grid)


def _columns(blocks: Blocks, chosen: list[int], axes: list[int]) -> Iterable[np.ndarray]:
    """Rows (n, 4) of the table of columns, for each end of the `chosen` local blocks along `axes`."""
    grid, shape = blocks.grid, blocks.shape
    cells = np.arange(blocks.local_count * int(np.prod(shape))).reshape(-1, *shape)
    steps = (1, shape[2], shape[2] * shape[1])
    for block in chosen:
        for axis in axes:
            first, length = int(blocks.origin[block][axis]), int(blocks.extent[block][axis])
            for side, kind in enumerate(grid.boundaries[axis]):
                if kind in ENDS and first + side * length == side * grid.cells[axis]:
                    last = grid.ghosts[axis] + side * (length - 1)
                    at = cells[block].take(last, axis=2 - axis).ravel()
                    out = (2 * side - 1) * steps[axis]
                    yield np.column_stack([at, *(np.full_like(at, value) for value in (out, axis, ENDS[kind]))])
