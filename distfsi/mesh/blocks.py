"""The grid of cells and its cut into blocks: their order, their owners, where they lie in memory.

Index axes are x, y, z in this order everywhere except in array shapes, where x is last and fastest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from distfsi.coordinates import Coordinates
from distfsi.coordinates.planar import PLANAR
from distfsi.device.interface import Device
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.curve import deal, morton_keys
from distfsi.mesh.kernels.grid import BlockGrid, BlockTable

GHOSTS = 2  # layers of ghost cells on each side of every used axis, where nothing asks for more

# What a part of a run must keep to go on, by kind and name, in a form that any number of ranks can take up:
#   cells      (local blocks, ..., bz, by, bx): whole blocks without ghosts
#   particles  (own, ...): rows in the order of (block, id), wherever a restart needs them
#   sums       (rows, ...): block by block; only what each adds to the total of all rows of all ranks matters
#   values     the same on all ranks
Snapshot = Mapping[str, Mapping[str, np.ndarray]]


T = TypeVar("T")


def _three(values: Sequence[T]) -> tuple[T, T, T]:
    x, y, z = values
    return x, y, z


@dataclass(frozen=True)
class Grid:
    """Equal cells of size `spacing` [m] from the corner `lower` [m]; always three axes.

    An unused axis has one cell, spacing 1, no ghosts and the boundary kinds ("none", "none").
    """

    dimensions: int
    cells: tuple[int, int, int]
    lower: tuple[float, float, float]
    spacing: tuple[float, float, float]
    boundaries: tuple[tuple[str, str], ...]
    ghost_layers: int = GHOSTS
    coordinates: Coordinates = PLANAR

    @classmethod
    def of(
        cls,
        lower: tuple[float, ...],
        upper: tuple[float, ...],
        cells: tuple[int, ...],
        boundaries: tuple[tuple[str, str], ...],
        ghost_layers: int = GHOSTS,
        coordinates: Coordinates = PLANAR,
    ) -> Grid:
        """The grid with the given values for each of its 1 to 3 dimensions."""
        unused = 3 - len(cells)
        spacing = [(b - a) / n for a, b, n in zip(lower, upper, cells, strict=True)]
        return cls(
            dimensions=len(cells),
            cells=_three([*cells, *[1] * unused]),
            lower=_three([*lower, *[0.0] * unused]),
            spacing=_three([*spacing, *[1.0] * unused]),
            boundaries=(*((low, high) for low, high in boundaries), *[("none", "none")] * unused),
            ghost_layers=ghost_layers,
            coordinates=coordinates,
        )

    @property
    def ghosts(self) -> tuple[int, int, int]:
        """Ghost layers on each side of x, y, z."""
        return _three([self.ghost_layers if axis < self.dimensions else 0 for axis in range(3)])

    @property
    def upper(self) -> tuple[float, float, float]:
        """The corner opposite to `lower` [m]."""
        return _three([a + n * h for a, n, h in zip(self.lower, self.cells, self.spacing, strict=True)])


class Blocks:
    """The blocks of a grid in the order of a Morton curve, and which of them this rank owns.

    grid, communicator
    block_cells     cells of a whole block along x, y, z
    along           blocks along x, y, z
    count           number of all blocks
    coordinates     (count, 3) index of each block among the blocks, along each axis
    curve_index     (along x, along y, along z) the inverse of `coordinates`
    owners          (count,) rank of each block; ascending
    first           curve index of this rank's first block
    local_count     number of this rank's blocks
    level           (local_count,) how often its cells are halved from those of the grid: 0, the only level there is
    origin          (local_count, 3) global index of the first active cell on its level
    extent          (local_count, 3) active cells; fewer than block_cells at the high ends of the grid
    spacing         (local_count, 3) size of its cells [m]
    shape           (Z, Y, X) of a block in memory, ghosts included
    """

    def __init__(
        self, grid: Grid, block_cells: tuple[int, ...], communicator: Communicator, costs: np.ndarray | None = None
    ) -> None:
        """`block_cells` per used axis; `costs` (count,) in curve order, by default the number of active cells."""
        self.grid = grid
        self.communicator = communicator
        cells = np.array(grid.cells)
        wanted = np.ones(3, dtype=np.int64)
        wanted[: grid.dimensions] = block_cells
        self.block_cells = tuple(np.minimum(wanted, cells).tolist())
        self.along = tuple((-(-cells // self.block_cells)).tolist())
        self.count = int(np.prod(self.along))

        coordinates = np.stack(np.unravel_index(np.arange(self.count), self.along), axis=1)
        self.coordinates = coordinates[np.argsort(morton_keys(coordinates))]
        self.curve_index = np.empty(self.along, dtype=np.int64)
        self.curve_index[tuple(self.coordinates.T)] = np.arange(self.count)

        origin = self.coordinates * self.block_cells
        extent = np.minimum(self.block_cells, cells - origin)
        self.owners = deal(extent.prod(axis=1) if costs is None else costs, communicator.size)
        self.first, end = np.searchsorted(self.owners, [communicator.rank, communicator.rank + 1]).tolist()
        self.local_count = end - self.first
        self.origin = origin[self.first : end]
        self.extent = extent[self.first : end]
        self.level = np.zeros(self.local_count, dtype=np.int64)
        self.spacing = np.array(grid.spacing) / 2.0 ** self.level[:, None]
        self.shape = tuple(n + 2 * g for n, g in zip(self.block_cells[::-1], grid.ghosts[::-1], strict=True))

    def grid_on(self, device: Device) -> BlockGrid:
        """What kernels of a device know of the grid and of this rank's blocks."""
        steps = (1, self.shape[2], self.shape[2] * self.shape[1])
        known = (self.shape, steps, self.grid.lower, self.grid.cells, self.origin, self.extent, self.spacing)
        return BlockGrid(*(device.array(np.array(values)) for values in known))

    def table_on(self, device: Device) -> BlockTable:
        """The same of which cells all blocks have."""
        cells, spacing, index = (np.array(v) for v in (self.block_cells, self.grid.spacing, self.curve_index))
        return BlockTable(device.array(cells), device.array(spacing), device.array(index), self.first)

    def allocate(self, variables: int, dtype: type = np.float64) -> np.ndarray:
        """A field of zeros (local_count, variables, Z, Y, X)."""
        return np.zeros((self.local_count, variables, *self.shape), dtype=dtype)

    def without_ghosts(self, field: np.ndarray) -> np.ndarray:
        """View (..., bz, by, bx) of a field (..., Z, Y, X): whole blocks, also where they are partly filled."""
        ghosts, cells = self.grid.ghosts[::-1], self.block_cells[::-1]
        where: tuple[Any, ...] = (..., *(slice(g, g + n) for g, n in zip(ghosts, cells, strict=True)))
        return np.asarray(field[where])

    def coordinates_of(self, positions: np.ndarray) -> np.ndarray:
        """Coordinates (n, 3) of the block that each of `positions` (n, dimensions) [m] is in or, outside, nearest to.

        Each coordinate is a non-decreasing function of the position along its axis, to the last bit.
        """
        coordinates = np.zeros((3, len(positions)), dtype=np.int64)  # an axis at a time is several times faster
        for axis in range(self.grid.dimensions):
            cell = np.floor((positions[:, axis] - self.grid.lower[axis]) / self.grid.spacing[axis])
            # fmin and fmax send a NaN to the last block, where np.clip would keep it and break the index.
            inside = np.fmax(np.fmin(cell, self.grid.cells[axis] - 1), 0)
            coordinates[axis] = inside.astype(np.int64) // self.block_cells[axis]
        return coordinates.T

    def block_of(self, positions: np.ndarray) -> np.ndarray:
        """Curve index (n,) of the block that each of `positions` (n, dimensions) [m] is in or, outside, nearest to."""
        return self.index_at(self.coordinates_of(positions))

    def index_at(self, coordinates: np.ndarray) -> np.ndarray:
        """Curve index (n,) of the blocks at `coordinates` (n, 3)."""
        return self.curve_index[tuple(coordinates.T)]

    def sum(self, values: np.ndarray) -> np.ndarray:
        """Total (k,) float64 of this and all other ranks' `values` (local_count, k) per block, added in block order."""
        everything = self.communicator.concatenate(np.asarray(values, dtype=np.float64))
        # np.sum adds in pairs; accumulate adds one by one.
        return np.add.accumulate(everything, axis=0)[-1]

    def cell_centers(self, block: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates x, y, z [m] of the centers of the active cells of local block `block`, one array per axis."""
        return tuple(
            low + (start + np.arange(number) + 0.5) * h
            for low, h, start, number in zip(
                self.grid.lower, self.spacing[block], self.origin[block], self.extent[block], strict=True
            )
        )
