"""Which tiles are at rest, so that a stage need not compute them and the result is the same to the bit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from distfsi.mesh.blocks import Blocks
from distfsi.mesh.regions import source_cell

# Stages at rest in a row after which all three buffers of the fluid hold what a stage has written: any four stages in a
# row write each of them. (Two would do but for the signs of zeros.)
SETTLED = 4


class Rest:
    """How long the tiles of this rank have been at rest.

    In a stage a tile rests when all cells that it reads, ghosts included, hold one state and the stage leaves it as it
    is. The kernel finds that from the values, and computes such a tile as one cell. A tile is *calm* when that need not
    even be looked at: all three buffers hold its state, and what it reads has not changed, since the tiles where its
    cells and ghosts come from rested in the last stage, with the same state, for they share cells.

    stages  (tiles + 1,) int64: for how many stages in a row each tile has rested; the kernel counts. The last entry
            stands for all that is not a tile of this rank (other ranks, an inflow) and stays 0
    calm    (tiles,) bool: those of the present stage
    counts  tile stages so far: [at rest, all]
    """

    def __init__(self, blocks: Blocks, first: np.ndarray, size: Sequence[int]):
        """`first` (tiles, 3): first cell of each tile in the grid; `size` (3,): cells of a whole tile."""
        self.stages = np.zeros(len(first) + 1, dtype=np.int64)
        self.calm = np.zeros(len(first), dtype=bool)
        self.counts = np.zeros(2, dtype=np.int64)
        self._sources = tile_sources(blocks, first, size)

    def begin_stage(self) -> None:
        """Find the calm tiles."""
        self.calm = self.settled & (self.stages[self._sources] > 0).all(axis=1)

    def end_stage(self) -> None:
        """Count the tiles that have rested."""
        self.counts += np.array([np.count_nonzero(self.stages), len(self.calm)])

    def wake(self, tiles: np.ndarray | slice = np.s_[:]) -> None:
        """Something else than a stage has written into `tiles` (by default all)."""
        self.stages[:-1][tiles] = 0

    @property
    def settled(self) -> np.ndarray:
        """(tiles,) whether a tile rested throughout the last step."""
        return self.stages[:-1] >= SETTLED


def tile_sources(blocks: Blocks, first: np.ndarray, size: Sequence[int]) -> np.ndarray:
    """Numbers (tiles, k) of the tiles from which the cells and ghosts of each tile come; -1 for what is not a tile of
    this rank. Arguments as for Rest."""
    positions, sources = zip(*(_along(blocks, axis, first[:, axis], size[axis]) for axis in range(3)), strict=True)
    number = np.full([len(source) + 1 for source in sources], -1)  # one more: index -1 leads to -1
    number[positions] = np.arange(len(first))
    x, y, z = (source[position] for source, position in zip(sources, positions, strict=True))
    found = number[x[:, :, None, None], y[:, None, :, None], z[:, None, None, :]]
    return found.reshape(len(first), int(np.prod(found.shape[1:])))  # -1 would fail on a rank without tiles


def _along(blocks: Blocks, axis: int, first: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Along one axis: the position of each tile, and of each position those (positions, k) that its cells come from."""
    cells, length, ghosts = blocks.grid.cells[axis], blocks.block_cells[axis], blocks.grid.ghosts[axis]
    starts = [s for block in range(0, cells, length) for s in range(block, min(block + length, cells), size)]
    edges = np.array([*starts, cells])
    position = np.repeat(np.arange(len(starts)), np.diff(edges))
    found = [source_cell(cell, cells, blocks.grid.boundaries[axis]) for cell in range(-ghosts, cells + ghosts)]
    source = np.array([position[cell] if inflow < 0 else -1 for cell, _, inflow in found])
    layers = np.arange(ghosts)
    read = np.hstack([edges[:-1, None] + layers, edges[:-1, None] + ghosts, edges[1:, None] + ghosts + layers])
    return position[first], np.unique(source[read], axis=1)
