"""Which cells are merged, and the lists of the cells that the coupling deals with."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry, neighbour_offsets
from distfsi.coupling.cut_cells.kernels import band
from distfsi.coupling.cut_cells.kernels import merging as kernels
from distfsi.coupling.cut_cells.kernels.nodal_distance import CUT
from distfsi.coupling.cut_cells.kernels.records import Merging, Walls
from distfsi.coupling.cut_cells.values import CellLists
from distfsi.coupling.kernels.cells import FLUID
from distfsi.device.interface import DualArray
from distfsi.mesh.chosen import ChosenGhosts
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.kernels.rows import count_marked, list_marked
from distfsi.mesh.rows import Groups, Rows

DRIVERS = (
    kernels.find_targets,
    kernels.find_receivers,
    kernels.cover_absorbed,
    kernels.find_merging,
    band.find_whole,
    band.find_band,
    band.list_band,
    band.mark_band,
    count_marked,
    list_marked,
)


def minimum_isolated(spacing: Sequence[float], cfl: float) -> float:
    """The narrowest gap, in cells of a `spacing` [m], in which fluid between two walls is stable by itself.

    What the walls take of its momentum in a step is 2 c dt / gap, of which Runge-Kutta methods bear 2; the CFL number
    bounds the sum of c dt / h over the axes.
    """
    rates = [1.0 / h for h in spacing]
    return cfl * max(rates) / sum(rates)


class CellMerging:
    """What cells are, which of them are merged, and which ghosts are around the wall.

    kind    field (local blocks, 1, Z, Y, X) on host and device: FLUID, COVERED, ISOLATED (coupling/kernels/cells.py)
    ghosts  of cells in the band, covered or uneven: chosen anew with each list
    """

    def __init__(self, wall: WallGeometry, exchange: GhostExchange, row_kernels: SimpleNamespace, cfl: float):
        """`row_kernels`: those of mesh/chosen.py and mesh/rows.py as built by the device of the fields."""
        blocks, device = wall.blocks, wall.device
        D, spacing = blocks.grid.dimensions, blocks.grid.spacing[: blocks.grid.dimensions]
        self._wall, self._blocks, self._device, self._grid, self._exchange = wall, blocks, device, wall.grid, exchange
        constants = {"DIMENSIONS": D, "GHOSTS": blocks.grid.ghost_layers}
        self._kernels = device.build(DRIVERS, constants | {"MINIMUM_ISOLATED": minimum_isolated(spacing, cfl)})
        self._row_kernels, self._rows = row_kernels, Rows(device, self._kernels)
        self.ghosts = ChosenGhosts(exchange, device, row_kernels)
        self.kind = DualArray(device, blocks.allocate(1, np.uint8))
        self._target = device.array(blocks.allocate(D, np.int8))
        self._mark = device.array(blocks.allocate(1, np.int8))
        self._whole, self._plain = (device.array(blocks.allocate(1, np.uint8)).reshape(-1) for _ in ("whole", "plain"))
        self._offsets = device.array(neighbour_offsets(D))
        self._sequences = device.array(np.array(list(permutations(range(D)))))
        self._row_count = blocks.local_count * wall.rows_per_block

    @property
    def target(self) -> Any:
        """Flat field (local blocks, D, Z, Y, X): offset from a cell to its merge target or receiver, 0 without one."""
        return self._target.reshape(-1)

    def find_targets(self, walls: Walls, volume: Any) -> None:
        """Collective. What each cell is, and its merge target, or the receiver of what it holds; `volume` of fluid
        (local blocks, fields, Z, Y, X)."""
        near, k, grid = self._wall.near.read, self._kernels, self._grid
        known = (walls, volume, self.target, self._offsets, self._sequences, grid)
        self._device.run(k.find_targets, self._row_count, near, *known)
        self.fill_ghosts(self.kind.device, np.array([-1]), FLUID)
        self._device.run(k.find_receivers, self._row_count, near, walls, self.target, grid)
        self.fill_ghosts(self._target, np.arange(self._blocks.grid.dimensions), 0)

    def cover_absorbed(self) -> None:
        """Isolated cells that have handed their fluid to a receiver are covered."""
        kind = self.kind.device.reshape(-1)
        self._device.run(self._kernels.cover_absorbed, self._row_count, kind, self.target, self._grid)

    def list_cells(self, walls: Walls, volume: Any) -> CellLists:
        """Collective. Find the lists, and which ghosts are around the wall; a block without such cells is not near."""
        near, k, run, rows, grid = self._wall.near, self._kernels, self._device.run, self._row_count, self._grid
        mark = self._mark.reshape(-1)
        # count them row by row
        run(k.find_whole, rows, near.read, self._whole, walls, volume, grid)
        found = self._device.empty((rows, 3), np.int64)
        known = (self._plain, mark, self._whole, walls.kind, volume, self._offsets, found, grid)
        run(k.find_band, rows, near.read, *known)
        counts = self._device.download(found)
        # list them
        in_blocks = counts.reshape(self._blocks.local_count, self._wall.rows_per_block, 3).sum(axis=1)
        near.host()[(near.host() != CUT) & (in_blocks.sum(axis=1) == 0)] = 0
        near.changed()
        first = self._device.array(np.cumsum(counts, axis=0) - counts)
        lists = [self._device.empty(n, np.int64) for n in in_blocks.sum(axis=0)]
        run(k.list_band, rows, near.read, mark, first, *lists, grid)
        # choose ghosts
        self.fill_ghosts(self._mark, np.array([-1]), band.FAR)
        self.ghosts.choose(mark)
        band_cells = in_blocks[:, band.BAND_CELLS]
        band_list, covered, uneven = lists
        groups = Groups(self._device, self._row_kernels, band_cells)
        return CellLists(band_list, covered, uneven, band_cells, groups)

    def merging_of(self, cells: Any) -> tuple[Merging, Any]:
        """How the `cells` (n,) of the band are merged; and `above` (n, D): which of them are next to each other (see
        Band in coupling/cut_cells/kernels/records.py)."""
        count, D = cells.shape[0], self._blocks.grid.dimensions
        joined = self._device.empty((count, self._offsets.shape[0]), np.int8)
        above = self._device.empty((count, D), np.int64)
        merging = Merging(self.target, self._offsets, joined)
        self._device.run(self._kernels.find_merging, count, cells, merging, above, self._grid)
        return merging, above

    def rows_in_band(self, cells: Any) -> Any:
        """The rows of those of the `cells` (n,) that are in the band or covered."""
        chosen = self._device.empty(cells.shape[0], np.int8)
        self._device.run(self._kernels.mark_band, cells.shape[0], cells, self._mark.reshape(-1), chosen)
        return self._rows.marked(chosen)[1]

    @property
    def mark(self) -> Any:
        """Flat field (local blocks, 1, Z, Y, X): FAR, BAND … of coupling/cut_cells/kernels/band.py."""
        return self._mark.reshape(-1)

    def fill_ghosts(self, field: Any, mirror: np.ndarray, inflow: float) -> None:
        """Collective. Of a field, all that it has; inflows bring the value `inflow`."""
        self._exchange.start(field, mirror, np.full((3, 2, field.shape[1]), inflow))
        self._exchange.finish()
