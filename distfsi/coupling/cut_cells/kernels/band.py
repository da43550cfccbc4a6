"""Loops that list the band, the covered cells, and the uneven ones: whole cells that the wall has left, whose fluid
does not quite fill them.

The band are all cells that are not whole or next to one that is not, and those whose neighbours' slopes a cell without
a fluid stops: two cells away, as the faces of whole cells are open. So the stage has the same fluxes around all others.

An item is a row of cells along x, ghosts included.
"""

from distfsi.coupling.cut_cells.kernels.records import Walls
from distfsi.coupling.kernels.cells import COVERED, FLUID
from distfsi.device.markers import driver, load, row, store
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.mesh.kernels.grid import BlockGrid, block_of_row, block_size, cells_of_row, ghosts, step_to

# What a cell is to the coupling; the ghosts of all but the first must be known to it.
FAR, BAND, BEHIND, UNEVEN = range(4)

OPEN, WHOLE = 1, 2

NEAR_WHOLE = 0.25  # of a cell: the fluid's stage advances open cells whose fluid volume fraction is not farther off
SLOPE_REACH = 2  # cells: how far a cell without a fluid changes slopes

# Columns of the numbers of cells that find_band() counts.
BAND_CELLS, COVERED_CELLS, UNEVEN_CELLS = range(3)


@row
def whole_row(whole, walls: Walls, volume, at, first, n):
    """whole[at …] = WHOLE where a cell is like any other of the fluid, throughout the step; OPEN where it holds fluid
    that flows, else 0. first: of their volumes."""
    for i in range(n):
        old, new, held = load(walls.old_fraction, at + i), load(walls.new_fraction, at + i), load(volume, first + i)
        fluid, near = load(walls.kind, at + i) == FLUID, abs(held - 1.0) <= NEAR_WHOLE
        part = WHOLE if (old == 1.0) & (new == 1.0) & near else OPEN
        store(whole, at + i, part if fluid else 0)


@row
def compare_row(plain, whole, at, step, minimum, n):
    """plain[at …] becomes 0 where the cell a `step` away is less than the `minimum`."""
    for i in range(n):
        store(plain, at + i, load(plain, at + i) if load(whole, at + step + i) >= minimum else 0)


@driver
def find_whole(begin, end, near, whole, walls: Walls, volume, grid: BlockGrid):
    """whole = what each cell of `near` blocks is to its neighbours' stage. volume (blocks, fields, Z, Y, X)."""
    cells = block_size(grid)
    for r in range(begin, end):
        b = block_of_row(r, grid)
        if near[b] > 0:
            at = r * grid.shape[2]
            whole_row(whole, walls, volume, at, at + b * (volume.shape[1] - 1) * cells, grid.shape[2])


@driver
def find_band(begin, end, near, plain, mark, whole, kind, volume, offsets, counts, grid: BlockGrid):
    """mark = what each cell of `near` blocks is; counts (rows, 3) = cells in the band, covered and uneven ones.

    plain becomes WHOLE where the fluid's stage has the fluxes of a cell right, else 0.
    """
    cells = block_size(grid)
    for r in range(begin, end):
        b, at = block_of_row(r, grid), r * grid.shape[2] + ghosts()[0]
        n = cells_of_row(r, b, grid) if near[b] > 0 else 0
        # plain cells: whole among whole neighbours, and no slope of theirs is stopped
        if n > 0:
            for i in range(n):
                store(plain, at + i, load(whole, at + i))
            compare_row(plain, whole, at, 0, WHOLE, n)
            for m in range(len(offsets)):
                compare_row(plain, whole, at, step_to(offsets, m, grid), WHOLE, n)
            for d in static_range(DIMENSIONS):
                compare_row(plain, whole, at, -SLOPE_REACH * grid.steps[d], OPEN, n)
                compare_row(plain, whole, at, SLOPE_REACH * grid.steps[d], OPEN, n)
        # all others are of the band, or covered
        first = at + b * (volume.shape[1] - 1) * cells
        band, covered, uneven = 0, 0, 0
        for i in range(n):
            if kind[at + i] == COVERED:
                mark[at + i] = BEHIND
                covered += 1
            elif plain[at + i] == 0:
                mark[at + i] = BAND
                band += 1
            elif load(volume, first + i) != 1.0:
                mark[at + i] = UNEVEN
                uneven += 1
            else:
                mark[at + i] = FAR
        counts[r, BAND_CELLS] = band
        counts[r, COVERED_CELLS] = covered
        counts[r, UNEVEN_CELLS] = uneven


@driver
def list_band(begin, end, near, mark, first, band, covered, uneven, grid: BlockGrid):
    """Write the cells of the band, the covered and the uneven ones, row by row, from the indices first (rows, 3) on."""
    for r in range(begin, end):
        b, at = block_of_row(r, grid), r * grid.shape[2] + ghosts()[0]
        n, m, l = first[r, BAND_CELLS], first[r, COVERED_CELLS], first[r, UNEVEN_CELLS]
        for i in range(cells_of_row(r, b, grid) if near[b] > 0 else 0):
            if mark[at + i] == BEHIND:
                covered[m] = at + i
                m += 1
            elif mark[at + i] == BAND:
                band[n] = at + i
                n += 1
            elif mark[at + i] == UNEVEN:
                uneven[l] = at + i
                l += 1


@driver
def mark_band(begin, end, cells, mark, chosen):
    """chosen[n] = 1 where cells[n] is in the band or covered, else 0."""
    for n in range(begin, end):
        chosen[n] = 1 if mark[cells[n]] == BAND or mark[cells[n]] == BEHIND else 0
