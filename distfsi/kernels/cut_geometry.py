"""Loops of the cut cells' geometry: signed distances at the corners of cells, what they leave open of faces and cells,
and which cells join which.

Particles are smoothed with a kernel; inverting its plane profile turns the sum at a corner into a distance that is
linear in the positions of the particles. Where a body is thinner than the diagonal of a cell its particles count as
balls, so that no cell sees both of its sides; these are cut off at edges, so that cracks open.

Cells are named as in kernels/coupling.py. Cells around a block are looked at in its ghosts; corners outside the domain
are seen in the mirror of its sides.
"""

from math import sqrt

from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.kernels.contact import side_of_cube
from distfsi.kernels.coupling import COVERED, DEEP, FLUID, cell_at, cells_of_row, row_place
from distfsi.kernels.gather import any_particle, bins_around, sum_particles
from distfsi.physics.apertures import open_cell, open_face
from distfsi.physics.immersed import broad_weight
from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS
from distfsi.physics.tensors import dot

NEARBY = 1.2  # kernel radii from where a body is thick to the particles of its corners
INSIDE, EDGE = 0.04, 0.09  # of a kernel's radius, to the mean of what is around: far from an edge, and at one
STRETCH = 8  # corners of a row that are left out together where no particle is near
NEEDY = 0.5  # of a cell: with less the fluid in it joins a neighbour

SHUT = DEEP  # a cell whose faces are closed, with fluid in it

# What a block is: far from all particles and whole; near particles or else; with cells that are not whole.
NEAR, CUT = 1, 2

# ---- distances ------------------------------------------------------------------------------------------------------


@driver
def fill_kernel(begin, end, filled, radius, volume, position, start, order, lower, size, low, window, strides):
    """filled (n, 1 + D) = share of the broad kernel around a particle that particles' `volume` (n, 1) fills, and the
    mean way [m] from the particle to what fills it."""
    for p in range(begin, end):
        x = tuple(position[p, d] for d in static_range(DIMENSIONS))
        share, moment = 0.0, tuple(0.0 for _ in static_range(DIMENSIONS))
        bx, by, bz = bins_around(x, tuple(radius for _ in static_range(DIMENSIONS)), lower, size, low, window)
        for k in range(bz[0], bz[1]):
            for j in range(by[0], by[1]):
                row = k * strides[2] + j * strides[1]
                for n in range(start[row + bx[0]], start[row + bx[1]]):
                    q = order[n]
                    way = tuple(position[q, d] - x[d] for d in static_range(DIMENSIONS))
                    distance2 = dot(way, way)
                    if distance2 < radius * radius:
                        part = volume[q, 0] * broad_weight(distance2, radius)
                        share += part
                        moment = tuple(moment[d] + part * way[d] for d in static_range(DIMENSIONS))
        filled[p, 0] = share
        for d in static_range(DIMENSIONS):
            filled[p, 1 + d] = moment[d] / max(share, 1e-300)


@helper
def lean_around(lean, p, thick, filled, radius, volume, position, start, order, lower, size, low, window, strides):
    """The largest share that is filled of the kernels near a particle, and the sum of their weights; lean (D,) = the
    sum of the ways to what fills them, by weight. Where a share is `thick` no more than that is told."""
    most, total, around = filled[p, 0], 0.0, NEARBY * radius
    for d in range(DIMENSIONS):
        lean[d] = 0.0
    x = tuple(position[p, d] for d in static_range(DIMENSIONS))
    bx, by, bz = bins_around(x, tuple(around for _ in static_range(DIMENSIONS)), lower, size, low, window)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            row = k * strides[2] + j * strides[1]
            for n in range(start[row + bx[0]], start[row + bx[1]]):
                q = order[n]
                dx = tuple(x[d] - position[q, d] for d in static_range(DIMENSIONS))
                distance2 = dot(dx, dx)
                if distance2 < around * around:
                    most = max(most, filled[q, 0])
                    if most >= thick:
                        return (most, total)
                    part = volume[q, 0] * broad_weight(distance2, radius)
                    total += part
                    for d in range(DIMENSIONS):
                        lean[d] += part * filled[q, 1 + d]
    return (most, total)


@driver
def thicken(
    begin, end, ball, filled, radius, largest, thin, thick, volume, position, start, order, lower, size, low, window,
    strides,
):  # fmt: skip
    """ball (n, 2 + D) = radius [m] of a particle's ball, how far it goes outwards [m], and where that is.

    The radius is `largest` in a body so thin that no kernel nearby is filled by more than the share `thin`, 0 where one
    is by `thick`. Outwards is away from what is around, on the mean over the particles around: across a thin body that
    mean is small, and at its edge it points along it. There the ball ends where the particle's cube does.
    """
    lean = workspace(DIMENSIONS)
    for p in range(begin, end):
        for d in range(2 + DIMENSIONS):
            ball[p, d] = 0.0
        if filled[p, 0] >= thick or volume[p, 0] <= 0.0:
            continue
        most, total = lean_around(
            lean, p, thick, filled, radius, volume, position, start, order, lower, size, low, window, strides
        )
        own = largest * min(max((thick - most) / (thick - thin), 0.0), 1.0)
        if own <= 0.0:
            continue
        mean = tuple(lean[d] / total for d in static_range(DIMENSIONS))
        length = sqrt(dot(mean, mean))
        cut = min(max((length / radius - INSIDE) / (EDGE - INSIDE), 0.0), 1.0)
        ball[p, 0] = own
        ball[p, 1] = own - cut * max(own - 0.5 * side_of_cube(volume[p, 0]), 0.0)
        for d in static_range(DIMENSIONS):
            ball[p, 2 + d] = -mean[d] / max(length, 1e-300)


@driver
def mark_balls(begin, end, ball, mark):
    """mark[p] = 1 where a particle counts as a ball, else 0."""
    for p in range(begin, end):
        mark[p] = 1 if ball[p, 0] > 0.0 else 0


@helper
def distance_of(filled, profile, radius):
    """Distance [m] of a plane wall that fills this share of the kernel; profile: shares on one side of planes."""
    free = 1.0 - filled
    if free >= 1.0 or free <= 0.0:
        return radius if free > 0.0 else -radius
    first, last = 0, len(profile) - 1
    while last - first > 1:
        middle = (first + last) // 2
        if profile[middle] <= free:
            first = middle
        else:
            last = middle
    part = min(max((free - profile[first]) / (profile[last] - profile[first]), 0.0), 1.0)
    return radius * (2.0 * (first + part) / (len(profile) - 1) - 1.0)


@helper
def nearest_ball(x, reach, ball, position, start, order, lower, size, low, window, strides):
    """Distance [m] of a point to the balls whose centers are within `reach`, or that, if it is less."""
    nearest = reach
    bx, by, bz = bins_around(x, tuple(reach for _ in static_range(DIMENSIONS)), lower, size, low, window)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            row = k * strides[2] + j * strides[1]
            for n in range(start[row + bx[0]], start[row + bx[1]]):
                p = order[n]
                dx = tuple(x[d] - position[p, d] for d in static_range(DIMENSIONS))
                distance2 = dot(dx, dx)
                if distance2 < reach * reach:
                    outwards = tuple(ball[p, 2 + d] for d in static_range(DIMENSIONS))
                    nearest = min(nearest, max(sqrt(distance2) - ball[p, 0], dot(dx, outwards) - ball[p, 1]))
    return nearest


@helper
def corner_at(block, i, j, k, shape):
    """Flat index of the low corner of a cell in a field of corners."""
    gy, uy = (2, 1) if DIMENSIONS > 1 else (0, 0)
    gz, uz = (2, 1) if DIMENSIONS > 2 else (0, 0)
    return ((block * (shape[0] + uz) + k + gz) * (shape[1] + uy) + j + gy) * (shape[2] + 1) + i + 2


@helper
def mirrored(index, cells):
    """The plane between cells of which `index` is the image in the sides of the domain."""
    if index < 0:
        return -index
    if index > cells:
        return 2 * cells - index
    return index


@driver
def find_near(begin, end, near, search, start, lower, size, low, window, strides, spacing, origin, extent):
    """near (blocks,) = NEAR where there are particles nearby, or cells that were not whole, else 0."""
    for b in range(begin, end):
        middle = tuple(lower[d] + (origin[b, d] + 0.5 * extent[b, d]) * spacing[d] for d in static_range(DIMENSIONS))
        reach = tuple((0.5 * extent[b, d] + 2.0) * spacing[d] + search for d in static_range(DIMENSIONS))
        if near[b] > 0 or any_particle(middle, reach, start, lower, size, low, window, strides):
            near[b] = NEAR


@helper
def corner_place(b, i, j, k, lower, spacing, origin, cells):
    """Where the low corner of a cell of a block is [m], in the mirror of the domain's sides."""
    place = (
        mirrored(origin[b, 0] + i, cells[0]),
        mirrored(origin[b, 1] + j, cells[1]),
        mirrored(origin[b, 2] + k, cells[2]),
    )
    return tuple(lower[d] + place[d] * spacing[d] for d in static_range(DIMENSIONS))


@helper
def off_corner(distance, spacing):
    """A distance [m] that does not put the wall onto a corner."""
    least = 1e-7 * spacing[0]
    return least if abs(distance) < least else distance


@helper
def corner_row(r, shape):
    """Block, and places along y and z in it, of a row of corners along x."""
    gy, uy = (2, 1) if DIMENSIONS > 1 else (0, 0)
    gz, uz = (2, 1) if DIMENSIONS > 2 else (0, 0)
    b = r // ((shape[0] + uz) * (shape[1] + uy))
    return (b, r % (shape[1] + uy) - gy, r // (shape[1] + uy) % (shape[0] + uz) - gz)


@helper
def corners_of_row(near, b, j, k, extent):
    """How many corners of a row there are to look at: none in a block that is not `near`, or beyond its cells."""
    gy, uy = (2, 1) if DIMENSIONS > 1 else (0, 0)
    gz, uz = (2, 1) if DIMENSIONS > 2 else (0, 0)
    far = near[b] == 0 or j >= extent[b, 1] + gy + uy or k >= extent[b, 2] + gz + uz
    return 0 if far else extent[b, 0] + 5


@helper
def any_near(b, first, last, j, k, reach, start, lower, size, low, window, strides, spacing, origin, cells):
    """Whether there may be particles within `reach` of the corners first … last of a row."""
    x = corner_place(b, first - 2, j, k, lower, spacing, origin, cells)
    least, most = x[0], x[0]
    for n in range(first + 1, last):
        place = corner_place(b, n - 2, j, k, lower, spacing, origin, cells)
        least, most = min(least, place[0]), max(most, place[0])
    half, wide = 0.5 * (most - least), 1.001 * reach
    around = tuple(wide + half if d == 0 else wide for d in static_range(DIMENSIONS))
    middle = tuple(least + half if d == 0 else x[d] for d in static_range(DIMENSIONS))
    return any_particle(middle, around, start, lower, size, low, window, strides)


@driver
def find_distances(
    begin, end, near, distance, radius, volume, profile, position, start, order, lower, size, low, window, strides,
    shape, spacing, origin, extent, cells,
):  # fmt: skip
    """distance [m] to the wall, at most `radius`, at the corners of all cells of `near` blocks, by how much of the
    kernel is filled. An item is a row of corners along x."""
    sums = workspace(1)
    for r in range(begin, end):
        b, j, k = corner_row(r, shape)
        last = corners_of_row(near, b, j, k, extent)
        row_seen = last > 0 and any_near(
            b, 0, last, j, k, radius, start, lower, size, low, window, strides, spacing, origin, cells
        )
        for first in range(0, last, STRETCH):
            end = min(first + STRETCH, last)
            seen = row_seen and any_near(
                b, first, end, j, k, radius, start, lower, size, low, window, strides, spacing, origin, cells
            )
            for n in range(first, end):
                x = corner_place(b, n - 2, j, k, lower, spacing, origin, cells)
                sums[0] = 0.0
                if seen:
                    sum_particles(sums, x, radius, volume, position, start, order, lower, size, low, window, strides)
                value = distance_of(sums[0], profile, radius)
                distance[corner_at(b, n - 2, j, k, shape)] = off_corner(value, spacing)


@driver
def add_balls(
    begin, end, near, distance, largest, reach, ball, position, start, order, lower, size, low, window, strides, shape,
    spacing, origin, extent, cells,
):  # fmt: skip
    """distance becomes that to the balls, none more than the `largest` [m], where they are nearer. An item is a row of
    corners along x."""
    for r in range(begin, end):
        b, j, k = corner_row(r, shape)
        last = corners_of_row(near, b, j, k, extent)
        row_seen = last > 0 and any_near(
            b, 0, last, j, k, reach, start, lower, size, low, window, strides, spacing, origin, cells
        )
        for first in range(0, last if row_seen else 0, STRETCH):
            end = min(first + STRETCH, last)
            seen = any_near(
                b, first, end, j, k, reach, start, lower, size, low, window, strides, spacing, origin, cells
            )
            for n in range(first, end if seen else first):
                at = corner_at(b, n - 2, j, k, shape)
                if distance[at] > -largest:
                    x = corner_place(b, n - 2, j, k, lower, spacing, origin, cells)
                    wide = min(reach, distance[at] + 1.001 * largest)  # balls beyond are not nearer
                    value = nearest_ball(x, wide, ball, position, start, order, lower, size, low, window, strides)
                    distance[at] = min(distance[at], off_corner(value, spacing))


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
def is_needy(fraction_old, fraction_new, swept, at, share):
    """Whether the fluid in a cell has to join a neighbour's: it has little room, or fills little of it."""
    return min(smaller(fraction_old, fraction_new, at), load(swept, share)) < NEEDY


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

    kind: FLUID if a cell has enough fluid or company, SHUT if it has little and none, else COVERED. swept (blocks,
    fields, …): first the volume of the fluid.
    offsets (n, D): the neighbours in the order in which they are asked; sequences (n, D): ways through the axes.
    """
    cells = shape[0] * shape[1] * shape[2]
    for r in range(begin, end):
        b = r // (shape[0] * shape[1])
        j, k = row_place(r, shape)
        for i in range(cells_of_row(r, b, shape, extent) if near[b] > 0 else 0):
            at = cell_at(b, i, j, k, shape)
            share, first = at + b * (fields - 1) * cells, at + b * (DIMENSIONS - 1) * cells
            for d in static_range(DIMENSIONS):
                master[first + d * cells] = 0
            kind[at] = FLUID
            if not is_needy(fraction_old, fraction_new, swept, at, share):
                continue
            index = (origin[b, 0] + i, origin[b, 1] + j, origin[b, 2] + k)
            grad = tuple(slope_of_fraction(fraction_old, fraction_new, at, steps[d]) for d in static_range(DIMENSIONS))
            steepness = sqrt(dot(grad, grad)) + 1e-12
            best, chosen = 0.0, -1
            for m in range(len(offsets)):
                if not is_in_domain(index, offsets[m], grid_cells):
                    continue
                step = step_to(offsets, m, steps)
                if is_needy(fraction_old, fraction_new, swept, at + step, share + step):
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
            else:
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
