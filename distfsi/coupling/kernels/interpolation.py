"""Sums over the particles around points, found with the cells of a search grid (mesh/search.py).

LANES points that lie near each other are computed side by side: each particle around all of them counts for each, if
only with the weight 0. So the sum of a point has one order, whichever points are computed with it.
"""

from math import floor

from distfsi.coupling.formulas.immersed import immersed_weight
from distfsi.device.markers import helper, load, row, store
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LANES
from distfsi.formulas.tensors import dot

FARTHEST = 2.0  # in radii: how far along an axis points may be apart that are computed side by side


@helper
def bins_between(least, most, lower, size, low, window):
    """First and past-the-end search cell, along one axis of the window, of points from `least` to `most` [m]."""
    first = int(floor((least - lower) / size) - low) + 1
    last = int(floor((most - lower) / size) - low) + 1
    return (min(max(first, 0), window), min(max(last + 1, 0), window))


@helper
def bins_around(x, reach, lower, size, low, window):
    """The search cells, along three axes, of the points within `reach` (D,) of x."""
    by, bz = (0, 1), (0, 1)
    bx = bins_between(x[0] - reach[0], x[0] + reach[0], lower[0], size, low[0], window[0])
    if DIMENSIONS > 1:
        by = bins_between(x[1] - reach[1], x[1] + reach[1], lower[1], size, low[1], window[1])
    if DIMENSIONS > 2:
        bz = bins_between(x[2] - reach[2], x[2] + reach[2], lower[2], size, low[2], window[2])
    return (bx, by, bz)


@helper
def range_of(place, axis):
    """Least and largest coordinate along an axis of the points `place` (D, LANES)."""
    least, most = place[axis * LANES], place[axis * LANES]
    for i in range(1, LANES):
        least, most = min(least, place[axis * LANES + i]), max(most, place[axis * LANES + i])
    return (least, most)


@helper
def bins_around_all(box, place, reach, lower, size, low, window):
    """The search cells, along three axes, of what is within `reach` [m] of one of the points `place` (D, LANES); box
    (2 D,) = least and largest of their coordinates along each axis."""
    for d in static_range(DIMENSIONS):
        least, most = range_of(place, d)
        box[2 * d] = least
        box[2 * d + 1] = most
    by, bz = (0, 1), (0, 1)
    bx = bins_between(box[0] - reach, box[1] + reach, lower[0], size, low[0], window[0])
    if DIMENSIONS > 1:
        by = bins_between(box[2] - reach, box[3] + reach, lower[1], size, low[1], window[1])
    if DIMENSIONS > 2:
        bz = bins_between(box[4] - reach, box[5] + reach, lower[2], size, low[2], window[2])
    return (bx, by, bz)


@helper
def is_within(reach, box, position, p):
    """Whether a particle is within `reach` of a box, as of bins_around_all()."""
    x = tuple(load(position, p * DIMENSIONS + d) for d in static_range(DIMENSIONS))
    beyond = tuple(
        max(max(load(box, 2 * d) - x[d], x[d] - load(box, 2 * d + 1)), 0.0) for d in static_range(DIMENSIONS)
    )
    return dot(beyond, beyond) < reach * reach


@helper
def are_near(x, y, radius):
    """Whether two points are near enough to each other to be computed side by side."""
    near = True
    for d in static_range(DIMENSIONS):
        near = near and abs(x[d] - y[d]) <= FARTHEST * radius
    return near


@helper
def put_place(place, i, x):
    """The point number i of `place` (D, LANES) is x."""
    for d in static_range(DIMENSIONS):
        place[d * LANES + i] = x[d]


@helper
def distance2_to(place, i, position, p):
    """Squared distance [m2] of a particle from the point number i of `place` (D, LANES)."""
    dx = tuple(load(place, d * LANES + i) - load(position, p * DIMENSIONS + d) for d in static_range(DIMENSIONS))
    return dot(dx, dx)


@helper
def any_particle(center, reach, start, lower, size, low, window, strides):
    """Whether a search cell that a box of half width `reach` touches holds particles."""
    bx, by, bz = bins_around(center, reach, lower, size, low, window)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            row = k * strides[2] + j * strides[1]
            if start[row + bx[0]] < start[row + bx[1]]:
                return True
    return False


@helper
def sum_particles(sums, x, radius, values, position, start, order, lower, size, low, window, strides):
    """sums[:] = sum of values[p] W(|x - x_p|) over the particles p within `radius`, in the order of the search grid."""
    for v in range(len(sums)):
        sums[v] = 0.0
    bx, by, bz = bins_around(x, tuple(radius for _ in static_range(DIMENSIONS)), lower, size, low, window)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            row = k * strides[2] + j * strides[1]
            for n in range(start[row + bx[0]], start[row + bx[1]]):
                p = order[n]
                dx = tuple(x[d] - position[p, d] for d in static_range(DIMENSIONS))
                distance2 = dot(dx, dx)
                if distance2 < radius * radius:
                    weight = immersed_weight(distance2, radius)
                    for v in range(len(sums)):
                        sums[v] += weight * values[p, v]


@row
def add_weighted(sums, weight, box, place, position, order, first, last, radius, values, stride, width, n):
    """sums (width, n) grow by the first of the `stride` values of particles, from the `first` to before the `last` in
    the order, times the kernels around the points `place` (D, n); weight (n,) is room for these."""
    for m in range(first, last):
        p = load(order, m)
        if is_within(radius, box, position, p):
            for i in range(n):
                distance2 = min(distance2_to(place, i, position, p), radius * radius)
                store(weight, i, immersed_weight(distance2, radius))
            for v in range(width):
                value = load(values, p * stride + v)
                for i in range(n):
                    store(sums, v * LANES + i, load(sums, v * LANES + i) + load(weight, i) * value)


@helper
def sum_around_all(
    sums, weight, box, place, radius, values, width, stride, position, start, order, lower, size, low, window, strides
):  # fmt: skip
    """sums (width, LANES) = those of sum_particles() at the points `place` (D, LANES), of the first of `stride` values
    per particle; weight (LANES,) and box (2 D,) are room."""
    for v in range(width * LANES):
        sums[v] = 0.0
    bx, by, bz = bins_around_all(box, place, radius, lower, size, low, window)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            row = k * strides[2] + j * strides[1]
            add_weighted(
                sums, weight, box, place, position, order, start[row + bx[0]], start[row + bx[1]], radius, values,
                stride, width, len(weight),
            )  # fmt: skip
