"""The cells of a rank's blocks: how kernels name a cell, where it lies in memory, and where in space.

A cell is named by its flat index `at` in a field of one variable: block * (cells in its memory) + index in the block.
Rows of cells along x are numbered as they lie in memory, ghosts included.
"""

from math import floor
from typing import Any, NamedTuple

from distfsi.device.markers import helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, GHOSTS


class BlockGrid(NamedTuple):
    """A grid cut into blocks, of which this rank has some. Kernels know cells and their size from it alone.

    shape    (3,) cells of a block in memory along z, y, x, ghosts included
    steps    (3,) in memory from a cell to the next one along x, y, z
    lower    (3,) corner of the grid [m]
    cells    (3,) of the whole grid along x, y, z
    origin   (blocks, 3) index in the grid of each block's first active cell
    extent   (blocks, 3) active cells of each block
    spacing  (blocks, 3) size of its cells [m]
    """

    shape: Any
    steps: Any
    lower: Any
    cells: Any
    origin: Any
    extent: Any
    spacing: Any


class BlockTable(NamedTuple):
    """Which block a cell of the grid belongs to.

    block_cells  (3,) cells of a whole block along x, y, z
    spacing      (3,) size of the cells of the blocks in it [m]
    curve_index  (along x, along y, along z) number of each block
    first        number of this rank's first block
    """

    block_cells: Any
    spacing: Any
    curve_index: Any
    first: int


# ---- in memory ------------------------------------------------------------------------------------------------------


@helper
def ghosts():
    """Layers of ghost cells on each side along x, y, z."""
    return (GHOSTS, GHOSTS if DIMENSIONS > 1 else 0, GHOSTS if DIMENSIONS > 2 else 0)


@helper
def block_size(grid: BlockGrid):
    """Cells of a block in memory."""
    return grid.shape[0] * grid.shape[1] * grid.shape[2]


@helper
def block_of(at, grid: BlockGrid):
    """The block that a cell is in."""
    return at // block_size(grid)


@helper
def first_value(at, variables, cells):
    """Flat index of a cell's first value in a field of so many variables; the others are `cells` apart, which is the
    size of a block."""
    return at + at // cells * (variables - 1) * cells


@helper
def cell_at(block, i, j, k, grid: BlockGrid):
    """Flat index of a cell of a block, counted from its first active cell."""
    gx, gy, gz = ghosts()
    return ((block * grid.shape[0] + k + gz) * grid.shape[1] + j + gy) * grid.shape[2] + i + gx


@helper
def block_of_row(r, grid: BlockGrid):
    """The block that a row of cells is in."""
    return r // (grid.shape[0] * grid.shape[1])


@helper
def index_of_row(r, grid: BlockGrid):
    """Index of a row of cells along y and z, counted from the first active row of its block."""
    _, gy, gz = ghosts()
    return (r % grid.shape[1] - gy, r // grid.shape[1] % grid.shape[0] - gz)


@helper
def cells_of_row(r, block, grid: BlockGrid):
    """How many active cells a row of a block has."""
    j, k = index_of_row(r, grid)
    inside = j >= 0 and j < grid.extent[block, 1] and k >= 0 and k < grid.extent[block, 2]
    return grid.extent[block, 0] if inside else 0


@helper
def step_to(offsets, m, grid: BlockGrid):
    """Step in memory to the neighbour at the offset number m of `offsets` (n, D)."""
    return sum(offsets[m, d] * grid.steps[d] for d in static_range(DIMENSIONS))


# ---- in the grid ----------------------------------------------------------------------------------------------------


@helper
def index_of(at, grid: BlockGrid):
    """Index of a cell in the grid; that of a ghost cell may lie outside."""
    gx, gy, gz = ghosts()
    b = block_of(at, grid)
    return (
        grid.origin[b, 0] + at % grid.shape[2] - gx,
        grid.origin[b, 1] + at // grid.shape[2] % grid.shape[1] - gy,
        grid.origin[b, 2] + at // (grid.shape[1] * grid.shape[2]) % grid.shape[0] - gz,
    )


@helper
def is_in_grid(index, offset, grid: BlockGrid):
    """Whether the cell at an `offset` (D,) from the cell of an `index` is one of the grid's."""
    inside = True
    for d in static_range(DIMENSIONS):
        there = index[d] + offset[d]
        inside = inside and there >= 0 and there < grid.cells[d]
    return inside


@helper
def is_along(index, axis, way, grid: BlockGrid):
    """Whether the cell `way` cells along an axis from the cell of an index is one of the grid's."""
    there = index[axis] + way
    return there >= 0 and there < grid.cells[axis]


@helper
def center_of(index, block, grid: BlockGrid):
    """Center [m] of the cell of an index in the grid, of the size of those of a block."""
    return tuple(grid.lower[d] + (index[d] + 0.5) * grid.spacing[block, d] for d in static_range(DIMENSIONS))


@helper
def center_of_cell(at, grid: BlockGrid):
    """Center [m] of a cell."""
    return center_of(index_of(at, grid), block_of(at, grid), grid)


@helper
def middle_of(block, grid: BlockGrid):
    """Middle [m] of a block's active cells."""
    return tuple(
        grid.lower[d] + (grid.origin[block, d] + 0.5 * grid.extent[block, d]) * grid.spacing[block, d]
        for d in static_range(DIMENSIONS)
    )


@helper
def cell_volume(block, grid: BlockGrid):
    """Volume of a block's cells [m^d]."""
    return grid.spacing[block, 0] * grid.spacing[block, 1] * grid.spacing[block, 2]


@helper
def block_coordinate(x, axis, grid: BlockGrid, table: BlockTable):
    """Coordinate along an axis of the block that x [m] is in or, outside, nearest to, as mesh/blocks.py finds it."""
    cell = (x - grid.lower[axis]) / table.spacing[axis]
    last = 1.0 * (grid.cells[axis] - 1)
    return int(floor(max(min(cell, last), 0.0))) // table.block_cells[axis]


@helper
def block_at(position, i, grid: BlockGrid, table: BlockTable):
    """Number of the block that a particle is in or, outside, nearest to."""
    bx, by, bz = block_coordinate(position[i, 0], 0, grid, table), 0, 0
    if DIMENSIONS > 1:
        by = block_coordinate(position[i, 1], 1, grid, table)
    if DIMENSIONS > 2:
        bz = block_coordinate(position[i, 2], 2, grid, table)
    return table.curve_index[bx, by, bz]
