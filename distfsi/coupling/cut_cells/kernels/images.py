"""Loops that tell which mirror images of particles count: those whose body reaches the end of the domain."""

from math import sqrt

from distfsi.coupling.kernels.interpolation import bins_around
from distfsi.device.markers import driver, helper
from distfsi.formulas.geometry import side_of_cube
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.mesh.kernels.particles import IMAGES


@helper
def way_along(dx, axis):
    """Length of a vector without its component along `axis`."""
    return sqrt(sum(0.0 if d == axis else dx[d] * dx[d] for d in static_range(DIMENSIONS)))


@driver
def weigh_images(
    begin, end, weight, place, size, lowest, highest, touching, apart, aside, farthest, key, volume, position, start,
    order, lower, search, low, window, strides,
):  # fmt: skip
    """weight (n, D) = how much the image of a particle at a `place` (n, D) in the nearer end of each axis counts.

    All if its body is no farther from that end than `touching` [m], nothing if it is `apart` [m] or more. The body is
    as near as the nearest of the cubes of the points at `position`, of `volume` (…, 2) [in the domain, in all], that
    stand no more than `aside` [m] beside the particle, farther by as much as they do stand so; `size` (n, 1): volume of
    its own cube. Particles `farthest` [m] from the end have no images.
    """
    reach = aside + apart
    for i in range(begin, end):
        for axis in static_range(DIMENSIONS):
            at_low = place[i, axis] - lowest[axis] < highest[axis] - place[i, axis]
            plane, sign = (lowest[axis] if at_low else highest[axis]), (1.0 if at_low else -1.0)
            depth = sign * (place[i, axis] - plane)
            gap = max(depth - 0.5 * side_of_cube(size[i, 0]), 0.0) if depth < farthest else apart
            if gap > touching and depth < farthest:
                foot = tuple(plane if d == axis else place[i, d] for d in static_range(DIMENSIONS))
                bx, by, bz = bins_around(
                    foot, tuple(reach for _ in static_range(DIMENSIONS)), lower, search, low, window
                )
                for k in range(bz[0], bz[1]):
                    for j in range(by[0], by[1]):
                        row = k * strides[2] + j * strides[1]
                        for n in range(start[row + bx[0]], start[row + bx[1]]):
                            q = order[n]
                            if key[q] % IMAGES == 0 and volume[q, 1] > 0.0:
                                dx = tuple(position[q, d] - foot[d] for d in static_range(DIMENSIONS))
                                above = max(sign * dx[axis] - 0.5 * side_of_cube(volume[q, 1]), 0.0)
                                gap = min(gap, above + max(way_along(dx, axis) - aside, 0.0))
            weight[i, axis] = min(max((apart - gap) / (apart - touching), 0.0), 1.0)


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
