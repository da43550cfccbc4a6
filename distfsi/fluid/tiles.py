"""How a rank's blocks are cut into tiles, the pieces that a stage computes at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from distfsi.device.interface import Device, DualArray
from distfsi.fluid.kernels import records
from distfsi.fluid.metrics import Metrics
from distfsi.mesh.blocks import Blocks


class Tiling:
    """The tiles of the blocks of a rank.

    table    (tiles, 8) as fluid/kernels/records.py names the columns
    size     (3,) cells of a whole tile
    first    (tiles, 3) first cell of each tile in the grid
    box      cells of a whole tile with its ghosts
    through  (tiles, 6, conserved) what has left through the domain's sides so far, per area of a face
    limited  (tiles,) faces at the low sides of its cells whose flux was limited so far
    """

    def __init__(self, blocks: Blocks, device: Device, tile_cells: Sequence[int], conserved: int, metrics: Metrics):
        self.size = [min(t, n) for t, n in zip((*tile_cells, 1, 1)[:3], blocks.block_cells, strict=True)]
        self.box = records.Box(*(n + 2 * g for n, g in zip(self.size, blocks.grid.ghosts, strict=True)))
        rows, first = [], []
        for block in range(blocks.local_count):
            extent, origin = blocks.extent[block], blocks.origin[block]
            starts = [range(0, extent[axis], self.size[axis]) for axis in range(3)]
            for z in starts[2]:
                for y in starts[1]:
                    for x in starts[0]:
                        start = np.array([x, y, z])
                        cells = np.minimum(self.size, extent - start)
                        sides = domain_sides(blocks, origin + start, cells)
                        rows.append([block, *(start + blocks.grid.ghosts), *cells, sides])
                        first.append(origin + start)
        self.table = np.array(rows, dtype=np.int64).reshape(-1, 8)
        self.first = np.array(first, dtype=np.int64).reshape(-1, 3)
        self.through = DualArray(device, np.zeros((len(self.table), 6, conserved)))
        self.limited = DualArray(device, np.zeros(len(self.table), dtype=np.int64))
        self._on_device, self._metrics = device.array(self.table), device.array(metrics.table)
        self._spacing = device.array(blocks.spacing)

    @property
    def block(self) -> np.ndarray:
        """(tiles,) the local block of each."""
        return self.table[:, records.BLOCK]

    @property
    def cells(self) -> np.ndarray:
        """(tiles,) how many cells each has."""
        return self.table[:, [records.NX, records.NY, records.NZ]].prod(axis=1)

    @property
    def touches_side(self) -> np.ndarray:
        """(tiles,) whether each touches a side of the domain."""
        return self.table[:, records.SIDES] > 0

    def arguments(self, calm: Any, stages: Any) -> records.Tiles:
        """What a stage is given: the tiles, which of them are calm and for how many stages each has been at rest."""
        counted = self.through.device, self.limited.device
        return records.Tiles(self._on_device, calm, stages, *counted, self._metrics, self._spacing)


def domain_sides(blocks: Blocks, first: np.ndarray, cells: np.ndarray) -> int:
    """Bits of the domain's sides that a tile touches, by its first cell in the grid; a periodic side is no side."""
    grid, bits = blocks.grid, 0
    for axis in range(grid.dimensions):
        for side, touches in enumerate((first[axis] == 0, first[axis] + cells[axis] == grid.cells[axis])):
            if touches and grid.boundaries[axis][side] != "periodic":
                bits |= 1 << (2 * axis + side)
    return bits
