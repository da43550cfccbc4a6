"""Loops that tell which mirror images of particles count: those whose body reaches the end of the domain."""

from math import sqrt
from typing import NamedTuple

from distfsi.coupling.cut_cells.kernels.particles import Domain
from distfsi.coupling.kernels.interpolation import Cloud
from distfsi.device.markers import driver, helper
from distfsi.formulas.geometry import side_of_cube
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.mesh.kernels.particles import IMAGES
from distfsi.mesh.kernels.search import bins_around, particles_of_row


class ImageRange(NamedTuple):
    """Which images count: all of one whose body is no farther from an end of the domain than `touching` [m], nothing of
    one that is `apart` [m] or more. Points belong to the body of a particle if they stand no more than `aside` [m]
    beside it, farther by as much as they do stand so. Particles `farthest` [m] from the end have no images."""

    touching: float
    apart: float
    aside: float
    farthest: float


@helper
def way_along(dx, axis):
    """Length of a vector without its component along `axis`."""
    return sqrt(sum(0.0 if d == axis else dx[d] * dx[d] for d in static_range(DIMENSIONS)))


@driver
def weigh_images(begin, end, weight, position, size, domain: Domain, ranges: ImageRange, key, points: Cloud):
    """weight (n, D) = how much the image of a particle at a `position` (n, D) in the nearer end of each axis counts.

    The body is as near as the nearest of the cubes of the `points`, whose values are volumes [in the domain, in all];
    size (n, 1): volume of the particle's own cube; key: of the points.
    """
    reach = ranges.aside + ranges.apart
    for i in range(begin, end):
        for axis in static_range(DIMENSIONS):
            # how far the particle's own cube is from the nearer end
            at_low = position[i, axis] - domain.lower[axis] < domain.upper[axis] - position[i, axis]
            plane, sign = (domain.lower[axis] if at_low else domain.upper[axis]), (1.0 if at_low else -1.0)
            depth = sign * (position[i, axis] - plane)
            own = max(depth - 0.5 * side_of_cube(size[i, 0]), 0.0)
            gap = own if depth < ranges.farthest else ranges.apart
            # how far the cubes of points beside it are
            if gap > ranges.touching and depth < ranges.farthest:
                foot = tuple(plane if d == axis else position[i, d] for d in static_range(DIMENSIONS))
                bx, by, bz = bins_around(foot, tuple(reach for _ in static_range(DIMENSIONS)), points.bins)
                for k in range(bz[0], bz[1]):
                    for j in range(by[0], by[1]):
                        start, stop = particles_of_row(bx, j, k, points.bins)
                        for n in range(start, stop):
                            q = points.bins.order[n]
                            if key[q] % IMAGES == 0 and points.values[q, 1] > 0.0:
                                dx = tuple(points.position[q, d] - foot[d] for d in static_range(DIMENSIONS))
                                above = max(sign * dx[axis] - 0.5 * side_of_cube(points.values[q, 1]), 0.0)
                                gap = min(gap, above + max(way_along(dx, axis) - ranges.aside, 0.0))
            weight[i, axis] = min(max((ranges.apart - gap) / (ranges.apart - ranges.touching), 0.0), 1.0)


@helper
def image_part(weight, i, mask):
    """How much an image counts that is mirrored along the axes in the bits of `mask`."""
    part = 1.0
    for d in static_range(DIMENSIONS):
        part = part * (weight[i, d] if mask >> d & 1 == 1 else 1.0)
    return part


@driver
def fade_images(begin, end, key, weight, width, values):
    """The first of `width` values of particles, ghosts and images becomes that part of it that counts."""
    for i in range(begin, end):
        values[i * width] = values[i * width] * image_part(weight, i, key[i] % IMAGES)
