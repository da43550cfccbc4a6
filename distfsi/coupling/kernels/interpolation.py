"""Interpolation: sums over the particles around points, weighted by a kernel.

Particles are found with a search grid (mesh/search.py). LANES points that lie near each other are computed side by
side: each particle around all of them counts for each, if only with the weight 0. So the sum of a point has one order,
whichever points are computed with it. The points side by side stand in `points` (D, LANES), flat; what is known of each
of them is LANES apart, too.
"""

from typing import Any, NamedTuple

from distfsi.coupling.formulas.immersed import immersed_weight
from distfsi.device.markers import helper, load, row, store
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LANES
from distfsi.formulas.tensors import dot
from distfsi.mesh.kernels.search import Bins, bins_around, bins_around_box, particles_of_row

FARTHEST = 2.0  # in radii: how far along an axis points may be apart that are computed side by side


class Cloud(NamedTuple):
    """Particles with values that are summed.

    position  (n, D) [m]
    values    (n, k) of each particle; often only the first of them are summed
    bins      the search cells that they are in
    """

    position: Any
    values: Any
    bins: Bins


# ---- points side by side --------------------------------------------------------------------------------------------


@helper
def point_of(position, p):
    """Where a particle is [m]."""
    return tuple(position[p, d] for d in static_range(DIMENSIONS))


@helper
def are_near(x, y, radius):
    """Whether two points are near enough to each other to be computed side by side."""
    near = True
    for d in static_range(DIMENSIONS):
        near = near and abs(x[d] - y[d]) <= FARTHEST * radius
    return near


@helper
def put_point(points, i, x):
    """The point number i is x."""
    for d in static_range(DIMENSIONS):
        points[d * LANES + i] = x[d]


@helper
def range_of(points, axis):
    """Least and largest coordinate of the points along an axis."""
    minimum, maximum = points[axis * LANES], points[axis * LANES]
    for i in range(1, LANES):
        minimum, maximum = min(minimum, points[axis * LANES + i]), max(maximum, points[axis * LANES + i])
    return (minimum, maximum)


@helper
def put_box(box, points):
    """box (2 D,) = least and largest coordinate of the points along each axis."""
    for d in static_range(DIMENSIONS):
        minimum, maximum = range_of(points, d)
        box[2 * d] = minimum
        box[2 * d + 1] = maximum


@helper
def is_within(reach, box, position, p):
    """Whether a particle is within `reach` of a box."""
    x = tuple(load(position, p * DIMENSIONS + d) for d in static_range(DIMENSIONS))
    beyond = tuple(
        max(max(load(box, 2 * d) - x[d], x[d] - load(box, 2 * d + 1)), 0.0) for d in static_range(DIMENSIONS)
    )
    return dot(beyond, beyond) < reach * reach


@helper
def distance2_to(points, i, position, p):
    """Squared distance [m2] of a particle from the point number i."""
    dx = tuple(load(points, d * LANES + i) - load(position, p * DIMENSIONS + d) for d in static_range(DIMENSIONS))
    return dot(dx, dx)


# ---- sums -----------------------------------------------------------------------------------------------------------


@helper
def sum_around(sums, x, radius, particles: Cloud):
    """sums[:] = sum of values[p] W(|x - x_p|) over the particles p within `radius` of one point, in the order of the
    search grid."""
    for v in range(len(sums)):
        sums[v] = 0.0
    # search cell by search cell, in the order of the particles' keys
    bx, by, bz = bins_around(x, tuple(radius for _ in static_range(DIMENSIONS)), particles.bins)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            start, stop = particles_of_row(bx, j, k, particles.bins)
            for n in range(start, stop):
                p = particles.bins.order[n]
                dx = tuple(x[d] - particles.position[p, d] for d in static_range(DIMENSIONS))
                distance2 = dot(dx, dx)
                if distance2 < radius * radius:
                    weight = immersed_weight(distance2, radius)
                    for v in range(len(sums)):
                        sums[v] += weight * particles.values[p, v]


@row
def add_weighted(sums, weight, box, points, particles: Cloud, start, stop, radius, width, n):
    """sums (width, n) grow by the first values of particles, from `start` to before `stop` in the order, times the
    kernels around the n points; weight (n,) is room for these."""
    for m in range(start, stop):
        p = load(particles.bins.order, m)
        if is_within(radius, box, particles.position, p):
            for i in range(n):
                distance2 = min(distance2_to(points, i, particles.position, p), radius * radius)
                store(weight, i, immersed_weight(distance2, radius))
            for v in range(width):
                value = load(particles.values, p * particles.values.shape[1] + v)
                for i in range(n):
                    store(sums, v * LANES + i, load(sums, v * LANES + i) + load(weight, i) * value)


@helper
def sum_around_points(sums, weight, box, points, radius, width, particles: Cloud):
    """sums (width, LANES) = those of sum_around() at all points, of the first values of the particles; weight (LANES,)
    and box (2 D,) are room."""
    for v in range(width * LANES):
        sums[v] = 0.0
    put_box(box, points)
    bx, by, bz = bins_around_box(box, radius, particles.bins)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            start, stop = particles_of_row(bx, j, k, particles.bins)
            add_weighted(sums, weight, box, points, particles, start, stop, radius, width, len(weight))
