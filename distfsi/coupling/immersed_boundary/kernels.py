"""Loops of the coupling: which cells the solid covers, what they hold, and what the fluid gives to the particles.

Cells are named as in coupling/kernels/cells.py; `start` to `strides` are the fields of SearchCells.
"""

from distfsi.coupling.formulas.immersed import impulse_on_wall, moving_with
from distfsi.coupling.kernels.cells import COVERED, DEEP, FLUID, FRESH, UNKNOWN, cell_at, center_of
from distfsi.coupling.kernels.faces import BOX, flux_of_face, look_at_face
from distfsi.coupling.kernels.interpolation import any_particle, sum_particles
from distfsi.device.markers import driver, helper, load, store, workspace
from distfsi.fluid.kernels.records import position_of
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, FLUXES, PHASES, VARIABLES, conserved, primitives
from distfsi.solid.kernels.pairs import DENSITY, MASS, VELOCITY

# ---- regions --------------------------------------------------------------------------------------------------------


@driver
def cover(
    begin, end, kind, occupied, U, lost, radius, volume, position, start, order, lower, size, low, window, strides,
    shape, spacing, origin, extent,
):  # fmt: skip
    """kind = COVERED where the particles' `volume` (n, 1) fills half of the kernel of `radius`, FRESH where it did.

    occupied (blocks,): whether a block has cells that are not FLUID; without those and particles it is skipped.
    lost (blocks, conserved): grows by what the cells that become covered hold per volume.
    """
    sums = workspace(1)
    cells = shape[0] * shape[1] * shape[2]
    for b in range(begin, end):
        middle = tuple(lower[d] + (origin[b, d] + 0.5 * extent[b, d]) * spacing[d] for d in static_range(DIMENSIONS))
        reach = tuple(0.5 * extent[b, d] * spacing[d] + radius for d in static_range(DIMENSIONS))
        if occupied[b] == 0 and not any_particle(middle, reach, start, lower, size, low, window, strides):
            continue
        occupied[b] = 0
        for k in range(extent[b, 2]):
            for j in range(extent[b, 1]):
                for i in range(extent[b, 0]):
                    at = cell_at(b, i, j, k, shape)
                    x = center_of(at, shape, lower, spacing, origin)
                    sum_particles(sums, x, radius, volume, position, start, order, lower, size, low, window, strides)
                    before = kind[at]
                    if sums[0] >= 0.5:
                        kind[at] = COVERED
                        if before < UNKNOWN:
                            for v in range(PHASES + DIMENSIONS + 1):
                                lost[b, v] += load(U, at + (b * (VARIABLES - 1) + v) * cells)
                    else:
                        kind[at] = FRESH if before >= COVERED else FLUID
                    if kind[at] != FLUID:
                        occupied[b] = 1


@driver
def find_depth(begin, end, kind, occupied, shape, extent, offsets, counts):
    """Covered cells without fluid at `offsets` become DEEP; counts (blocks, 3) = the COVERED, DEEP and FRESH cells."""
    for b in range(begin, end):
        for c in range(3):
            counts[b, c] = 0
        if occupied[b] == 0:
            continue
        for k in range(extent[b, 2]):
            for j in range(extent[b, 1]):
                for i in range(extent[b, 0]):
                    at = cell_at(b, i, j, k, shape)
                    if kind[at] == FRESH:
                        counts[b, 2] += 1
                    elif kind[at] >= COVERED:
                        deep = 1
                        for m in range(len(offsets)):
                            if kind[at + offsets[m]] < COVERED:
                                deep = 0
                                break
                        counts[b, deep] += 1
                        if deep == 1:
                            kind[at] = DEEP


@driver
def list_cells(begin, end, kind, occupied, shape, extent, first, covered, deep, fresh):
    """Write the cells of each kind, block by block, from the places first (blocks, 3) on."""
    for b in range(begin, end):
        if occupied[b] == 0:
            continue
        c, d, f = first[b, 0], first[b, 1], first[b, 2]
        for k in range(extent[b, 2]):
            for j in range(extent[b, 1]):
                for i in range(extent[b, 0]):
                    at = cell_at(b, i, j, k, shape)
                    if kind[at] == COVERED:
                        covered[c] = at
                        c += 1
                    elif kind[at] == DEEP:
                        deep[d] = at
                        d += 1
                    elif kind[at] == FRESH:
                        fresh[f] = at
                        f += 1


# ---- what the cells hold --------------------------------------------------------------------------------------------


@driver
def find_amounts(begin, end, state, volume, momentum):
    """volume (n, 1); momentum (n, 1 + D): mass and momentum of particles of a `state` as in solid/kernels/pairs.py."""
    for i in range(begin, end):
        volume[i, 0] = state[i, MASS] / state[i, DENSITY]
        momentum[i, 0] = state[i, MASS]
        for d in static_range(DIMENSIONS):
            momentum[i, 1 + d] = state[i, MASS] * state[i, VELOCITY + d]


@driver
def find_wall_velocity(
    begin, end, covered, velocity, inertia, radius, momentum, position, start, order, lower, size, low, window, strides,
    shape, spacing, origin,
):  # fmt: skip
    """velocity (n, D) of the wall in covered cells: the particles' mean by mass and kernel (Eq. 31 with weights).

    momentum (particles, 1 + D): mass and momentum; inertia (n,) = sum of mass times kernel.
    """
    sums = workspace(1 + DIMENSIONS)
    for n in range(begin, end):
        x = center_of(covered[n], shape, lower, spacing, origin)
        sum_particles(sums, x, radius, momentum, position, start, order, lower, size, low, window, strides)
        inertia[n] = sums[0]
        for d in static_range(DIMENSIONS):
            velocity[n, d] = sums[1 + d] / sums[0]


@helper
def mean_of_fluid(U, kind, at, cells, offsets, weights, rings, rest):
    """Primitive state: mean over the FLUID cells of the first ring around `at` that has any (Eq. 32), else `rest`."""
    share = 0.0
    total = tuple(0.0 for _ in static_range(VARIABLES))
    for ring in range(len(rings) - 1):
        if share == 0.0:
            for m in range(rings[ring], rings[ring + 1]):
                source = at + offsets[m]
                if kind[source] == FLUID:
                    first = source + source // cells * (VARIABLES - 1) * cells
                    W = primitives(tuple(load(U, first + v * cells) for v in static_range(VARIABLES)))
                    share += weights[m]
                    total = tuple(total[v] + weights[m] * W[v] for v in static_range(VARIABLES))
    found = share > 0.0
    return tuple(total[v] / share if found else rest[v] for v in static_range(VARIABLES))


@helper
def put(U, at, cells, state):
    """Store a conserved state."""
    first = at + at // cells * (VARIABLES - 1) * cells
    for v in static_range(VARIABLES):
        store(U, first + v * cells, state[v])


@driver
def fill_covered(begin, end, covered, velocity, U, kind, shape, offsets, weights, rings, rest):
    """Covered cells move with the wall; all else they take from the fluid around them."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        W = mean_of_fluid(U, kind, covered[n], cells, offsets, weights, rings, rest)
        wall = tuple(velocity[n, d] for d in static_range(DIMENSIONS))
        put(U, covered[n], cells, conserved(moving_with(W, wall)))


@driver
def fill_fresh(begin, end, fresh, U, kind, shape, offsets, weights, rings, rest):
    """Fresh cells take their whole state from the fluid around them."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        put(U, fresh[n], cells, conserved(mean_of_fluid(U, kind, fresh[n], cells, offsets, weights, rings, rest)))


@driver
def find_contents(begin, end, fresh, U, shape, content):
    """content (n, conserved) = what the cells hold per volume."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        first = fresh[n] + fresh[n] // cells * (VARIABLES - 1) * cells
        for v in static_range(PHASES + DIMENSIONS + 1):
            content[n, v] = load(U, first + v * cells)


@driver
def fill_deep(begin, end, deep, U, shape, rest):
    """Deep cells rest."""
    cells = shape[0] * shape[1] * shape[2]
    state = conserved(tuple(rest[v] for v in static_range(VARIABLES)))
    for n in range(begin, end):
        put(U, deep[n], cells, state)


# ---- what the fluid gives -------------------------------------------------------------------------------------------


@helper
def add_flux(passed, n, U, at, cells, steps, rates, axis, weight, P, T, F):
    """passed[n] += weight * flux through the face between a cell `at` and the next along `axis`."""
    look_at_face(U, at, cells, steps, axis, P, T)
    flux_of_face(P, T, F, rates, axis)
    for v in range(PHASES + DIMENSIONS + 1):
        passed[n, v] += weight * load(F, 2 * position_of(v, axis))


@driver
def collect_wall(begin, end, covered, passed, U, kind, shape, steps, rates, weights):
    """passed[n] (conserved) grows by what crosses the faces between covered cells and fluid ones.

    rates (D,): dt/h per axis; weights (D,): share of the stage * dt * area of a face.
    """
    cells = shape[0] * shape[1] * shape[2]
    P, T, F = workspace(BOX * VARIABLES), workspace(2 * VARIABLES), workspace(2 * FLUXES + 2)
    for n in range(begin, end):
        at = covered[n]
        for axis in range(DIMENSIONS):
            step = steps[axis]
            if kind[at - step] < COVERED:
                add_flux(passed, n, U, at - step, cells, steps, rates, axis, weights[axis], P, T, F)
            if kind[at + step] < COVERED:
                add_flux(passed, n, U, at, cells, steps, rates, axis, -weights[axis], P, T, F)


@driver
def collect_sides(begin, end, side_cells, side, passed, U, kind, shape, steps, rates, weights):
    """passed[n] grows by what leaves through a domain's side, side[n] = 2 axis + (0 low, 1 high), at a covered cell."""
    cells = shape[0] * shape[1] * shape[2]
    P, T, F = workspace(BOX * VARIABLES), workspace(2 * VARIABLES), workspace(2 * FLUXES + 2)
    for n in range(begin, end):
        at, axis = side_cells[n], side[n] // 2
        if kind[at] >= COVERED:
            high = side[n] % 2
            before = at if high == 1 else at - steps[axis]
            add_flux(passed, n, U, before, cells, steps, rates, axis, (2 * high - 1) * weights[axis], P, T, F)


@driver
def spread(begin, end, covered, passed, velocity, inertia, kick, shape):
    """kick (blocks, D, Z, Y, X) = velocity that a particle gains from a covered cell per kernel value [m^(d+1)/s]."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        amounts = tuple(passed[n, v] for v in static_range(PHASES + DIMENSIONS + 1))
        J = impulse_on_wall(amounts, tuple(velocity[n, d] for d in static_range(DIMENSIONS)))
        at = covered[n] + covered[n] // cells * (DIMENSIONS - 1) * cells
        for d in static_range(DIMENSIONS):
            store(kick, at + d * cells, J[d] / inertia[n])


@driver
def clear(begin, end, chosen, fields, values, shape):
    """values (blocks, fields, Z, Y, X) = 0 in the cells `chosen`."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        first = chosen[n] + chosen[n] // cells * (fields - 1) * cells
        for k in range(fields):
            store(values, first + k * cells, 0.0)
