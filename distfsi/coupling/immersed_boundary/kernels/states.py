"""Loops of the immersed boundary: what covered and fresh cells hold, and what the fluid gives to the particles."""

from typing import Any, NamedTuple

from distfsi.coupling.formulas.immersed import impulse_on_wall, moving_with
from distfsi.coupling.kernels.cells import COVERED, FLUID
from distfsi.coupling.kernels.faces import BOX, flux_of_face, look_at_face
from distfsi.device.markers import driver, helper, load, store, workspace
from distfsi.fluid.kernels.records import position_of
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, FLUXES, PHASES, VARIABLES, conserved, primitives
from distfsi.mesh.kernels.grid import BlockGrid, block_of, block_size, cell_volume, first_value


class Surroundings(NamedTuple):
    """The cells from which a cell without a state takes one.

    offsets  (m,) steps in memory to the cells around, ring by ring
    weights  (m,) of their states
    rings    (rings + 1,) where each ring begins among them
    rest     (VARIABLES,) primitive state where there is no fluid around
    """

    offsets: Any
    weights: Any
    rings: Any
    rest: Any


# ---- what the cells hold --------------------------------------------------------------------------------------------


@helper
def mean_of_fluid(U, kind, at, cells, around: Surroundings):
    """Primitive state: mean over the FLUID cells of the first ring around `at` that has any (Eq. 32), else `rest`."""
    share = 0.0
    total = tuple(0.0 for _ in static_range(VARIABLES))
    for ring in range(len(around.rings) - 1):
        if share == 0.0:
            for m in range(around.rings[ring], around.rings[ring + 1]):
                source = at + around.offsets[m]
                if kind[source] == FLUID:
                    first = first_value(source, VARIABLES, cells)
                    W = primitives(tuple(load(U, first + v * cells) for v in static_range(VARIABLES)))
                    share += around.weights[m]
                    total = tuple(total[v] + around.weights[m] * W[v] for v in static_range(VARIABLES))
    found = share > 0.0
    return tuple(total[v] / share if found else around.rest[v] for v in static_range(VARIABLES))


@helper
def put(U, at, cells, state):
    """Store a conserved state."""
    first = first_value(at, VARIABLES, cells)
    for v in static_range(VARIABLES):
        store(U, first + v * cells, state[v])


@driver
def fill_covered(begin, end, covered, velocity, U, kind, around: Surroundings, grid: BlockGrid):
    """Covered cells move with the wall; all else they take from the fluid around them."""
    cells = block_size(grid)
    for n in range(begin, end):
        W = mean_of_fluid(U, kind, covered[n], cells, around)
        wall = tuple(velocity[n, d] for d in static_range(DIMENSIONS))
        put(U, covered[n], cells, conserved(moving_with(W, wall)))


@driver
def fill_fresh(begin, end, fresh, U, kind, around: Surroundings, grid: BlockGrid):
    """Fresh cells take their whole state from the fluid around them."""
    cells = block_size(grid)
    for n in range(begin, end):
        put(U, fresh[n], cells, conserved(mean_of_fluid(U, kind, fresh[n], cells, around)))


@driver
def fill_deep(begin, end, deep, U, rest, grid: BlockGrid):
    """Deep cells rest."""
    cells = block_size(grid)
    state = conserved(tuple(rest[v] for v in static_range(VARIABLES)))
    for n in range(begin, end):
        put(U, deep[n], cells, state)


@driver
def find_contents(begin, end, fresh, U, content, grid: BlockGrid):
    """content (n, conserved) = what the cells hold per volume."""
    cells = block_size(grid)
    for n in range(begin, end):
        first = first_value(fresh[n], VARIABLES, cells)
        for v in static_range(PHASES + DIMENSIONS + 1):
            content[n, v] = load(U, first + v * cells)


# ---- what the fluid gives -------------------------------------------------------------------------------------------


@helper
def add_flux(passed, n, U, at, axis, dt, weight, grid: BlockGrid, P, T, F):
    """passed[n] += weight * flux through the face between a cell `at` and the next along `axis`."""
    look_at_face(U, at, axis, dt, grid, P, T)
    flux_of_face(P, T, F, dt / grid.spacing[block_of(at, grid), axis], axis)
    for v in range(PHASES + DIMENSIONS + 1):
        passed[n, v] += weight * load(F, 2 * position_of(v, axis))


@driver
def collect_wall(begin, end, covered, passed, U, kind, dt, weight, grid: BlockGrid):
    """passed[n] (conserved) grows by what crosses the faces between covered cells and fluid ones.

    dt [s]: of the step; weight [s]: that times the share of the stage.
    """
    P, T, F = workspace(BOX * VARIABLES), workspace(2 * VARIABLES), workspace(2 * FLUXES + 2)
    for n in range(begin, end):
        at, b = covered[n], block_of(covered[n], grid)
        for axis in range(DIMENSIONS):
            step, area = grid.steps[axis], weight * cell_volume(b, grid) / grid.spacing[b, axis]
            if kind[at - step] < COVERED:
                add_flux(passed, n, U, at - step, axis, dt, area, grid, P, T, F)
            if kind[at + step] < COVERED:
                add_flux(passed, n, U, at, axis, dt, -area, grid, P, T, F)


@driver
def collect_sides(begin, end, side_cells, side, passed, U, kind, dt, weight, grid: BlockGrid):
    """passed[n] grows by what leaves through a domain's side, side[n] = 2 axis + (0 low, 1 high), at a covered cell."""
    P, T, F = workspace(BOX * VARIABLES), workspace(2 * VARIABLES), workspace(2 * FLUXES + 2)
    for n in range(begin, end):
        at, axis = side_cells[n], side[n] // 2
        if kind[at] >= COVERED:
            high, b = side[n] % 2, block_of(at, grid)
            area = weight * cell_volume(b, grid) / grid.spacing[b, axis]
            before = at if high == 1 else at - grid.steps[axis]
            add_flux(passed, n, U, before, axis, dt, (2 * high - 1) * area, grid, P, T, F)


@driver
def find_transfer(begin, end, covered, passed, velocity, inertia, transfer, grid: BlockGrid):
    """transfer (blocks, D, Z, Y, X) = velocity that a particle gains from a covered cell per kernel value
    [m^(d+1)/s]."""
    cells = block_size(grid)
    for n in range(begin, end):
        amounts = tuple(passed[n, v] for v in static_range(PHASES + DIMENSIONS + 1))
        J = impulse_on_wall(amounts, tuple(velocity[n, d] for d in static_range(DIMENSIONS)))
        at = first_value(covered[n], DIMENSIONS, cells)
        for d in static_range(DIMENSIONS):
            store(transfer, at + d * cells, J[d] / inertia[n])


@driver
def find_impulse(begin, end, mass, gained, impulse):
    """impulse[p] (D,) [N s] = mass times the velocity that a particle has gained."""
    for p in range(begin, end):
        for d in static_range(DIMENSIONS):
            impulse[p, d] = mass[p] * gained[p, d]


@driver
def clear(begin, end, chosen, fields, values, grid: BlockGrid):
    """values (blocks, fields, Z, Y, X) = 0 in the cells `chosen`."""
    cells = block_size(grid)
    for n in range(begin, end):
        first = first_value(chosen[n], fields, cells)
        for k in range(fields):
            store(values, first + k * cells, 0.0)
