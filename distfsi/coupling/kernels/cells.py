"""What a cell is to the coupling, and where it is.

A cell is named by its flat index `at` in a field of one variable: block * (cells in its memory) + place in the block.
`shape` (Z, Y, X) is that of a block in memory; `lower`, `spacing` are the grid's, `origin`, `extent` the blocks'.
"""

from math import floor

from distfsi.device.markers import helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS

# What a cell is: fluid; fluid since this step; not yet looked at; behind the wall; farther behind than fluxes look.
FLUID, FRESH, UNKNOWN, COVERED, DEEP = range(5)

# Columns of the numbers of cells of each kind that find_depth() counts.
COVERED_CELLS, DEEP_CELLS, FRESH_CELLS = range(3)


@helper
def cell_at(block, i, j, k, shape):
    """Flat index of an active cell of a block."""
    gy = 2 if DIMENSIONS > 1 else 0
    gz = 2 if DIMENSIONS > 2 else 0
    return ((block * shape[0] + k + gz) * shape[1] + j + gy) * shape[2] + i + 2


@helper
def row_place(r, shape):
    """Places along y and z, in its block, of a row of cells along x; rows are numbered as they lie in memory."""
    gy = 2 if DIMENSIONS > 1 else 0
    gz = 2 if DIMENSIONS > 2 else 0
    return (r % shape[1] - gy, r // shape[1] % shape[0] - gz)


@helper
def cells_of_row(r, b, shape, extent):
    """How many active cells a row has."""
    j, k = row_place(r, shape)
    return extent[b, 0] if j >= 0 and j < extent[b, 1] and k >= 0 and k < extent[b, 2] else 0


@helper
def center_of(at, shape, lower, spacing, origin):
    """Center [m] of the cell `at`."""
    block = at // (shape[0] * shape[1] * shape[2])
    gy = 2 if DIMENSIONS > 1 else 0
    gz = 2 if DIMENSIONS > 2 else 0
    index = (at % shape[2] - 2, at // shape[2] % shape[1] - gy, at // (shape[1] * shape[2]) % shape[0] - gz)
    return tuple(lower[d] + (origin[block, d] + index[d] + 0.5) * spacing[d] for d in static_range(DIMENSIONS))


@helper
def three(position, p):
    """Coordinates of a particle; an unused axis has one cell, from 0 to 1."""
    return (position[p, 0], position[p, 1] if DIMENSIONS > 1 else 0.5, position[p, 2] if DIMENSIONS > 2 else 0.5)


@helper
def home_of(x, lower, spacing, grid_cells, block_cells, curve_index):
    """Curve index of the block that x is in or, outside, nearest to."""
    own = tuple(
        max(min(int(floor((x[d] - lower[d]) / spacing[d])), grid_cells[d] - 1), 0) // block_cells[d]
        for d in static_range(3)
    )
    return curve_index[own[0], own[1], own[2]]
