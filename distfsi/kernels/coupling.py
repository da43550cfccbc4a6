"""Loops of the coupling: which cells the solid covers, what they hold, and what the fluid gives to the particles.

A cell is named by its flat index `at` in a field of one variable: block * (cells in its memory) + place in the block.
`shape` (Z, Y, X) is that of a block in memory; `lower`, `spacing` are the grid's, `origin`, `extent` the blocks';
`start` to `strides` are the fields of SearchCells.
"""

from math import floor

from distfsi.device.markers import driver, helper, load, real, store, workspace
from distfsi.kernels.fluid import face_fluxes, place, primitives_row, rises_row
from distfsi.kernels.gather import any_particle, sum_particles
from distfsi.kernels.solid import DENSITY, MASS, VELOCITY
from distfsi.physics.immersed import impulse_on_wall, moving_with
from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS, FLUXES, LOOKS_SIDEWAYS, PHASES, VARIABLES, conserved, primitives

# What a cell is: fluid; fluid since this step; not yet looked at; behind the wall; farther behind than fluxes look.
FLUID, FRESH, UNKNOWN, COVERED, DEEP = range(5)

# Columns of the numbers of cells of each kind that find_depth() counts.
COVERED_CELLS, DEEP_CELLS, FRESH_CELLS = range(3)

# Cells that give the flux through one face: its line of four is the middle one of five.
BOX, LINE = 20, 8

# ---- places ---------------------------------------------------------------------------------------------------------


@helper
def cell_at(block, i, j, k, shape):
    """Flat index of an active cell of a block."""
    gy = 2 if DIMENSIONS > 1 else 0
    gz = 2 if DIMENSIONS > 2 else 0
    return ((block * shape[0] + k + gz) * shape[1] + j + gy) * shape[2] + i + 2


@helper
def row_place(r, shape):
    """Places along y and z, in its block, of a row of cells along x; rows are numbered as they lie in memory."""
    gy = 2 if DIMENSIONS > 1 else 0
    gz = 2 if DIMENSIONS > 2 else 0
    return (r % shape[1] - gy, r // shape[1] % shape[0] - gz)


@helper
def cells_of_row(r, b, shape, extent):
    """How many active cells a row has."""
    j, k = row_place(r, shape)
    return extent[b, 0] if j >= 0 and j < extent[b, 1] and k >= 0 and k < extent[b, 2] else 0


@helper
def center_of(at, shape, lower, spacing, origin):
    """Center [m] of the cell `at`."""
    block = at // (shape[0] * shape[1] * shape[2])
    gy = 2 if DIMENSIONS > 1 else 0
    gz = 2 if DIMENSIONS > 2 else 0
    index = (at % shape[2] - 2, at // shape[2] % shape[1] - gy, at // (shape[1] * shape[2]) % shape[0] - gz)
    return tuple(lower[d] + (origin[block, d] + index[d] + 0.5) * spacing[d] for d in static_range(DIMENSIONS))


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
    """volume (n, 1); momentum (n, 1 + D): mass and momentum of particles of a `state` as in kernels/solid.py."""
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
def look_at_face(U, at, cells, steps, axis, P, T):
    """P, T = primitives and rises around the face between a cell `at` and the next along `axis`, by the stage's rows.

    P holds five lines of four cells: the one through the face, and those beside it if the flux looks there.
    """
    first, step = at + at // cells * (VARIABLES - 1) * cells, steps[axis]
    for c in range(4):
        primitives_row(U, P, first + (c - 1) * step, cells, LINE + c, BOX, 1)
    if LOOKS_SIDEWAYS:
        for d in range(1, DIMENSIONS):
            beside = steps[(axis + d) % DIMENSIONS]
            for c in range(1, 3):
                primitives_row(U, P, first + (c - 1) * step - beside, cells, LINE + c - 4 * d, BOX, 1)
                primitives_row(U, P, first + (c - 1) * step + beside, cells, LINE + c + 4 * d, BOX, 1)
    rises_row(P, T, LINE + 1, BOX, 1, 0, 2, 2)


@helper
def flux_of_face(P, T, F, rates, axis):
    """F = flux through the face that was looked at, by the rows of the stage. rates (D,): dt/h per axis."""
    face_fluxes(P, T, F, LINE + 1, BOX, 1, 4, 8, 0, 1, 2, 0, axis, real(2 * DIMENSIONS) * rates[axis], 1, 1)


@helper
def add_flux(passed, n, U, at, cells, steps, rates, axis, weight, P, T, F):
    """passed[n] += weight * flux through the face between a cell `at` and the next along `axis`."""
    look_at_face(U, at, cells, steps, axis, P, T)
    flux_of_face(P, T, F, rates, axis)
    for v in range(PHASES + DIMENSIONS + 1):
        passed[n, v] += weight * load(F, 2 * place(v, axis))


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


@helper
def three(position, p):
    """Coordinates of a particle; an unused axis has one cell, from 0 to 1."""
    return (position[p, 0], position[p, 1] if DIMENSIONS > 1 else 0.5, position[p, 2] if DIMENSIONS > 2 else 0.5)


@helper
def home_of(x, lower, spacing, grid_cells, block_cells, curve_index):
    """Curve index of the block that x is in or, outside, nearest to."""
    own = tuple(
        max(min(int(floor((x[d] - lower[d]) / spacing[d])), grid_cells[d] - 1), 0) // block_cells[d]
        for d in static_range(3)
    )
    return curve_index[own[0], own[1], own[2]]
