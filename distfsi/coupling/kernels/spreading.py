"""Spreading: cells give to the particles around them, by the weights with which they see these.

LANES particles of one block that lie near each other are computed side by side, as points in
coupling/kernels/interpolation.py.
"""

from math import floor
from typing import Any, NamedTuple

from distfsi.coupling.formulas.immersed import immersed_weight
from distfsi.coupling.kernels.interpolation import are_near, point_of, put_point, range_of
from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LANES, TRANSFERRED
from distfsi.formulas.tensors import dot
from distfsi.mesh.kernels.grid import (
    BlockGrid,
    BlockTable,
    block_at,
    block_size,
    cell_at,
    center_of,
    first_value,
    ghosts,
)


class Receivers(NamedTuple):
    """Particles that cells give to.

    position  (n, D) [m]
    home      (n,) local block whose cells give to them
    image     (n, D): how much their images in the ends of the domain count, along each axis
    """

    position: Any
    home: Any
    image: Any


@driver
def find_homes(begin, end, start, home, grid: BlockGrid, table: BlockTable):
    """home[p] = the local block that a particle was in at the `start` of the step."""
    for p in range(begin, end):
        home[p] = block_at(start, p, grid, table) - table.first


@helper
def cells_between(minimum, maximum, axis, block, seen, grid: BlockGrid):
    """First and past-the-end cell along an axis, in the memory of a block, whose centers are from `minimum` to
    `maximum`; seen (3, 2): first and past-the-end cell of the grid that may be looked at."""
    layers = ghosts()[0]
    low = int(floor((minimum - grid.lower[axis]) / grid.spacing[block, axis] + 0.5))
    high = int(floor((maximum - grid.lower[axis]) / grid.spacing[block, axis] - 0.5))
    first = max(grid.origin[block, axis] - layers, seen[axis, 0])
    end = min(grid.origin[block, axis] + grid.extent[block, axis] + layers, seen[axis, 1])
    return (max(low, first), min(high + 1, end))


@helper
def cells_around(points, radius, block, seen, grid: BlockGrid):
    """The cells along three axes, in the memory of a block, within `radius` of the points."""
    x, iy, iz = range_of(points, 0), (0, 1), (0, 1)
    ix = cells_between(x[0] - radius, x[1] + radius, 0, block, seen, grid)
    if DIMENSIONS > 1:
        y = range_of(points, 1)
        iy = cells_between(y[0] - radius, y[1] + radius, 1, block, seen, grid)
    if DIMENSIONS > 2:
        z = range_of(points, 2)
        iz = cells_between(z[0] - radius, z[1] + radius, 2, block, seen, grid)
    return (ix, iy, iz)


@row
def spread_row(total, points, part, center, outside, field, first, cells, radius, n):
    """total (TRANSFERRED, n) grows by the kernels around n points at the `center` (D,) of a cell, times the cell's
    values from `first` on in the `field`; along axes along which it is `outside` of the grid it counts by their `part`
    (D, n)."""
    for i in range(n):
        dx = tuple(load(center, d) - load(points, d * LANES + i) for d in static_range(DIMENSIONS))
        weight = immersed_weight(min(dot(dx, dx), radius * radius), radius)
        for d in static_range(DIMENSIONS):
            weight = weight * (load(part, d * LANES + i) if load(outside, d) > 0.0 else 1.0)
        for v in static_range(TRANSFERRED):
            store(total, v * LANES + i, load(total, v * LANES + i) + weight * load(field, first + v * cells))


@helper
def particles_of_block(points, part, chosen, first, last, particles: Receivers, radius):
    """How many of the particles `chosen`, from the `first` on, before the `last`, are computed side by side: of one
    block, near each other. They are put to `points` and how much their images count to `part` (D, LANES), whose
    remaining lanes repeat one of them."""
    x, n = point_of(particles.position, chosen[first]), 1
    while (
        first + n < last
        and particles.home[chosen[first + n]] == particles.home[chosen[first]]
        and are_near(x, point_of(particles.position, chosen[first + n]), radius)
    ):
        n += 1
    for i in range(LANES):
        p = chosen[first + min(i, n - 1)]
        put_point(points, i, point_of(particles.position, p))
        put_point(part, i, point_of(particles.image, p))
    return n


@helper
def put_center(center, outside, index, block, grid: BlockGrid):
    """center (D,) [m] of the cell of an index in the grid, in the memory of a block; outside (D,) = 1 along axes along
    which it is outside."""
    x = center_of(index, block, grid)
    for d in static_range(DIMENSIONS):
        center[d] = x[d]
        outside[d] = 1.0 if index[d] < 0 or index[d] >= grid.cells[d] else 0.0


@helper
def largest_value(field, first, cells):
    """The largest magnitude among what a cell gives."""
    largest = 0.0
    for v in range(TRANSFERRED):
        largest = max(largest, abs(load(field, first + v * cells)))
    return largest


@driver
def spread(begin, end, chosen, particles: Receivers, radius, kind, giver, field, seen, gained, grid: BlockGrid):
    """gained[p] (TRANSFERRED,) = sum of kernel * field (blocks, TRANSFERRED, Z, Y, X) over the cells around a particle,
    in the memory of its block; only those of the kind `giver` have any. An item is a box of LANES of the particles
    `chosen`.

    seen (3, 2): first and past-the-end cell of the grid with its images.
    """
    points, part = workspace(DIMENSIONS * LANES), workspace(DIMENSIONS * LANES)
    total = workspace(TRANSFERRED * LANES)
    center, outside = workspace(DIMENSIONS), workspace(DIMENSIONS)
    cells = block_size(grid)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            # particles that are near each other
            b = particles.home[chosen[first]]
            count = particles_of_block(points, part, chosen, first, last, particles, radius)
            for v in range(len(total)):
                total[v] = 0.0
            # the cells around them
            ix, iy, iz = cells_around(points, radius, b, seen, grid)
            for k in range(iz[0], iz[1]):
                for j in range(iy[0], iy[1]):
                    for i in range(ix[0], ix[1]):
                        at = cell_at(b, i - grid.origin[b, 0], j - grid.origin[b, 1], k - grid.origin[b, 2], grid)
                        given = first_value(at, TRANSFERRED, cells)
                        if kind[at] == giver and largest_value(field, given, cells) > 0.0:
                            put_center(center, outside, (i, j, k), b, grid)
                            spread_row(
                                total,
                                points,
                                part,
                                center,
                                outside,
                                field,
                                given,
                                cells,
                                radius,
                                len(total) // TRANSFERRED,
                            )
            for i in range(count):
                for v in range(TRANSFERRED):
                    gained[chosen[first + i], v] = total[v * LANES + i]
            first += count
