"""Loops of the cut cells' forces: the velocity of the wall, and the work that the solid's gain of velocity costs.

Cells give to particles with the weights by which they see them (kernels/coupling.py: push), mass times kernel; so
momentum and work arrive as they leave.
"""

from math import sqrt

from distfsi.device.markers import driver, helper, load, store, workspace
from distfsi.kernels.contact import side_of_cube
from distfsi.kernels.coupling import center_of
from distfsi.kernels.cut_cells import share_at, way_to_master
from distfsi.kernels.cut_geometry import step_to
from distfsi.kernels.dust import DUST, WALL
from distfsi.kernels.gather import are_near, put_place, sum_around_all
from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS, LANES, PHASES, VARIABLES
from distfsi.physics.tensors import dot


@helper
def part_inside(position, i, volume, lower, upper):
    """Part of the cube of a `volume` around a particle that is in the domain."""
    side = side_of_cube(max(volume, 1e-300))
    part = 1.0
    for d in static_range(DIMENSIONS):
        depth = min(position[i, d] - lower[d], upper[d] - position[i, d])
        part = part * min(max(0.5 + depth / side, 0.0), 1.0)
    return part


@driver
def keep_mass(begin, end, start, dust, mass, density, lower, upper, kept):
    """kept[i] = mass of a particle of a wall, 0 if it was outside the domain at the `start`."""
    for i in range(begin, end):
        inside = part_inside(start, i, mass[i] / density[i], lower, upper) > 0.0
        kept[i] = mass[i] if inside and dust[i] != DUST else 0.0


@driver
def find_volumes(begin, end, dust, mass, density, volume):
    """volume[i] (n, 1) of a particle of a wall, 0 of lone ones."""
    for i in range(begin, end):
        volume[i, 0] = mass[i] / density[i] if dust[i] == WALL else 0.0


@driver
def keep_inside(begin, end, position, size, lower, upper, volume):
    """volume (n, 2) = what of a volume `size` (n, 1) is in the domain, and all of it."""
    for i in range(begin, end):
        volume[i, 0] = size[i, 0] * part_inside(position, i, size[i, 0], lower, upper)
        volume[i, 1] = size[i, 0]


@driver
def mark_stretched(begin, end, cell, farthest, volume, bond_count, deformation, mark):
    """mark[i] = 1 where a particle that bonds hold may be longer than `farthest`, in units of half a `cell` or of its
    reference size, if that is more; else 0."""
    for i in range(begin, end):
        side, squares = side_of_cube(volume[i]), 0.0
        for k in range(DIMENSIONS * DIMENSIONS):
            squares += deformation[i, k] * deformation[i, k]
        stretched = side * sqrt(squares) > farthest * max(0.5 * cell, side)
        mark[i] = 1 if stretched and bond_count[i] > 0 else 0


@driver
def find_middle(begin, end, start, position, middle, way):
    """middle[i] (D,) of a particle's way in a step, and how far along an axis it goes, way[i]."""
    for i in range(begin, end):
        way[i] = 0.0
        for d in static_range(DIMENSIONS):
            middle[i, d] = 0.5 * (start[i, d] + position[i, d])
            way[i] = max(way[i], abs(position[i, d] - start[i, d]))


@driver
def find_momentum(begin, end, mass, velocity, momentum):
    """momentum[i] = mass and mass times velocity."""
    for i in range(begin, end):
        momentum[i, 0] = mass[i]
        for d in static_range(DIMENSIONS):
            momentum[i, 1 + d] = mass[i] * velocity[i, d]


@driver
def clear(begin, end, band, fields, values, shape):
    """values (blocks, fields, Z, Y, X) = 0 in the band."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        first = band[n] + band[n] // cells * (fields - 1) * cells
        for k in range(fields):
            store(values, first + k * cells, 0.0)


@helper
def has_wall(area, n):
    """Whether the wall passes through a cell of the band."""
    surface = tuple(area[n, d] for d in static_range(DIMENSIONS))
    return dot(surface, surface) > 0.0


@driver
def mark_walled(begin, end, band, area, mark):
    """mark[n] = 1 where the wall passes through a cell of the band, else 0."""
    for n in range(begin, end):
        mark[n] = 1 if has_wall(area, n) else 0


@helper
def cells_near(place, band, walled, first, last, radius, shape, lower, spacing, origin):
    """How many of the cells `walled` (places in the band) from `first` on, before `last`, are computed side by side:
    their centers are put to `place` (D, LANES), whose remaining points repeat one of them."""
    x, n = center_of(band[walled[first]], shape, lower, spacing, origin), 1
    while first + n < last and are_near(x, center_of(band[walled[first + n]], shape, lower, spacing, origin), radius):
        n += 1
    for i in range(LANES):
        put_place(place, i, center_of(band[walled[first + min(i, n - 1)]], shape, lower, spacing, origin))
    return n


@driver
def see_particles(
    begin, end, band, walled, mean, inertia, radius, momentum, position, start, order, lower, size, low, window,
    strides, shape, spacing, origin,
):  # fmt: skip
    """mean (n, D) [m/s] of the particles' velocities, by mass times kernel, in the cells `walled` of the band.

    momentum (particles, 1 + D): mass and mass times velocity, flat; inertia (n,) = sum of mass times kernel. An item is
    a box of LANES cells.
    """
    place, around = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS)
    weight, sums = workspace(LANES), workspace((1 + DIMENSIONS) * LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(walled))
        while first < last:
            count = cells_near(place, band, walled, first, last, radius, shape, lower, spacing, origin)
            sum_around_all(
                sums, weight, around, place, radius, momentum, 1 + DIMENSIONS, position, start, order, lower, size,
                low, window, strides,
            )  # fmt: skip
            for i in range(count):
                n = walled[first + i]
                inertia[n] = sums[i]
                for d in range(DIMENSIONS):
                    mean[n, d] = sums[(1 + d) * LANES + i] / sums[i] if sums[i] > 0.0 else 0.0
            first += count


@driver
def spread_impulse(begin, end, band, volume, impulse, inertia, kick, shape):
    """kick (blocks, D, Z, Y, X) = velocity that a particle gains from a cell of a `volume` per kernel value
    [m^(d+1)/s]."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        at = band[n] + band[n] // cells * (DIMENSIONS - 1) * cells
        for d in static_range(DIMENSIONS):
            store(kick, at + d * cells, impulse[n, d] * volume / inertia[n] if inertia[n] > 0.0 else 0.0)


@driver
def find_pressures(begin, end, band, area, impulse, pressure):
    """pressure[n] [Pa s] that a cell's impulse (n, D) [N s/m3] makes on the area (n, D) [1/m] of its wall, or 0."""
    for n in range(begin, end):
        A = tuple(area[n, d] for d in static_range(DIMENSIONS))
        J = tuple(impulse[n, d] for d in static_range(DIMENSIONS))
        pressure[n] = sqrt(dot(J, J) / dot(A, A)) if has_wall(area, n) else 0.0


@driver
def find_debts(begin, end, band, debt, impulse, excess):
    """debt (blocks, 1, Z, Y, X) [J/m3] = what a cell's impulse (n, D) [N s/m3] does beyond its work at the velocity of
    the wall: the impulse times the `excess` (n, D) [m/s] of the particles that it sees."""
    for n in range(begin, end):
        J = tuple(impulse[n, d] for d in static_range(DIMENSIONS))
        store(debt, band[n], dot(J, tuple(excess[n, d] for d in static_range(DIMENSIONS))))


@driver
def pay_debts(begin, end, band, joined, paid, debt, U, swept, master, offsets, steps, shape):
    """Masters pay out of their energy for themselves and for those that joined them; paid (n,) [J/m3] of the cell."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        at = band[n]
        paid[n] = 0.0
        if way_to_master(master, at, cells, steps) == 0:
            owed = load(debt, at)
            for m in range(len(offsets)):
                if joined[n, m] > 0:
                    owed += load(debt, at + step_to(offsets, m, steps))
            energy = at + (at // cells * (VARIABLES - 1) + PHASES + DIMENSIONS) * cells
            paid[n] = owed
            store(U, energy, load(U, energy) - owed / load(swept, share_at(at, cells)))
