"""What cells give to the particles around them, by the weights with which they see these. Cells are named as in
coupling/kernels/cells.py; LANES particles of one block that lie near each other are computed side by side.
"""

from math import floor

from distfsi.coupling.formulas.immersed import immersed_weight
from distfsi.coupling.kernels.cells import cell_at, home_of, three
from distfsi.coupling.kernels.interpolation import are_near, put_place, range_of
from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, KICKS, LANES
from distfsi.formulas.tensors import dot


@helper
def cells_between(least, most, lower, spacing, first, end):
    """First and past-the-end cell along one axis whose centers are from `least` to `most`, inside first … end."""
    low = int(floor((least - lower) / spacing + 0.5))
    high = int(floor((most - lower) / spacing - 0.5))
    return (max(low, first), min(high + 1, end))


@helper
def cells_around(place, radius, b, lower, spacing, origin, extent, seen_cells):
    """The cells along three axes, in the memory of block b, within `radius` of the points `place` (D, LANES)."""
    first = tuple(max(origin[b, d] - 2, seen_cells[d, 0]) for d in static_range(3))
    end = tuple(min(origin[b, d] + extent[b, d] + 2, seen_cells[d, 1]) for d in static_range(3))
    x, iy, iz = range_of(place, 0), (0, 1), (0, 1)
    ix = cells_between(x[0] - radius, x[1] + radius, lower[0], spacing[0], first[0], end[0])
    if DIMENSIONS > 1:
        y = range_of(place, 1)
        iy = cells_between(y[0] - radius, y[1] + radius, lower[1], spacing[1], first[1], end[1])
    if DIMENSIONS > 2:
        z = range_of(place, 2)
        iz = cells_between(z[0] - radius, z[1] + radius, lower[2], spacing[2], first[2], end[2])
    return (ix, iy, iz)


@row
def push_row(total, place, part, center, outside, kick, at, cells, radius, n):
    """total (KICKS, n) grows by the kernels around the points `place` (D, n) at the `center` (D,) of a cell, times its
    `kick` (KICKS,); along axes along which it is `outside` of the grid it counts by their `part` (D, n)."""
    for i in range(n):
        dx = tuple(load(center, d) - load(place, d * LANES + i) for d in static_range(DIMENSIONS))
        weight = immersed_weight(min(dot(dx, dx), radius * radius), radius)
        for d in static_range(DIMENSIONS):
            weight = weight * (load(part, d * LANES + i) if load(outside, d) > 0.0 else 1.0)
        for v in static_range(KICKS):
            store(total, v * LANES + i, load(total, v * LANES + i) + weight * load(kick, at + v * cells))


@helper
def particles_of_block(place, part, chosen, first, last, home, position, image, radius):
    """How many of the particles `chosen`, from the `first` on, before the `last`, are computed side by side: of one
    block, near each other. They are put to `place` and how much their images count to `part` (D, LANES), whose
    remaining points repeat one of them."""
    x, n = three(position, chosen[first]), 1
    while (
        first + n < last
        and home[chosen[first + n]] == home[chosen[first]]
        and are_near(x, three(position, chosen[first + n]), radius)
    ):
        n += 1
    for i in range(LANES):
        p = chosen[first + min(i, n - 1)]
        put_place(place, i, three(position, p))
        put_place(part, i, tuple(image[p, d] for d in static_range(DIMENSIONS)))
    return n


@driver
def find_homes(begin, end, start, home, lower, spacing, grid_cells, block_cells, curve_index, first_block):
    """home[p] = the local block that a particle was in at the `start` of the step."""
    for p in range(begin, end):
        home[p] = home_of(three(start, p), lower, spacing, grid_cells, block_cells, curve_index) - first_block


@driver
def gather_kicks(
    begin, end, chosen, position, home, image, gained, radius, kind, giver, kick, shape, lower, spacing, origin, extent,
    seen_cells, grid_cells,
):  # fmt: skip
    """gained[p] (KICKS,) = sum of kernel * kick (blocks, KICKS, Z, Y, X) over the cells around the `position` of a
    particle, none but those of the kind `giver` having any, in the memory of the block `home`. An item is a box of
    LANES of the particles `chosen`.

    seen_cells (3, 2): first and past-the-end cell of the grid with its images at symmetry planes; image (n, D): how
    much these count for a particle, along each axis.
    """
    place, part = workspace(DIMENSIONS * LANES), workspace(DIMENSIONS * LANES)
    total = workspace(KICKS * LANES)
    center, outside = workspace(3), workspace(3)
    cells = shape[0] * shape[1] * shape[2]
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            b = home[chosen[first]]
            count = particles_of_block(place, part, chosen, first, last, home, position, image, radius)
            for v in range(len(total)):
                total[v] = 0.0
            ix, iy, iz = cells_around(place, radius, b, lower, spacing, origin, extent, seen_cells)
            for k in range(iz[0], iz[1]):
                for j in range(iy[0], iy[1]):
                    for i in range(ix[0], ix[1]):
                        at = cell_at(b, i - origin[b, 0], j - origin[b, 1], k - origin[b, 2], shape)
                        if kind[at] != giver:
                            continue
                        first_kick, largest = at + b * (KICKS - 1) * cells, 0.0
                        for v in range(KICKS):
                            largest = max(largest, abs(load(kick, first_kick + v * cells)))
                        if largest > 0.0:
                            index = (i, j, k)
                            for d in static_range(3):
                                center[d] = lower[d] + (index[d] + 0.5) * spacing[d]
                                outside[d] = 1.0 if index[d] < 0 or index[d] >= grid_cells[d] else 0.0
                            push_row(
                                total, place, part, center, outside, kick, first_kick, cells, radius,
                                len(total) // KICKS,
                            )  # fmt: skip
            for i in range(count):
                for v in range(KICKS):
                    gained[chosen[first + i], v] = total[v * LANES + i]
            first += count


@driver
def push(begin, end, mass, gained, impulse):
    """impulse[p] (D,) [N s] = mass times the velocity that a particle has gained."""
    for p in range(begin, end):
        for d in static_range(DIMENSIONS):
            impulse[p, d] = mass[p] * gained[p, d]
