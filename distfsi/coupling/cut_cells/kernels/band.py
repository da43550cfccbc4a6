"""Loops that list the band, the covered cells, and the loose ones: whole cells that the wall has left, in which the
volume that their fluid has swept is not quite theirs.

The band are all cells that are not whole or next to one that is not, and those whose neighbours' slopes a cell without
a fluid stops: two cells away, as the faces of whole cells are open. So the stage has the same fluxes around all others.

An item is a row of cells along x. Rows are numbered as they lie in memory, ghosts included; cells are named as in
coupling/kernels/cells.py.
"""

from distfsi.coupling.cut_cells.kernels.geometry import step_to
from distfsi.coupling.kernels.cells import COVERED, FLUID, cells_of_row
from distfsi.device.markers import driver, load, row, store
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS

# What a cell is to the coupling; the ghosts of all but the first must be known to it.
FAR, BAND, BEHIND, LOOSE = range(4)

OPEN, WHOLE = 1, 2

NEAR_WHOLE = 0.25  # of a cell: the fluid's stage advances open cells whose swept volume is not farther off


@row
def whole_row(whole, kind, fraction_old, fraction_new, swept, at, share, n):
    """whole[at …] = WHOLE where a cell is like any other of the fluid, throughout the step; OPEN where it holds fluid
    that flows, else 0."""
    for i in range(n):
        old, new, volume = load(fraction_old, at + i), load(fraction_new, at + i), load(swept, share + i)
        fluid, near = load(kind, at + i) == FLUID, abs(volume - 1.0) <= NEAR_WHOLE
        part = WHOLE if (old == 1.0) & (new == 1.0) & near else OPEN
        store(whole, at + i, part if fluid else 0)


@row
def join_row(plain, whole, at, step, least, n):
    """plain[at …] becomes 0 where the cell `step` away is less than `least`."""
    for i in range(n):
        store(plain, at + i, load(plain, at + i) if load(whole, at + step + i) >= least else 0)


@driver
def find_whole(begin, end, near, whole, kind, fraction_old, fraction_new, swept, fields, shape):
    """whole = what each cell of `near` blocks is to its neighbours' stage. swept (blocks, fields, Z, Y, X)."""
    cells = shape[0] * shape[1] * shape[2]
    for r in range(begin, end):
        b = r // (shape[0] * shape[1])
        if near[b] > 0:
            at = r * shape[2]
            whole_row(whole, kind, fraction_old, fraction_new, swept, at, at + b * (fields - 1) * cells, shape[2])


@driver
def find_band(begin, end, near, plain, mark, whole, kind, swept, fields, offsets, steps, shape, extent, counts):
    """mark = what each cell of `near` blocks is; counts (rows, 3) = cells in the band, covered and loose ones.

    plain becomes WHOLE where the fluid's stage has the fluxes of a cell right, else 0.
    """
    cells = shape[0] * shape[1] * shape[2]
    for r in range(begin, end):
        b, at = r // (shape[0] * shape[1]), r * shape[2] + 2
        n = cells_of_row(r, b, shape, extent) if near[b] > 0 else 0
        if n > 0:
            for i in range(n):
                store(plain, at + i, load(whole, at + i))
            join_row(plain, whole, at, 0, WHOLE, n)
            for m in range(len(offsets)):
                join_row(plain, whole, at, step_to(offsets, m, steps), WHOLE, n)
            for d in static_range(DIMENSIONS):
                join_row(plain, whole, at, -2 * steps[d], OPEN, n)
                join_row(plain, whole, at, 2 * steps[d], OPEN, n)
        share = at + b * (fields - 1) * cells
        band, covered, loose = 0, 0, 0
        for i in range(n):
            if kind[at + i] == COVERED:
                mark[at + i] = BEHIND
                covered += 1
            elif plain[at + i] == 0:
                mark[at + i] = BAND
                band += 1
            elif load(swept, share + i) != 1.0:
                mark[at + i] = LOOSE
                loose += 1
            else:
                mark[at + i] = FAR
        counts[r, 0] = band
        counts[r, 1] = covered
        counts[r, 2] = loose


@driver
def list_band(begin, end, near, mark, shape, extent, first, band, covered, loose):
    """Write the cells of the band, the covered and the loose ones, row by row, from the places first (rows, 3) on."""
    for r in range(begin, end):
        b, at = r // (shape[0] * shape[1]), r * shape[2] + 2
        n, m, l = first[r, 0], first[r, 1], first[r, 2]
        for i in range(cells_of_row(r, b, shape, extent) if near[b] > 0 else 0):
            if mark[at + i] == BEHIND:
                covered[m] = at + i
                m += 1
            elif mark[at + i] == BAND:
                band[n] = at + i
                n += 1
            elif mark[at + i] == LOOSE:
                loose[l] = at + i
                l += 1


@driver
def mark_band(begin, end, cells, mark, chosen):
    """chosen[n] = 1 where cells[n] is in the band or covered, else 0."""
    for n in range(begin, end):
        chosen[n] = 1 if mark[cells[n]] == BAND or mark[cells[n]] == BEHIND else 0
