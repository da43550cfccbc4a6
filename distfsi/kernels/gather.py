"""Sums over the particles around a point, found with the cells of a search grid (parts/search.py)."""

from math import floor

from distfsi.device.markers import helper
from distfsi.physics.immersed import immersed_weight
from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS
from distfsi.physics.tensors import dot


@helper
def bins_within(x, radius, lower, size, low, window):
    """First and past-the-end search cell, along one axis of the window, of points within `radius` of x."""
    first = int(floor((x - radius - lower) / size) - low) + 1
    last = int(floor((x + radius - lower) / size) - low) + 1
    return (min(max(first, 0), window), min(max(last + 1, 0), window))


@helper
def bins_around(x, reach, lower, size, low, window):
    """The search cells, along three axes, of the points within `reach` (D,) of x."""
    by, bz = (0, 1), (0, 1)
    bx = bins_within(x[0], reach[0], lower[0], size, low[0], window[0])
    if DIMENSIONS > 1:
        by = bins_within(x[1], reach[1], lower[1], size, low[1], window[1])
    if DIMENSIONS > 2:
        bz = bins_within(x[2], reach[2], lower[2], size, low[2], window[2])
    return (bx, by, bz)


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
