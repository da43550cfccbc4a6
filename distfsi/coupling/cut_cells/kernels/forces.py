"""Loops of the cut cells' forces: the velocity of the wall, and the work that the solid's gain of velocity costs.

Cells give to particles with the weights by which they see them, mass times kernel; so momentum and work arrive as they
leave. Where the wall is lighter than the fluid that goes along with it, both share (docs/theory.md: light bodies).
"""

from math import sqrt

from distfsi.coupling.cut_cells.kernels.dust import DUST, WALL
from distfsi.coupling.cut_cells.kernels.geometry import step_to
from distfsi.coupling.cut_cells.kernels.redistribution import share_at, way_to_master
from distfsi.coupling.kernels.cells import center_of
from distfsi.coupling.kernels.interpolation import are_near, put_place, sum_around_all
from distfsi.device.markers import driver, helper, load, store, workspace
from distfsi.formulas.geometry import side_of_cube
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LANES, PHASES, VARIABLES
from distfsi.formulas.tensors import dot


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
def find_momentum(begin, end, width, mass, velocity, momentum):
    """momentum[i] (1 + width,) = mass and mass times velocity, or other values."""
    for i in range(begin, end):
        momentum[i, 0] = mass[i]
        for k in range(width):
            momentum[i, 1 + k] = mass[i] * velocity[i, k]


@driver
def find_gains(begin, end, carried, excess, shared, gains):
    """gains[i] (2 D + 1,) = `excess`, `shared`, and this times the velocity at which impulses work."""
    for i in range(begin, end):
        work = 0.0
        for d in static_range(DIMENSIONS):
            gains[i, d] = excess[i, d]
            gains[i, DIMENSIONS + d] = shared[i, d]
            work += shared[i, d] * (carried[i, d] + excess[i, d])
        gains[i, 2 * DIMENSIONS] = work


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
    begin, end, band, walled, width, mean, inertia, radius, amounts, position, start, order, lower, size, low, window,
    strides, shape, spacing, origin,
):  # fmt: skip
    """mean (n, width) of what the particles have, by mass times kernel, in the cells `walled` of the band.

    amounts: mass and mass times `width` values per particle, flat; inertia (n,) = sum of mass times kernel. An item is
    a box of LANES cells.
    """
    place, around = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS)
    weight, sums = workspace(LANES), workspace((2 + 2 * DIMENSIONS) * LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(walled))
        while first < last:
            count = cells_near(place, band, walled, first, last, radius, shape, lower, spacing, origin)
            sum_around_all(
                sums, weight, around, place, radius, amounts, 1 + width, 1 + width, position, start, order, lower, size,
                low, window, strides,
            )  # fmt: skip
            for i in range(count):
                n = walled[first + i]
                inertia[n] = sums[i]
                for v in range(width):
                    mean[n, v] = sums[(1 + v) * LANES + i] / sums[i] if sums[i] > 0.0 else 0.0
            first += count


@driver
def spread_impulse(begin, end, band, volume, impulse, added, inertia, kick, shape):
    """kick (blocks, D + 1, Z, Y, X) = velocity that a particle gains from a cell of a `volume`, and added mass over its
    own, per kernel value [m^(d+1)/s, m^d]."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        at = band[n] + band[n] // cells * DIMENSIONS * cells
        per_mass = volume / inertia[n] if inertia[n] > 0.0 else 0.0
        for d in static_range(DIMENSIONS):
            store(kick, at + d * cells, impulse[n, d] * per_mass)
        store(kick, at + DIMENSIONS * cells, added[n] * per_mass)


@driver
def push_together(begin, end, mass, fixed, before, velocity, gained, impulse, shared):
    """impulse[p] (D,) [N s] = mass times the velocity of what a particle has `gained` (1 + D,); but of one that is free
    and lighter than its added mass all forces of the step, those that have changed its velocity since `before` too,
    accelerate the added mass alone, with shared[p] (D,) [m/s] per added mass; what that takes is not given to it."""
    for p in range(begin, end):
        along = 1.0 if fixed[p] else max(gained[p, DIMENSIONS], 1.0)
        for d in static_range(DIMENSIONS):
            taken = (1.0 - 1.0 / along) * (gained[p, d] + velocity[p, d] - before[p, d])
            impulse[p, d] = mass[p] * (gained[p, d] - taken)
            shared[p, d] = taken / along


@driver
def find_pressures(begin, end, band, area, impulse, pressure):
    """pressure[n] [Pa s] that a cell's impulse (n, D) [N s/m3] makes on the area (n, D) [1/m] of its wall, or 0."""
    for n in range(begin, end):
        A = tuple(area[n, d] for d in static_range(DIMENSIONS))
        J = tuple(impulse[n, d] for d in static_range(DIMENSIONS))
        pressure[n] = sqrt(dot(J, J) / dot(A, A)) if has_wall(area, n) else 0.0


@driver
def find_debts(begin, end, band, added, impulse, gains, debt, shape):
    """debt (blocks, D + 1, Z, Y, X) [N s/m3, J/m3] = what a cell gives to the particles beyond its `impulse` (n, D) and
    the work of that at the velocity of the wall; impulse grows by it.

    gains (n, 2 D + 1), of the particles that a cell sees: what the velocity at which an impulse works is beyond the
    wall's, and velocity and work [m2/s2] that the fluid gains per `added` mass (n,) [kg/m3].
    """
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        at = band[n] + band[n] // cells * DIMENSIONS * cells
        owed = -added[n] * gains[n, 2 * DIMENSIONS]
        for d in static_range(DIMENSIONS):
            given = -added[n] * gains[n, DIMENSIONS + d]
            owed += impulse[n, d] * gains[n, d]
            impulse[n, d] += given
            store(debt, at + d * cells, given)
        store(debt, at + DIMENSIONS * cells, owed)


@driver
def pay_debts(begin, end, band, joined, paid, debt, U, swept, master, offsets, steps, shape):
    """Masters pay out of their momentum and energy for themselves and for those that joined them; paid (n,) [J/m3] of
    the cell."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        at = band[n]
        block = at // cells
        paid[n] = 0.0
        if way_to_master(master, at, cells, steps) == 0:
            for d in range(DIMENSIONS + 1):
                owed_at = at + (block * DIMENSIONS + d) * cells
                owed = load(debt, owed_at)
                for m in range(len(offsets)):
                    if joined[n, m] > 0:
                        owed += load(debt, owed_at + step_to(offsets, m, steps))
                place = at + (block * (VARIABLES - 1) + PHASES + d) * cells
                paid[n] = owed
                store(U, place, load(U, place) - owed / load(swept, share_at(at, cells)))
