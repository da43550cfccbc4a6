"""Loops of the cut cells' geometry: what distances at the corners of cells
(coupling/cut_cells/kernels/wall_distance.py) leave open of faces and cells, and which cells join which.

Cells are named as in coupling/kernels/cells.py. Cells around a block are looked at in its ghosts.
"""

from math import sqrt

from distfsi.coupling.cut_cells.kernels.wall_distance import CUT, corner_at
from distfsi.coupling.formulas.apertures import open_cell, open_face
from distfsi.coupling.kernels.cells import COVERED, DEEP, FLUID, cell_at, cells_of_row, row_place
from distfsi.device.markers import driver, helper, load, row, store
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LEAST_ALONE
from distfsi.formulas.tensors import dot

NEEDY = 0.5  # of a cell: with less the fluid in it joins a neighbour

SHUT = DEEP  # a cell whose faces are closed, with fluid in it


# ---- what is open ---------------------------------------------------------------------------------------------------


@row
def count_shut(distance, c, n):
    """How many of the n corners from c on are not in the fluid."""
    count = 0
    for i in range(n):
        count += 1 if load(distance, c + i) <= 0.0 else 0
    return count


@row
def open_row(before, fraction, aperture, at, face, cells, n):
    """The n cells from `at` on, and their low faces, are open; returns how many were not `before`."""
    count = 0
    for i in range(n):
        store(fraction, at + i, 1.0)
        count += 1 if load(before, at + i) < 1.0 else 0
    for d in static_range(DIMENSIONS):
        for i in range(n):
            store(aperture, face + d * cells + i, 1.0)
    return count


@driver
def open_up(begin, end, near, distance, before, fraction, aperture, shape, extent, is_cut):
    """fraction of each cell, and aperture (blocks, D, Z, Y, X) of its low faces, that is open; in `near` blocks.

    is_cut[r] = 1 where a cell of a row along x is not open as a whole, now or `before`, else 0.
    """
    cells = shape[0] * shape[1] * shape[2]
    uy, uz = (1 if DIMENSIONS > 1 else 0), (1 if DIMENSIONS > 2 else 0)
    gy, gz = (2 if DIMENSIONS > 1 else 0), (2 if DIMENSIONS > 2 else 0)
    sy, sz = shape[2] + 1, (shape[2] + 1) * (shape[1] + uy)
    for r in range(begin, end):
        b = r // (shape[0] * shape[1])
        j, k = r % shape[1] - gy, r // shape[1] % shape[0] - gz
        is_cut[r] = 0
        if near[b] == 0 or j >= extent[b, 1] + gy or k >= extent[b, 2] + gz:
            continue
        at, c, n = cell_at(b, -2, j, k, shape), corner_at(b, -2, j, k, shape), extent[b, 0] + 4
        shut = count_shut(distance, c, n + 1)
        if DIMENSIONS > 1:
            shut += count_shut(distance, c + sy, n + 1)
        if DIMENSIONS > 2:
            shut += count_shut(distance, c + sz, n + 1) + count_shut(distance, c + sz + sy, n + 1)
        if shut == 0:
            if open_row(before, fraction, aperture, at, at + b * (DIMENSIONS - 1) * cells, cells, n) > 0:
                is_cut[r] = 1
            continue
        for i in range(-2, extent[b, 0] + 2):
            at, c = cell_at(b, i, j, k, shape), corner_at(b, i, j, k, shape)
            d = (
                distance[c],
                distance[c + 1],
                distance[c + uy * sy],
                distance[c + uy * sy + 1],
                distance[c + uz * sz],
                distance[c + uz * sz + 1],
                distance[c + uz * sz + uy * sy],
                distance[c + uz * sz + uy * sy + 1],
            )
            face = at + b * (DIMENSIONS - 1) * cells
            least, most = d[0], d[0]
            for c in static_range(1, 8):
                least, most = min(least, d[c]), max(most, d[c])
            if least > 0.0 or most <= 0.0:
                part = 1.0 if least > 0.0 else 0.0
                fraction[at] = part
                for axis in static_range(DIMENSIONS):
                    aperture[face + axis * cells] = part
                if min(part, before[at]) < 1.0:
                    is_cut[r] = 1
                continue
            part = open_cell(d)
            fraction[at] = part if part > 1e-9 else 0.0
            is_cut[r] = 1
            aperture[face] = open_face((d[0], d[2], d[4], d[6]))
            if DIMENSIONS > 1:
                aperture[face + cells] = open_face((d[0], d[1], d[4], d[5]))
            if DIMENSIONS > 2:
                aperture[face + 2 * cells] = open_face((d[0], d[1], d[2], d[3]))


@driver
def round_parts(begin, end, near, fraction, shape):
    """fraction = that of stairs in `near` blocks: a cell is open as a whole or not at all. An item is a row of cells,
    ghosts included."""
    for r in range(begin, end):
        for at in range(r * shape[2], (r + 1) * shape[2] if near[r // (shape[0] * shape[1])] > 0 else r * shape[2]):
            fraction[at] = 1.0 if fraction[at] >= 0.5 else 0.0


@driver
def close_stairs(begin, end, near, fraction, aperture, shape, steps):
    """aperture = that of stairs in `near` blocks: a face is open between open cells only."""
    cells = shape[0] * shape[1] * shape[2]
    for r in range(begin, end):
        b = r // (shape[0] * shape[1])
        for at in range(r * shape[2], (r + 1) * shape[2] if near[b] > 0 else r * shape[2]):
            for axis in range(DIMENSIONS):
                before = max(at - steps[axis], b * cells)
                face = at + (b * (DIMENSIONS - 1) + axis) * cells
                aperture[face] = min(load(fraction, at), load(fraction, before))


@driver
def mark_cut_blocks(begin, end, near, is_cut, rows):
    """near (blocks,) = CUT where one of a block's `rows` is."""
    for b in range(begin, end):
        for r in range(b * rows, (b + 1) * rows):
            if is_cut[r] > 0:
                near[b] = CUT


# ---- who joins whom -------------------------------------------------------------------------------------------------


@helper
def opening(old, new, at, axis, cells):
    """Mean over the step of the open part of the low face of a cell along `axis`."""
    face = at + at // cells * (DIMENSIONS - 1) * cells + axis * cells
    return 0.5 * (load(old, face) + load(new, face))


@helper
def path_is_open(old, new, at, offset, sequence, steps, cells):
    """Whether one gets from a cell to the one at `offset`, along the axes in `sequence`, through open faces only."""
    here, least = at, 1.0
    for m in range(DIMENSIONS):
        axis = sequence[m]
        if offset[axis] != 0:
            face = here + steps[axis] if offset[axis] > 0 else here
            least = min(least, opening(old, new, face, axis, cells))
            here += offset[axis] * steps[axis]
    return least > 0.0


@helper
def smaller(old, new, at):
    """The smaller of a cell's open parts before and after the step."""
    return min(load(old, at), load(new, at))


@helper
def room(fraction_old, fraction_new, swept, at, share):
    """How much of a cell its fluid has, before and after the step: the least of what is open and what it fills."""
    return min(smaller(fraction_old, fraction_new, at), load(swept, share))


@row
def flow_row(kind, fraction_old, fraction_new, swept, at, share, n):
    """The n cells from `at` on hold FLUID that needs no company; returns how many need it nevertheless."""
    count = 0
    for i in range(n):
        store(kind, at + i, FLUID)
        count += 1 if room(fraction_old, fraction_new, swept, at + i, share + i) < NEEDY else 0
    return count


@row
def clear_row(master, first, cells, n):
    """The n cells whose first component in `master` is at `first` join no other."""
    for d in static_range(DIMENSIONS):
        for i in range(n):
            store(master, first + d * cells + i, 0)


@helper
def is_in_domain(index, offset, grid_cells):
    """Whether the cell at `offset` from the cell `index` of the grid is one of its cells."""
    inside = True
    for d in static_range(DIMENSIONS):
        place = index[d] + offset[d]
        inside = inside and place >= 0 and place < grid_cells[d]
    return inside


@helper
def slope_of_fraction(old, new, at, step):
    """How the open fractions grow along an axis."""
    return (load(old, at + step) + load(new, at + step)) - (load(old, at - step) + load(new, at - step))


@helper
def step_to(offsets, m, steps):
    """How far away in memory the neighbour number m is."""
    return sum(offsets[m, d] * steps[d] for d in static_range(DIMENSIONS))


@driver
def find_masters(
    begin, end, near, kind, master, fraction_old, fraction_new, swept, fields, aperture_old, aperture_new, offsets,
    sequences, steps, shape, origin, extent, grid_cells,
):  # fmt: skip
    """master (blocks, D, Z, Y, X) = where the fluid of a needy cell finds its company, 0 if nowhere or not needy.

    kind: FLUID if a cell has company or enough fluid to stand alone, SHUT if it has less and none, else COVERED.
    swept (blocks, fields, …): first the volume of the fluid.
    offsets (n, D): the neighbours in the order in which they are asked; sequences (n, D): ways through the axes.
    """
    cells = shape[0] * shape[1] * shape[2]
    for r in range(begin, end):
        b = r // (shape[0] * shape[1])
        j, k = row_place(r, shape)
        n, at = (cells_of_row(r, b, shape, extent) if near[b] > 0 else 0), cell_at(b, 0, j, k, shape)
        share, first = at + b * (fields - 1) * cells, at + b * (DIMENSIONS - 1) * cells
        clear_row(master, first, cells, n)
        for i in range(n if flow_row(kind, fraction_old, fraction_new, swept, at, share, n) > 0 else 0):
            at = cell_at(b, i, j, k, shape)
            share, first = at + b * (fields - 1) * cells, at + b * (DIMENSIONS - 1) * cells
            own = room(fraction_old, fraction_new, swept, at, share)
            if own >= NEEDY:
                continue
            index = (origin[b, 0] + i, origin[b, 1] + j, origin[b, 2] + k)
            grad = tuple(slope_of_fraction(fraction_old, fraction_new, at, steps[d]) for d in static_range(DIMENSIONS))
            steepness = sqrt(dot(grad, grad)) + 1e-12
            best, chosen = 0.0, -1
            for m in range(len(offsets)):
                if not is_in_domain(index, offsets[m], grid_cells):
                    continue
                step = step_to(offsets, m, steps)
                if room(fraction_old, fraction_new, swept, at + step, share + step) < NEEDY:
                    continue
                away = tuple(1.0 * offsets[m, d] for d in static_range(DIMENSIONS))
                length = sqrt(dot(away, away))
                cosine = dot(away, grad) / (length * steepness)
                score = load(fraction_new, at + step) * (2.0 + cosine) - 0.01 * length
                if score > best + 1e-12:
                    is_open = False
                    for s in range(len(sequences)):
                        is_open = is_open or path_is_open(
                            aperture_old, aperture_new, at, offsets[m], sequences[s], steps, cells
                        )
                    if is_open:
                        best, chosen = score, m
            if chosen >= 0:
                for d in static_range(DIMENSIONS):
                    master[first + d * cells] = offsets[chosen, d]
            elif load(swept, share) <= 0.0:
                kind[at] = COVERED
            elif own < LEAST_ALONE:
                kind[at] = SHUT


@driver
def find_refuges(
    begin, end, near, kind, master, fraction_new, aperture_old, aperture_new, steps, shape, origin, extent, grid_cells
):  # fmt: skip
    """master of SHUT cells = the most open of the FLUID cells behind open faces, which takes their fluid; 0 if none."""
    cells = shape[0] * shape[1] * shape[2]
    for r in range(begin, end):
        b = r // (shape[0] * shape[1])
        j, k = row_place(r, shape)
        for i in range(cells_of_row(r, b, shape, extent) if near[b] > 0 else 0):
            at = cell_at(b, i, j, k, shape)
            if kind[at] != SHUT:
                continue
            first = at + b * (DIMENSIONS - 1) * cells
            index = (origin[b, 0] + i, origin[b, 1] + j, origin[b, 2] + k)
            most = 0.0
            for axis in range(DIMENSIONS):
                for side in range(2):
                    way = 2 * side - 1
                    inside = index[axis] + way >= 0 and index[axis] + way < grid_cells[axis]
                    part = load(fraction_new, at + way * steps[axis])
                    if inside and kind[at + way * steps[axis]] == FLUID and part > most:
                        if opening(aperture_old, aperture_new, at + side * steps[axis], axis, cells) > 0.0:
                            most = part
                            for d in range(DIMENSIONS):
                                master[first + d * cells] = way if d == axis else 0


@driver
def cover_evicted(begin, end, kind, master, shape):
    """Cells that are shut and have a refuge are covered, and have none. An item is a row of cells, ghosts included."""
    cells = shape[0] * shape[1] * shape[2]
    for r in range(begin, end):
        b = r // (shape[0] * shape[1])
        for at in range(r * shape[2], (r + 1) * shape[2]):
            if kind[at] == SHUT:
                first, left = at + b * (DIMENSIONS - 1) * cells, 0
                for d in range(DIMENSIONS):
                    if master[first + d * cells] != 0:
                        left = 1
                        master[first + d * cells] = 0
                if left == 1:
                    kind[at] = COVERED
