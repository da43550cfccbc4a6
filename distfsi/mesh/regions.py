"""Where each ghost cell takes its value.

Along one axis a ghost cell's source is one active cell of the grid, found without looking at the other axes; it may be
mirrored, or be an inflow's constant. So the ghosts of a block are products of runs along the axes, and a product of
three runs is a region: a box of cells copied from one block. Tables of regions are worked off by one compiled routine,
`kernels.regions.copy_regions`, which also fills and empties the message buffers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from distfsi.mesh.blocks import Blocks

# A run of cells along one axis of a block. `block` and `source` count blocks along the axis, starts are indices
# in their memory. ghost 0: the block's own active cells; flip 1: mirrored; inflow: the side whose constant it is or -1.
RUN = np.dtype(
    {
        "names": ["block", "start", "length", "source", "source_start", "step", "flip", "inflow", "ghost"],
        "formats": [np.int64] * 9,
    }
)


def source_cell(index: int, cells: int, kinds: tuple[str, str]) -> tuple[int, int, int]:
    """Where cell `index` of an axis with `cells` active cells takes its value: (active cell, flip, inflow).

    flip is 1 when the value is mirrored; inflow is the side (0, 1) whose constant replaces the cell's value, or -1.
    """
    flip = 0
    while not 0 <= index < cells:
        side = int(index >= cells)
        if kinds[side] == "periodic":
            index %= cells
        elif kinds[side] == "outflow":
            index = side * (cells - 1)
        elif kinds[side] == "inflow":
            return side * (cells - 1), flip, side
        else:  # wall, symmetry, axis
            index = 2 * side * cells - 1 - index
            flip = 1 - flip
    return index, flip, -1


def axis_runs(cells: int, block_cells: int, ghosts: int, kinds: tuple[str, str]) -> np.ndarray:
    """The runs (RUN) of all blocks along an axis."""
    runs = []
    for block, begin in enumerate(range(0, cells, block_cells)):
        end = min(begin + block_cells, cells)
        runs.append((block, ghosts, end - begin, block, ghosts, 1, 0, -1, 0))
        for first in (begin - ghosts, end):
            start = first - begin + ghosts
            sources = [source_cell(index, cells, kinds) for index in range(first, first + ghosts)]
            for (source, flip, inflow), group in groupby(sources, lambda s: (s[0] // block_cells, *s[1:])):
                for indices in even_steps([cell % block_cells + ghosts for cell, *_ in group]):
                    step = indices[1] - indices[0] if len(indices) > 1 else 0
                    runs.append((block, start, len(indices), source, indices[0], step, flip, inflow, 1))
                    start += len(indices)
    return np.array(runs, dtype=RUN)


def even_steps(indices: list[int]) -> Iterator[list[int]]:
    """Cut a list where its steps change."""
    first = 0
    for n in range(2, len(indices) + 1):
        if n == len(indices) or (n - first >= 2 and indices[n] - indices[n - 1] != indices[first + 1] - indices[first]):
            yield indices[first:n]
            first = n
    if first < len(indices):
        yield indices[first:]


def products(runs: list[np.ndarray], coordinates: np.ndarray, end: str) -> np.ndarray:
    """All regions (n, 3) of RUN whose `end` ("block" or "source") is one of the blocks at `coordinates` (blocks, 3)."""
    rows = np.arange(len(coordinates))
    chosen: list[np.ndarray] = []
    for axis in range(3):
        run = np.sort(runs[axis], order=end)
        wanted = coordinates[rows, axis]
        first = np.searchsorted(run[end], wanted)
        number = np.searchsorted(run[end], wanted, side="right") - first
        repeat = np.repeat(np.arange(len(rows)), number)
        nth = np.arange(len(repeat)) - np.repeat(np.cumsum(number) - number, number)
        rows = rows[repeat]
        chosen = [other[repeat] for other in chosen] + [run[first[repeat] + nth]]
    return np.stack(chosen, axis=1)


@dataclass
class Regions:
    """Regions of ghost cells: the boxes `run` (n, 3) of RUN and the curve indices of the blocks at both ends."""

    run: np.ndarray
    block: np.ndarray
    source: np.ndarray

    @classmethod
    def of(cls, blocks: Blocks, end: str) -> Regions:
        """The ghost regions that have this rank's blocks at `end`, in the order of (block, index in the block)."""
        grid = blocks.grid
        runs = [axis_runs(grid.cells[a], blocks.block_cells[a], grid.ghosts[a], grid.boundaries[a]) for a in range(3)]
        run = products(runs, blocks.coordinates[blocks.first : blocks.first + blocks.local_count], end)
        run = run[(run["ghost"] == 1).any(axis=1)]
        block, source = (blocks.index_at(run[name]) for name in ("block", "source"))
        order = np.lexsort((*run["start"].T, block))
        return cls(run[order], block[order], source[order])

    def select(self, wanted: np.ndarray) -> Regions:
        """The regions with the given indices or mask."""
        return Regions(self.run[wanted], self.block[wanted], self.source[wanted])

    @property
    def constant(self) -> np.ndarray:
        """Which regions (n,) are filled with an inflow's constants."""
        return np.asarray((self.run["inflow"] >= 0).any(axis=1))

    @property
    def volume(self) -> np.ndarray:
        """Cells (n,) of each region."""
        return self.run["length"].prod(axis=1)

    def table(self, destination: np.ndarray, source: np.ndarray, mirrored: bool = True) -> np.ndarray:
        """The table of `kernels.regions.copy_regions` from the indices of both ends."""
        flips = self.flips if mirrored else np.zeros_like(self.block)
        return np.hstack([self.run["length"], flips[:, None], destination, source])

    def in_field(self, blocks: Blocks, variables: int, end: str) -> np.ndarray:
        """Indices (n, 5) of the `end` of each region in this rank's field."""
        size_z, size_y, size_x = blocks.shape
        strides = np.array([1, size_x, size_x * size_y])
        cells = size_x * size_y * size_z
        is_source = end == "source"
        start, step = (self.run["source_start"], self.run["step"]) if is_source else (self.run["start"], 1)
        block = self.source if is_source else self.block
        first = (block - blocks.first) * variables * cells + start @ strides
        return np.column_stack([first, np.full_like(first, cells), np.broadcast_to(step * strides, start.shape)])

    def cells(self, blocks: Blocks, end: str) -> np.ndarray:
        """The cells (n,) of the `end` of all regions, by their flat index in this rank's field of one variable."""
        first, _, *steps = self.in_field(blocks, 1, end).T
        nx, ny, _ = self.run["length"].T
        region = np.repeat(np.arange(len(first)), self.volume)
        nth = np.arange(len(region)) - np.repeat(np.cumsum(self.volume) - self.volume, self.volume)
        row = nth // nx[region]
        index = (nth % nx[region], row % ny[region], row // ny[region])
        return first[region] + sum(n * step[region] for n, step in zip(index, steps, strict=True))

    @property
    def flips(self) -> np.ndarray:
        """The axes (n,), as bits, along which each region is mirrored."""
        return self.run["flip"] @ (1, 2, 4)

    def in_message(self, variables: int) -> np.ndarray:
        """Indices (n, 5) in a buffer that holds the regions one after the other."""
        nx, ny, _ = self.run["length"].T
        volume = self.volume
        return np.column_stack([(np.cumsum(volume) - volume) * variables, volume, np.ones_like(nx), nx, nx * ny])

    def in_constants(self, variables: int) -> np.ndarray:
        """Indices (n, 5) in the inflow constants (3, 2, variables); where two inflows meet the lower axis counts."""
        inflow = self.run["inflow"]
        axis = np.argmax(inflow >= 0, axis=1)
        first = (2 * axis + inflow[np.arange(len(axis)), axis]) * variables
        return np.column_stack([first, np.ones_like(first), np.zeros_like(inflow)])
