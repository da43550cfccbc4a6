"""Loops of lone particles: which they are, and the forces between them and the gas of the cells that they are in."""

from math import floor
from typing import Any, NamedTuple

from distfsi.coupling.cut_cells.kernels.fluxes import aperture_between
from distfsi.coupling.cut_cells.kernels.records import States, Walls, state_at, volume_at
from distfsi.coupling.formulas.drag import masses_that_follow
from distfsi.device.markers import driver, helper, load, real, store, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES, primitives, sound_speed
from distfsi.formulas.tensors import dot
from distfsi.mesh.kernels.grid import (
    BlockGrid,
    BlockTable,
    block_at,
    block_of,
    block_size,
    cell_at,
    cell_volume,
    first_value,
)
from distfsi.mesh.kernels.search import Bins, bins_around, particles_of_row

# What a particle is: part of a wall; lone, but still pushed by the wall that it was when the step began; lone.
WALL, LEAVING, LONE = range(3)


class LonePoints(NamedTuple):
    """Lone particles in a step, in the order of their ids; n of them.

    rows       (n,) of them among this rank's particles
    position   (n, D) [m] when the step began
    cell       (n,) flat index of the cell that they were in, -1 where there is no fluid
    following  (n, 2) [kg] masses that follow the change of the gas's velocity, and the gas (coupling/formulas/drag.py)
    pressed    (n, D) [m/s] change of the gas's velocity by pressure
    """

    rows: Any
    position: Any
    cell: Any
    following: Any
    pressed: Any


# ---- which they are -------------------------------------------------------------------------------------------------


@helper
def particles_within(position, i, radius, bins: Bins):
    """How many particles there are within a `radius` of one, itself among them."""
    count = 0
    x = tuple(position[i, d] for d in static_range(DIMENSIONS))
    bx, by, bz = bins_around(x, tuple(radius for _ in static_range(DIMENSIONS)), bins)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            start, stop = particles_of_row(bx, j, k, bins)
            for n in range(start, stop):
                dx = tuple(x[d] - position[bins.order[n], d] for d in static_range(DIMENSIONS))
                if dot(dx, dx) < radius * radius:
                    count += 1
    return count


@driver
def find_lone(begin, end, lone, fixed, bond_count, radius, fewest, position, bins: Bins):
    """lone[i] = what a particle is. It leaves the wall when it has no bonds and there are fewer than the `fewest`
    particles, itself among them, within `radius` [m]; it never comes back."""
    for i in range(begin, end):
        if lone[i] == LEAVING:
            lone[i] = LONE
        if lone[i] == WALL and bond_count[i] == 0 and not fixed[i]:
            if particles_within(position, i, radius, bins) < fewest:
                lone[i] = LEAVING


@driver
def mark_lone(begin, end, lone, mark):
    """mark[i] = 1 where a particle is lone, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if lone[i] == LONE else 0


# ---- what the gas gives to them -------------------------------------------------------------------------------------


@helper
def cell_of(position, n, grid: BlockGrid, table: BlockTable):
    """Flat index of the cell of this rank that a particle is in, -1 if that is none of the grid's."""
    b = block_at(position, n, grid, table) - table.first
    inside = True
    ix, iy, iz = int(floor((position[n, 0] - grid.lower[0]) / grid.spacing[b, 0])), 0, 0
    inside = inside and ix >= 0 and ix < grid.cells[0]
    if DIMENSIONS > 1:
        iy = int(floor((position[n, 1] - grid.lower[1]) / grid.spacing[b, 1]))
        inside = inside and iy >= 0 and iy < grid.cells[1]
    if DIMENSIONS > 2:
        iz = int(floor((position[n, 2] - grid.lower[2]) / grid.spacing[b, 2]))
        inside = inside and iz >= 0 and iz < grid.cells[2]
    at = -1
    if inside:
        at = cell_at(b, ix - grid.origin[b, 0], iy - grid.origin[b, 1], iz - grid.origin[b, 2], grid)
    return at


@helper
def pressure_slope(U, walls: Walls, at, axis, grid: BlockGrid):
    """How the pressure changes [Pa/m] along an axis: between the neighbours behind open faces of a cell, or the cell
    and the only one."""
    cells, step, h = block_size(grid), grid.steps[axis], grid.spacing[block_of(at, grid), axis]
    low = at - step if aperture_between(walls, at, axis, grid) > 0.0 else at
    high = at + step if aperture_between(walls, at + step, axis, grid) > 0.0 else at
    W_low, W_high = primitives(state_at(U, low, cells)), primitives(state_at(U, high, cells))
    rise = W_high[PHASES + DIMENSIONS] - W_low[PHASES + DIMENSIONS]
    return rise * real(1.0 / (h * ((1 if low != at else 0) + (1 if high != at else 0))) if high != low else 0.0)


@driver
def feel_gas(
    begin,
    end,
    lone: LonePoints,
    velocity,
    mass,
    density,
    states: States,
    pressing,
    walls: Walls,
    dt,
    grid: BlockGrid,
    table: BlockTable,
):
    """Cells of lone particles are found, then `following` and `pressed` where there is fluid.

    velocity, mass, density: of this rank's particles; pressing: the states, ghosts included, whose pressures have moved
    the gas in the last stage of a step of `dt` [s].
    """
    cells = block_size(grid)
    for n in range(begin, end):
        p, at = lone.rows[n], cell_of(lone.position, n, grid, table)
        lone.cell[n] = -1
        if at >= 0:
            if load(states.volume, volume_at(at, cells)) > 0.0:
                lone.cell[n] = at
                # drag and added mass
                state, v = state_at(states.U, at, cells), tuple(real(velocity[p, d]) for d in static_range(DIMENSIONS))
                W = primitives(state)
                m, volume = real(mass[p]), real(mass[p] / density[p])
                pressed_mass, dragged_mass = masses_that_follow(state, W, sound_speed(W), v, m, volume, real(dt))
                lone.following[n, 0] = pressed_mass
                lone.following[n, 1] = dragged_mass
                # what pressure does to the gas
                rho = sum(state[k] for k in static_range(PHASES))
                for d in static_range(DIMENSIONS):
                    lone.pressed[n, d] = -dt * pressure_slope(pressing, walls, at, d, grid) / rho


@helper
def add_following(sums, n, lone: LonePoints, bins: Bins, velocity, grid: BlockGrid):
    """sums (2 + D,) = masses that follow, and momentum of those that are dragged, of all lone particles in the cell of
    one of them."""
    for v in range(2 + DIMENSIONS):
        sums[v] = 0.0
    # particles in the same cell are no farther apart than a cell
    x = tuple(lone.position[n, d] for d in static_range(DIMENSIONS))
    b = block_of(lone.cell[n], grid)
    bx, by, bz = bins_around(x, tuple(grid.spacing[b, d] for d in static_range(DIMENSIONS)), bins)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            start, stop = particles_of_row(bx, j, k, bins)
            for m in range(start, stop):
                q = bins.order[m]
                if lone.cell[q] == lone.cell[n]:
                    sums[0] += lone.following[q, 0]
                    sums[1] += lone.following[q, 1]
                    for d in static_range(DIMENSIONS):
                        sums[2 + d] += lone.following[q, 1] * velocity[lone.rows[q], d]


@driver
def drag(begin, end, lone: LonePoints, bins: Bins, velocity, states: States, impulse, grid: BlockGrid):
    """impulse[p] (D,) [N s] = what the gas of its cell gives to a lone particle in a step.

    All that are in the cell get a share of what pressure gives to the gas, which keeps the rest, and come nearer to one
    velocity, at once: so neither swings, however light they are or many.
    """
    cells = block_size(grid)
    sums = workspace(2 + DIMENSIONS)
    for n in range(begin, end):
        if lone.cell[n] >= 0:
            # all that are in the cell, and the gas
            at = lone.cell[n]
            add_following(sums, n, lone, bins, velocity, grid)
            state = state_at(states.U, at, cells)
            filled = load(states.volume, volume_at(at, cells)) * cell_volume(block_of(at, grid), grid)
            held = filled * sum(state[k] for k in static_range(PHASES))
            kept = held / (held + sums[0])
            # their common velocity
            for d in static_range(DIMENSIONS):
                push = kept * lone.pressed[n, d]
                gas = filled * state[PHASES + d] - sums[0] * push
                common = (gas + sums[2 + d]) / (held + sums[1])
                slip = common - velocity[lone.rows[n], d]
                impulse[lone.rows[n], d] = lone.following[n, 0] * push + lone.following[n, 1] * slip


# ---- what the gas pays ----------------------------------------------------------------------------------------------


@helper
def add_work(paid, n, lone: LonePoints, bins: Bins, velocity, mass, impulse, grid: BlockGrid):
    """paid[n] (D + 1,) = impulse and work of all lone particles in the cell of one of them; returns the first of
    them."""
    first = -1
    # particles in the same cell are no farther apart than a cell
    x = tuple(lone.position[n, d] for d in static_range(DIMENSIONS))
    b = block_of(lone.cell[n], grid)
    bx, by, bz = bins_around(x, tuple(grid.spacing[b, d] for d in static_range(DIMENSIONS)), bins)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            start, stop = particles_of_row(bx, j, k, bins)
            for m in range(start, stop):
                q = bins.order[m]
                if lone.cell[q] == lone.cell[n]:
                    first = q if first < 0 else first
                    for d in static_range(DIMENSIONS):
                        J = impulse[lone.rows[q], d]
                        paid[n, d] += J
                        paid[n, DIMENSIONS] += J * (velocity[lone.rows[q], d] + 0.5 * (J / mass[lone.rows[q]]))
    return first


@driver
def pay_drag(begin, end, lone: LonePoints, bins: Bins, velocity, mass, impulse, paid, states: States, grid: BlockGrid):
    """The gas of each cell pays the impulse and the work that lone particles in it get, with the first of them: its
    paid[n] (D + 1,) [N s, J], 0 of the others."""
    cells = block_size(grid)
    for n in range(begin, end):
        for d in range(DIMENSIONS + 1):
            paid[n, d] = 0.0
        # what all of a cell get
        first = -1
        if lone.cell[n] >= 0:
            first = add_work(paid, n, lone, bins, velocity, mass, impulse, grid)
        # momentum and energy of its gas, once
        if first == n:
            at = lone.cell[n]
            filled = load(states.volume, volume_at(at, cells)) * cell_volume(block_of(at, grid), grid)
            for d in static_range(DIMENSIONS + 1):
                amount = first_value(at, VARIABLES, cells) + (PHASES + d) * cells
                store(states.U, amount, load(states.U, amount) - paid[n, d] / filled)
        else:
            for d in range(DIMENSIONS + 1):
                paid[n, d] = 0.0
