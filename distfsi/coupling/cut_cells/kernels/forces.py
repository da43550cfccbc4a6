"""Loops of the loads on the wall: the velocity of the wall, the impulse on particles, and the work that the
solid's gain of velocity costs.

Cells give to particles with the weights by which they see them, mass times kernel; so momentum and work arrive as they
leave. Where the wall is lighter than the fluid that goes along with it, both share (docs/theory.md: light bodies).
"""

from math import sqrt

from distfsi.coupling.cut_cells.kernels.records import Merging, States, WallLoads, step_to_target, volume_at
from distfsi.coupling.kernels.interpolation import Cloud, are_near, put_point, sum_around_points
from distfsi.device.markers import driver, helper, load, store, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LANES, PHASES, VARIABLES
from distfsi.formulas.tensors import dot
from distfsi.mesh.kernels.grid import (
    BlockGrid,
    block_of,
    block_size,
    cell_volume,
    center_of_cell,
    first_value,
    step_to,
)

# ---- the wall's velocity --------------------------------------------------------------------------------------------


@helper
def has_wall(area, n):
    """Whether the wall passes through a cell of the band."""
    surface = tuple(area[n, d] for d in static_range(DIMENSIONS))
    return dot(surface, surface) > 0.0


@driver
def mark_walled(begin, end, area, mark):
    """mark[n] = 1 where the wall passes through a cell of the band, with an `area` (n, D) [1/m], else 0."""
    for n in range(begin, end):
        mark[n] = 1 if has_wall(area, n) else 0


@driver
def find_momentum(begin, end, width, mass, velocity, momentum):
    """momentum[i] (1 + width,) = mass and mass times velocity, or other values."""
    for i in range(begin, end):
        momentum[i, 0] = mass[i]
        for k in range(width):
            momentum[i, 1 + k] = mass[i] * velocity[i, k]


@helper
def cells_near(points, band, walled, first, last, radius, grid: BlockGrid):
    """How many of the cells `walled` (indices in the band) from `first` on, before `last`, are computed side by side:
    their centers are put to `points` (D, LANES), whose remaining ones repeat one of them."""
    x, n = center_of_cell(band[walled[first]], grid), 1
    while first + n < last and are_near(x, center_of_cell(band[walled[first + n]], grid), radius):
        n += 1
    for i in range(LANES):
        put_point(points, i, center_of_cell(band[walled[first + min(i, n - 1)]], grid))
    return n


@driver
def interpolate(begin, end, band, walled, width, mean, inertia, radius, particles: Cloud, grid: BlockGrid):
    """mean (n, width) of what the particles have, by mass times kernel, in the cells `walled` of the band.

    Values of the particles: mass, and mass times `width` values; inertia (n,) = sum of mass times kernel. An item is a
    box of LANES cells.
    """
    points, around = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS)
    weight, sums = workspace(LANES), workspace((2 + 2 * DIMENSIONS) * LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(walled))
        while first < last:
            # cells that are near each other
            count = cells_near(points, band, walled, first, last, radius, grid)
            sum_around_points(sums, weight, around, points, radius, 1 + width, particles)
            # means over the particles around them
            for i in range(count):
                n = walled[first + i]
                inertia[n] = sums[i]
                for v in range(width):
                    mean[n, v] = sums[(1 + v) * LANES + i] / sums[i] if sums[i] > 0.0 else 0.0
            first += count


# ---- the impulse on particles ---------------------------------------------------------------------------------------


@driver
def find_transfer(begin, end, band, loads: WallLoads, transfer, grid: BlockGrid):
    """transfer (blocks, D + 1, Z, Y, X) = velocity that a particle gains from a cell, and added mass over its own, per
    kernel value [m^(d+1)/s, m^d]."""
    cells = block_size(grid)
    for n in range(begin, end):
        at = first_value(band[n], DIMENSIONS + 1, cells)
        per_mass = cell_volume(block_of(band[n], grid), grid) / loads.inertia[n] if loads.inertia[n] > 0.0 else 0.0
        for d in static_range(DIMENSIONS):
            store(transfer, at + d * cells, loads.impulse[n, d] * per_mass)
        store(transfer, at + DIMENSIONS * cells, loads.added[n] * per_mass)


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
def find_pressures(begin, end, area, impulse, pressure):
    """pressure[n] [Pa s] that a cell's impulse (n, D) [N s/m3] makes on the area (n, D) [1/m] of its wall, or 0."""
    for n in range(begin, end):
        A = tuple(area[n, d] for d in static_range(DIMENSIONS))
        J = tuple(impulse[n, d] for d in static_range(DIMENSIONS))
        pressure[n] = sqrt(dot(J, J) / dot(A, A)) if has_wall(area, n) else 0.0


# ---- the energy correction ------------------------------------------------------------------------------------------


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


@driver
def find_corrections(begin, end, band, loads: WallLoads, gains, correction, grid: BlockGrid):
    """correction (blocks, D + 1, Z, Y, X) [N s/m3, J/m3] = what a cell gives to the particles beyond its impulse and
    the work of that at the velocity of the wall; the impulse grows by it.

    gains (n, 2 D + 1), of the particles that a cell sees: what the velocity at which an impulse works is beyond the
    wall's, and velocity and work [m2/s2] that the fluid gains per added mass.
    """
    cells = block_size(grid)
    for n in range(begin, end):
        at = first_value(band[n], DIMENSIONS + 1, cells)
        # work and momentum of the added mass, and what the impulse worked beyond the wall's velocity
        owed = -loads.added[n] * gains[n, 2 * DIMENSIONS]
        for d in static_range(DIMENSIONS):
            given = -loads.added[n] * gains[n, DIMENSIONS + d]
            owed += loads.impulse[n, d] * gains[n, d]
            loads.impulse[n, d] += given
            store(correction, at + d * cells, given)
        store(correction, at + DIMENSIONS * cells, owed)


@driver
def correct_energy(begin, end, band, merging: Merging, correction, paid, states: States, grid: BlockGrid):
    """Merge targets pay out of their momentum and energy for themselves and for the cells merged with them; paid (n,)
    [J/m3] of the cell."""
    cells = block_size(grid)
    for n in range(begin, end):
        at = band[n]
        paid[n] = 0.0
        if step_to_target(merging.target, at, cells, grid) == 0:
            for d in range(DIMENSIONS + 1):
                # of the cell and those merged with it
                owed_at = first_value(at, DIMENSIONS + 1, cells) + d * cells
                owed = load(correction, owed_at)
                for m in range(len(merging.offsets)):
                    if merging.joined[n, m] > 0:
                        owed += load(correction, owed_at + step_to(merging.offsets, m, grid))
                # the last of these is energy
                amount = first_value(at, VARIABLES, cells) + (PHASES + d) * cells
                paid[n] = owed
                store(states.U, amount, load(states.U, amount) - owed / load(states.volume, volume_at(at, cells)))
