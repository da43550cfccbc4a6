"""Loops that find signed distances from the wall at the corners of cells.

Particles are smoothed with a kernel; inverting its plane profile turns the sum at a corner into a distance that is
linear in the positions of the particles. Where a body is thinner than the diagonal of a cell its particles count as
balls, so that no cell sees both of its sides; these are cut off at edges, so that cracks open. Corners outside the
domain are seen in the mirror of its sides.
"""

from math import sqrt

from distfsi.coupling.formulas.immersed import broad_weight
from distfsi.coupling.kernels.interpolation import (
    any_particle,
    are_near,
    bins_around_all,
    distance2_to,
    is_within,
    put_place,
    sum_around_all,
)
from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.formulas.geometry import side_of_cube
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LANES
from distfsi.formulas.tensors import dot

NEARBY = 1.2  # kernel radii from where a body is thick to the particles of its corners
INSIDE, EDGE = 0.04, 0.09  # of a kernel's radius, to the mean of what is around: far from an edge, and at one

STRETCH = 8  # corners of a row that are left out together where no particle is near

# What a block is: far from all particles and whole; near particles or else; with cells that are not whole.
NEAR, CUT = 1, 2


@helper
def point_of(position, p):
    """Where a particle is [m]."""
    return tuple(position[p, d] for d in static_range(DIMENSIONS))


@helper
def particles_near(place, chosen, first, last, position, radius):
    """How many of the particles `chosen`, from the `first` on, before the `last`, are computed side by side: they are
    put to `place` (D, LANES), whose remaining points repeat one of them."""
    x, n = point_of(position, chosen[first]), 1
    while first + n < last and are_near(x, point_of(position, chosen[first + n]), radius):
        n += 1
    for i in range(LANES):
        put_place(place, i, point_of(position, chosen[first + min(i, n - 1)]))
    return n


@row
def fill_row(sums, box, place, position, order, first, last, volume, columns, radius, n):
    """sums (1 + D, n) grow by what particles, from the `first` to before the `last` in the order, fill of the broad
    kernels around the points `place` (D, n), and this times the ways [m] to them; the volume is the first of their
    `columns`."""
    for m in range(first, last):
        p = load(order, m)
        if is_within(radius, box, position, p):
            for i in range(n):
                part = load(volume, p * columns) * broad_weight(distance2_to(place, i, position, p), radius)
                store(sums, i, load(sums, i) + part)
                for d in static_range(DIMENSIONS):
                    way = load(position, p * DIMENSIONS + d) - load(place, d * LANES + i)
                    store(sums, (1 + d) * LANES + i, load(sums, (1 + d) * LANES + i) + part * way)


@driver
def fill_kernel(
    begin, end, filled, chosen, radius, volume, columns, position, start, order, lower, size, low, window, strides
):  # fmt: skip
    """filled (n, 1 + D) = share of the broad kernel around a particle that particles' volume, the first of `columns`,
    fills, and the mean way [m] from it to what fills it; n of the particles `chosen` are own ones. An item is a box of
    LANES of them."""
    place, sums = workspace(DIMENSIONS * LANES), workspace((1 + DIMENSIONS) * LANES)
    around = workspace(2 * DIMENSIONS)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            count = particles_near(place, chosen, first, last, position, radius)
            for v in range(len(sums)):
                sums[v] = 0.0
            bx, by, bz = bins_around_all(around, place, radius, lower, size, low, window)
            for k in range(bz[0], bz[1]):
                for j in range(by[0], by[1]):
                    row = k * strides[2] + j * strides[1]
                    fill_row(
                        sums, around, place, position, order, start[row + bx[0]], start[row + bx[1]], volume, columns,
                        radius, len(sums) // (1 + DIMENSIONS),
                    )  # fmt: skip
            for i in range(count):
                p = chosen[first + i]
                if p < len(filled):
                    filled[p, 0] = sums[i]
                    for d in static_range(DIMENSIONS):
                        filled[p, 1 + d] = sums[(1 + d) * LANES + i] / max(sums[i], 1e-300)
            first += count


@row
def lean_row(sums, box, place, position, filled, order, first, last, volume, columns, radius, around, n):
    """Of sums (2 + D, n) the first becomes the largest share that is `filled` of the kernels at particles within
    `around` of the points `place` (D, n), particles as in fill_row(); the others grow by their weights there, and by
    these times the mean way to what fills their kernels."""
    for m in range(first, last):
        p = load(order, m)
        if is_within(around, box, position, p):
            for i in range(n):
                distance2 = distance2_to(place, i, position, p)
                share = load(filled, p * (1 + DIMENSIONS)) if distance2 < around * around else 0.0
                part = load(volume, p * columns) * broad_weight(distance2, radius)
                store(sums, i, max(load(sums, i), share))
                store(sums, LANES + i, load(sums, LANES + i) + part)
                for d in static_range(DIMENSIONS):
                    lean = part * load(filled, p * (1 + DIMENSIONS) + 1 + d)
                    store(sums, (2 + d) * LANES + i, load(sums, (2 + d) * LANES + i) + lean)


@helper
def put_ball(ball, p, sums, i, radius, largest, thin, thick, volume):
    """Store the ball of a particle around which the `sums` of lean_row() are those number i."""
    own = largest * min(max((thick - sums[i]) / (thick - thin), 0.0), 1.0)
    own = own if volume > 0.0 else 0.0
    mean = tuple(sums[(2 + d) * LANES + i] / max(sums[LANES + i], 1e-300) for d in static_range(DIMENSIONS))
    length = sqrt(dot(mean, mean))
    cut = min(max((length / radius - INSIDE) / (EDGE - INSIDE), 0.0), 1.0)
    ball[p, 0] = own
    ball[p, 1] = own - cut * max(own - 0.5 * side_of_cube(max(volume, 1e-300)), 0.0)
    for d in static_range(DIMENSIONS):
        ball[p, 2 + d] = -mean[d] / max(length, 1e-300)


@driver
def thicken(
    begin, end, ball, filled, chosen, radius, largest, thin, thick, volume, columns, position, start, order, lower,
    size, low, window, strides,
):  # fmt: skip
    """ball (n, 2 + D) = radius [m] of a particle's ball, how far it goes outwards [m], and where that is; n of the
    particles `chosen` are own ones. An item is a box of LANES of them.

    The radius is `largest` in a body so thin that no kernel nearby is filled by more than the share `thin`, 0 where one
    is by `thick`. Outwards is away from what is around, on the mean over the particles around: across a thin body that
    mean is small, and at its edge it points along it. There the ball ends where the particle's cube does.
    """
    place, around = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS)
    sums = workspace((2 + DIMENSIONS) * LANES)
    reach = NEARBY * radius
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            count = particles_near(place, chosen, first, last, position, radius)
            least = thick
            for i in range(count):
                least = min(least, filled[chosen[first + i] * (1 + DIMENSIONS)])
            for v in range(len(sums)):
                sums[v] = 0.0
            bx, by, bz = bins_around_all(around, place, reach, lower, size, low, window)
            for k in range(bz[0], bz[1] if least < thick else bz[0]):
                for j in range(by[0], by[1]):
                    row = k * strides[2] + j * strides[1]
                    lean_row(
                        sums, around, place, position, filled, order, start[row + bx[0]], start[row + bx[1]], volume,
                        columns, radius, reach, len(sums) // (2 + DIMENSIONS),
                    )  # fmt: skip
            for i in range(count):
                p = chosen[first + i]
                if p < len(ball):
                    sums[i] = max(sums[i], filled[p * (1 + DIMENSIONS)])
                    put_ball(ball, p, sums, i, radius, largest, thin, thick, volume[p * columns])
            first += count


@driver
def mark_balls(begin, end, ball, volume, mark):
    """mark[p] = 1 where a particle counts as a ball, else 0."""
    for p in range(begin, end):
        mark[p] = 1 if ball[p, 0] > 0.0 and volume[p, 0] > 0.0 else 0


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


@row
def ball_row(nearest, box, place, position, order, first, last, ball, wide, reach, n):
    """nearest (n,) [m] = distances of the points `place` (D, n) to the balls of particles, as in fill_row(), within
    `reach`, where they are less; none is whose center is more than `wide` from all points."""
    for m in range(first, last):
        p = load(order, m)
        if is_within(wide, box, position, p):
            own = p * (2 + DIMENSIONS)
            for i in range(n):
                dx = tuple(
                    load(place, d * LANES + i) - load(position, p * DIMENSIONS + d) for d in static_range(DIMENSIONS)
                )
                outwards = tuple(load(ball, own + 2 + d) for d in static_range(DIMENSIONS))
                distance = max(sqrt(dot(dx, dx)) - load(ball, own), dot(dx, outwards) - load(ball, own + 1))
                known = load(nearest, i)
                store(nearest, i, min(known, distance) if dot(dx, dx) < reach * reach else known)


@helper
def nearest_balls(nearest, box, place, wide, reach, ball, position, start, order, lower, size, low, window, strides):
    """nearest (LANES,) [m] = distances of the points `place` (D, LANES) to the balls whose centers are within `reach`,
    where they are less; none is whose center is more than `wide` from all points. box (2 D,) is room."""
    bx, by, bz = bins_around_all(box, place, wide, lower, size, low, window)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            row = k * strides[2] + j * strides[1]
            ball_row(
                nearest, box, place, position, order, start[row + bx[0]], start[row + bx[1]], ball, wide, reach,
                len(nearest),
            )  # fmt: skip


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
    """Whether there may be particles within `reach` of the corners from `first` to before `last` of a row."""
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
def mark_corners(
    begin, end, near, distance, mark, radius, reach, start, lower, size, low, window, strides, shape, spacing, origin,
    extent, cells,
):  # fmt: skip
    """mark = 1 at corners of the cells of `near` blocks that may have particles within `reach`, else 0 and distance =
    `radius` [m]. An item is a row of corners along x."""
    for r in range(begin, end):
        b, j, k = corner_row(r, shape)
        last = corners_of_row(near, b, j, k, extent)
        row_seen = last > 0 and any_near(
            b, 0, last, j, k, reach, start, lower, size, low, window, strides, spacing, origin, cells
        )
        for first in range(0, last, STRETCH):
            end_of_stretch = min(first + STRETCH, last)
            seen = row_seen and any_near(
                b, first, end_of_stretch, j, k, reach, start, lower, size, low, window, strides, spacing, origin, cells
            )
            for n in range(first, end_of_stretch):
                at = corner_at(b, n - 2, j, k, shape)
                mark[at] = 1 if seen else 0
                distance[at] = radius


@helper
def place_of_corner(at, shape, lower, spacing, origin, cells):
    """Where a corner is [m], in the mirror of the domain's sides; corner_at() says how it is named."""
    row = at // (shape[2] + 1)
    b, j, k = corner_row(row, shape)
    return corner_place(b, at % (shape[2] + 1) - 2, j, k, lower, spacing, origin, cells)


@helper
def corners_near(place, chosen, first, last, radius, shape, lower, spacing, origin, cells):
    """How many of the corners `chosen`, from the `first` on, before the `last`, are computed side by side: they are put
    to `place` (D, LANES), whose remaining points repeat one of them."""
    x, n = place_of_corner(chosen[first], shape, lower, spacing, origin, cells), 1
    while first + n < last and are_near(
        x, place_of_corner(chosen[first + n], shape, lower, spacing, origin, cells), radius
    ):
        n += 1
    for i in range(LANES):
        put_place(place, i, place_of_corner(chosen[first + min(i, n - 1)], shape, lower, spacing, origin, cells))
    return n


@driver
def find_distances(
    begin, end, chosen, distance, radius, volume, columns, profile, position, start, order, lower, size, low, window,
    strides, shape, spacing, origin, cells,
):  # fmt: skip
    """distance [m] to the wall, at most `radius`, at the corners `chosen`, by how much of the kernel the first of
    `columns` of the volume (n, columns) fills. An item is a box of LANES of them."""
    place, around = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS)
    filled, weight = workspace(LANES), workspace(LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            count = corners_near(place, chosen, first, last, radius, shape, lower, spacing, origin, cells)
            sum_around_all(
                filled, weight, around, place, radius, volume, 1, columns, position, start, order, lower, size, low,
                window, strides,
            )  # fmt: skip
            for i in range(count):
                distance[chosen[first + i]] = off_corner(distance_of(filled[i], profile, radius), spacing)
            first += count


@driver
def add_balls(
    begin, end, chosen, distance, largest, reach, ball, position, start, order, lower, size, low, window, strides,
    shape, spacing, origin, cells,
):  # fmt: skip
    """distance becomes that to the balls, none more than the `largest` [m], where they are nearer, at the corners
    `chosen`. An item is a box of LANES of them."""
    place, around, nearest = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS), workspace(LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            count, wide = corners_near(place, chosen, first, last, reach, shape, lower, spacing, origin, cells), 0.0
            for i in range(LANES):
                nearest[i] = distance[chosen[first + min(i, count - 1)]]
                if nearest[i] > -largest:
                    wide = max(wide, min(reach, nearest[i] + 1.001 * largest))  # balls beyond are not nearer
            if wide > 0.0:
                nearest_balls(
                    nearest, around, place, wide, reach, ball, position, start, order, lower, size, low, window, strides
                )  # fmt: skip
            for i in range(count):
                at = chosen[first + i]
                distance[at] = min(distance[at], off_corner(nearest[i], spacing))
            first += count
