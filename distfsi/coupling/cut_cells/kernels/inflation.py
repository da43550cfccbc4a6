"""Loops of thin-body inflation: where a body is thinner than the diagonal of a cell its particles count as spheres, so
that no cell sees both of its sides. Spheres are cut off at edges, so that cracks open.
"""

from math import sqrt
from typing import NamedTuple

from distfsi.coupling.formulas.immersed import broad_weight
from distfsi.coupling.kernels.interpolation import (
    Cloud,
    are_near,
    distance2_to,
    is_within,
    point_of,
    put_box,
    put_point,
)
from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.formulas.geometry import side_of_cube
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LANES
from distfsi.formulas.tensors import dot
from distfsi.mesh.kernels.search import bins_around_box, particles_of_row

NEARBY = 1.2  # kernel radii from where a body is thick to the particles of its corners
INSIDE, EDGE = 0.04, 0.09  # of a kernel's radius, to the mean of what is around: far from an edge, and at one


class Inflation(NamedTuple):
    """How thin bodies are inflated.

    radius       [m] of the kernel
    largest      [m] radius of a sphere
    thin, thick  shares of the kernel that a body fills: with the first its spheres have the largest radius, with the
                 second none
    """

    radius: float
    largest: float
    thin: float
    thick: float


@helper
def particles_near(points, chosen, first, last, position, radius):
    """How many of the particles `chosen`, from the `first` on, before the `last`, are computed side by side: they are
    put to `points` (D, LANES), whose remaining ones repeat one of them."""
    x, n = point_of(position, chosen[first]), 1
    while first + n < last and are_near(x, point_of(position, chosen[first + n]), radius):
        n += 1
    for i in range(LANES):
        put_point(points, i, point_of(position, chosen[first + min(i, n - 1)]))
    return n


# ---- how much of the kernel is filled -------------------------------------------------------------------------------


@row
def fill_row(sums, box, points, particles: Cloud, start, stop, radius, n):
    """sums (1 + D, n) grow by what particles, from `start` to before `stop` in the order, fill of the broad kernels
    around n points, and this times the ways [m] to them; their first value is the volume."""
    for m in range(start, stop):
        p = load(particles.bins.order, m)
        if is_within(radius, box, particles.position, p):
            for i in range(n):
                volume = load(particles.values, p * particles.values.shape[1])
                part = volume * broad_weight(distance2_to(points, i, particles.position, p), radius)
                store(sums, i, load(sums, i) + part)
                for d in static_range(DIMENSIONS):
                    way = load(particles.position, p * DIMENSIONS + d) - load(points, d * LANES + i)
                    store(sums, (1 + d) * LANES + i, load(sums, (1 + d) * LANES + i) + part * way)


@driver
def fill_kernel(begin, end, filled, chosen, radius, particles: Cloud):
    """filled (n, 1 + D) = share of the broad kernel around a particle that particles' volume, their first value, fills,
    and the mean way [m] from it to what fills it; n of the particles `chosen` are own ones. An item is a box of LANES
    of them."""
    points, sums = workspace(DIMENSIONS * LANES), workspace((1 + DIMENSIONS) * LANES)
    around = workspace(2 * DIMENSIONS)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            # particles that are near each other
            count = particles_near(points, chosen, first, last, particles.position, radius)
            for v in range(len(sums)):
                sums[v] = 0.0
            # what fills their kernels
            put_box(around, points)
            bx, by, bz = bins_around_box(around, radius, particles.bins)
            for k in range(bz[0], bz[1]):
                for j in range(by[0], by[1]):
                    start, stop = particles_of_row(bx, j, k, particles.bins)
                    fill_row(sums, around, points, particles, start, stop, radius, len(sums) // (1 + DIMENSIONS))
            for i in range(count):
                p = chosen[first + i]
                if p < len(filled):
                    filled[p, 0] = sums[i]
                    for d in static_range(DIMENSIONS):
                        filled[p, 1 + d] = sums[(1 + d) * LANES + i] / max(sums[i], 1e-300)
            first += count


# ---- spheres --------------------------------------------------------------------------------------------------------


@row
def lean_row(sums, box, points, filled, particles: Cloud, start, stop, radius, around, n):
    """Of sums (2 + D, n) the first becomes the largest share that is `filled` of the kernels at particles within
    `around` of n points, particles as in fill_row(); the others grow by their weights there, and by these times the
    mean way to what fills their kernels."""
    for m in range(start, stop):
        p = load(particles.bins.order, m)
        if is_within(around, box, particles.position, p):
            for i in range(n):
                distance2 = distance2_to(points, i, particles.position, p)
                share = load(filled, p * (1 + DIMENSIONS)) if distance2 < around * around else 0.0
                part = load(particles.values, p * particles.values.shape[1]) * broad_weight(distance2, radius)
                store(sums, i, max(load(sums, i), share))
                store(sums, LANES + i, load(sums, LANES + i) + part)
                for d in static_range(DIMENSIONS):
                    lean = part * load(filled, p * (1 + DIMENSIONS) + 1 + d)
                    store(sums, (2 + d) * LANES + i, load(sums, (2 + d) * LANES + i) + lean)


@helper
def put_sphere(sphere, p, sums, i, rule: Inflation, volume):
    """Store the sphere of a particle around which the `sums` of lean_row() are those number i."""
    own = rule.largest * min(max((rule.thick - sums[i]) / (rule.thick - rule.thin), 0.0), 1.0)
    own = own if volume > 0.0 else 0.0
    mean = tuple(sums[(2 + d) * LANES + i] / max(sums[LANES + i], 1e-300) for d in static_range(DIMENSIONS))
    length = sqrt(dot(mean, mean))
    cut = min(max((length / rule.radius - INSIDE) / (EDGE - INSIDE), 0.0), 1.0)
    sphere[p, 0] = own
    sphere[p, 1] = own - cut * max(own - 0.5 * side_of_cube(max(volume, 1e-300)), 0.0)
    for d in static_range(DIMENSIONS):
        sphere[p, 2 + d] = -mean[d] / max(length, 1e-300)


@driver
def inflate(begin, end, sphere, filled, chosen, rule: Inflation, particles: Cloud):
    """sphere (n, 2 + D) = radius [m] of a particle's sphere, how far it goes outwards [m], and where that is; n of the
    particles `chosen` are own ones. An item is a box of LANES of them.

    The radius is largest in a body so thin that no kernel nearby is filled by more than the share `thin`, 0 where one
    is by `thick`. Outwards is away from what is around, on the mean over the particles around: across a thin body that
    mean is small, and at its edge it points along it. There the sphere ends where the particle's cube does.
    """
    points, around = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS)
    sums = workspace((2 + DIMENSIONS) * LANES)
    reach = NEARBY * rule.radius
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            # particles that are near each other; is one of them in a thin body?
            count = particles_near(points, chosen, first, last, particles.position, rule.radius)
            minimum = rule.thick
            for i in range(count):
                minimum = min(minimum, filled[chosen[first + i] * (1 + DIMENSIONS)])
            # the thickest place around each, and where the body is from there
            for v in range(len(sums)):
                sums[v] = 0.0
            put_box(around, points)
            bx, by, bz = bins_around_box(around, reach, particles.bins)
            for k in range(bz[0], bz[1] if minimum < rule.thick else bz[0]):
                for j in range(by[0], by[1]):
                    start, stop = particles_of_row(bx, j, k, particles.bins)
                    n = len(sums) // (2 + DIMENSIONS)
                    lean_row(sums, around, points, filled, particles, start, stop, rule.radius, reach, n)
            for i in range(count):
                p = chosen[first + i]
                if p < len(sphere):
                    sums[i] = max(sums[i], filled[p * (1 + DIMENSIONS)])
                    put_sphere(sphere, p, sums, i, rule, particles.values[p, 0])
            first += count


@driver
def mark_inflated(begin, end, sphere, volume, mark):
    """mark[p] = 1 where a particle counts as a sphere, else 0."""
    for p in range(begin, end):
        mark[p] = 1 if sphere[p, 0] > 0.0 and volume[p, 0] > 0.0 else 0


# ---- distances from them --------------------------------------------------------------------------------------------


@row
def sphere_row(nearest, box, points, particles: Cloud, start, stop, wide, reach, n):
    """nearest (n,) [m] = distances of n points to the spheres of particles within `reach`, where they are less; none is
    whose center is more than `wide` from all points. Values of the particles: their spheres."""
    for m in range(start, stop):
        p = load(particles.bins.order, m)
        if is_within(wide, box, particles.position, p):
            own = p * (2 + DIMENSIONS)
            for i in range(n):
                dx = tuple(
                    load(points, d * LANES + i) - load(particles.position, p * DIMENSIONS + d)
                    for d in static_range(DIMENSIONS)
                )
                # a sphere, cut off outwards
                outwards = tuple(load(particles.values, own + 2 + d) for d in static_range(DIMENSIONS))
                cap = dot(dx, outwards) - load(particles.values, own + 1)
                distance = max(sqrt(dot(dx, dx)) - load(particles.values, own), cap)
                known = load(nearest, i)
                store(nearest, i, min(known, distance) if dot(dx, dx) < reach * reach else known)


@helper
def nearest_spheres(nearest, box, points, wide, reach, particles: Cloud):
    """nearest (LANES,) [m] = distances of the points (D, LANES) to the spheres whose centers are within `reach`, where
    they are less; none is whose center is more than `wide` from all points. box (2 D,) is room."""
    put_box(box, points)
    bx, by, bz = bins_around_box(box, wide, particles.bins)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            start, stop = particles_of_row(bx, j, k, particles.bins)
            sphere_row(nearest, box, points, particles, start, stop, wide, reach, len(nearest))
