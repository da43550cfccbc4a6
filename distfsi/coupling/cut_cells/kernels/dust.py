"""Loops of lone particles: which they are, and the forces between them and the gas of the cells that they are in.

Cells are named as in coupling/kernels/cells.py. `rows` (n,): the particles that are lone, in the order of
their ids; `at` (n,): the cells that they are in; `place` (n, D) and what follows it: where they are, and the fields of
SearchCells. `follows` (n, 2) [kg]: masses that follow the gas, see coupling/formulas/drag.py; `pressed` (n, D) [m/s]:
change of its velocity.
"""

from math import floor

from distfsi.coupling.cut_cells.kernels.fluxes import open_between
from distfsi.coupling.cut_cells.kernels.redistribution import share_at, state_at
from distfsi.coupling.formulas.drag import masses_that_follow
from distfsi.coupling.kernels.cells import cell_at, home_of, three
from distfsi.coupling.kernels.interpolation import bins_around
from distfsi.device.markers import driver, helper, load, real, store, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES, primitives, sound_speed
from distfsi.formulas.tensors import dot

# What a particle is: part of a wall; lone, but still pushed by the wall that it was when the step began; lone.
WALL, LEAVING, DUST = range(3)


@driver
def find_dust(
    begin, end, dust, fixed, bond_count, radius, fewest, position, start, order, lower, size, low, window, strides
):
    """dust[i] = what a particle is. It leaves the wall when it has no bonds and there are fewer than the `fewest`
    particles, itself among them, within `radius` [m]; it never comes back."""
    for i in range(begin, end):
        if dust[i] == LEAVING:
            dust[i] = DUST
        if dust[i] == WALL and bond_count[i] == 0 and not fixed[i]:
            together = 0
            x = tuple(position[i, d] for d in static_range(DIMENSIONS))
            bx, by, bz = bins_around(x, tuple(radius for _ in static_range(DIMENSIONS)), lower, size, low, window)
            for k in range(bz[0], bz[1]):
                for j in range(by[0], by[1]):
                    row = k * strides[2] + j * strides[1]
                    for n in range(start[row + bx[0]], start[row + bx[1]]):
                        dx = tuple(x[d] - position[order[n], d] for d in static_range(DIMENSIONS))
                        if dot(dx, dx) < radius * radius:
                            together += 1
            if together < fewest:
                dust[i] = LEAVING


@driver
def mark_dust(begin, end, dust, mark):
    """mark[i] = 1 where a particle is lone, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if dust[i] == DUST else 0


@helper
def slope(U, kind, old, new, at, axis, step, h, cells):
    """How the pressure changes [Pa/m] along an axis: between the neighbours behind open faces of a cell, or the cell
    and the only one."""
    low = at - step if open_between(kind, old, new, at, axis, step, cells) > 0.0 else at
    high = at + step if open_between(kind, old, new, at + step, axis, step, cells) > 0.0 else at
    W_low, W_high = primitives(state_at(U, low, cells)), primitives(state_at(U, high, cells))
    rise = W_high[PHASES + DIMENSIONS] - W_low[PHASES + DIMENSIONS]
    return rise * real(1.0 / (h * ((1 if low != at else 0) + (1 if high != at else 0))) if high != low else 0.0)


@driver
def feel_gas(
    begin, end, rows, place, at, follows, pressed, velocity, mass, density, U, swept, pressing, kind, old, new, steps,
    dt, shape, lower, spacing, origin, grid_cells, block_cells, curve_index, first_block,
):  # fmt: skip
    """at[n] = the cell that a lone particle is in, -1 where there is no fluid; then follows and pressed are known.
    `pressing`: the states, ghosts included, whose pressures have moved the gas in the last stage."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        p, x = rows[n], three(place, n)
        at[n] = -1
        index = tuple(int(floor((x[d] - lower[d]) / spacing[d])) for d in static_range(3))
        inside = True
        for d in static_range(DIMENSIONS):
            inside = inside and index[d] >= 0 and index[d] < grid_cells[d]
        if inside:
            b = home_of(x, lower, spacing, grid_cells, block_cells, curve_index) - first_block
            here = cell_at(b, index[0] - origin[b, 0], index[1] - origin[b, 1], index[2] - origin[b, 2], shape)
            if load(swept, share_at(here, cells)) > 0.0:
                state, v = state_at(U, here, cells), tuple(real(velocity[p, d]) for d in static_range(DIMENSIONS))
                W = primitives(state)
                at[n] = here
                m, volume = real(mass[p]), real(mass[p] / density[p])
                pressed_mass, dragged_mass = masses_that_follow(state, W, sound_speed(W), v, m, volume, real(dt))
                follows[n, 0] = pressed_mass
                follows[n, 1] = dragged_mass
                rho = sum(state[k] for k in static_range(PHASES))
                for d in static_range(DIMENSIONS):
                    gradient = slope(pressing, kind, old, new, here, d, steps[d], spacing[d], cells)
                    pressed[n, d] = -dt * gradient / rho


@driver
def drag(
    begin, end, rows, place, at, follows, pressed, velocity, U, swept, volume, impulse, shape, spacing, start, order,
    lower, size, low, window, strides,
):  # fmt: skip
    """impulse[p] (D,) [N s] = what the gas of its cell, of a `volume`, gives to a lone particle in a step.

    All that are in the cell get a share of what pressure gives to the gas, which keeps the rest, and come nearer to one
    velocity, at once: so neither swings, however light they are or many.
    """
    cells = shape[0] * shape[1] * shape[2]
    sums = workspace(2 + DIMENSIONS)
    for n in range(begin, end):
        if at[n] >= 0:
            for v in range(2 + DIMENSIONS):
                sums[v] = 0.0
            x = tuple(place[n, d] for d in static_range(DIMENSIONS))
            reach = tuple(spacing[d] for d in static_range(DIMENSIONS))
            bx, by, bz = bins_around(x, reach, lower, size, low, window)
            for k in range(bz[0], bz[1]):
                for j in range(by[0], by[1]):
                    row = k * strides[2] + j * strides[1]
                    for m in range(start[row + bx[0]], start[row + bx[1]]):
                        q = order[m]
                        if at[q] == at[n]:
                            sums[0] += follows[q, 0]
                            sums[1] += follows[q, 1]
                            for d in static_range(DIMENSIONS):
                                sums[2 + d] += follows[q, 1] * velocity[rows[q], d]
            state = state_at(U, at[n], cells)
            filled = load(swept, share_at(at[n], cells)) * volume
            held = filled * sum(state[k] for k in static_range(PHASES))
            kept = held / (held + sums[0])
            for d in static_range(DIMENSIONS):
                push = kept * pressed[n, d]
                gas = filled * state[PHASES + d] - sums[0] * push
                common = (gas + sums[2 + d]) / (held + sums[1])
                impulse[rows[n], d] = follows[n, 0] * push + follows[n, 1] * (common - velocity[rows[n], d])


@helper
def pay(U, energy, at, cells, part, paid, n):
    """Take impulse and work out of a cell, whose energy is at `energy`, and which is filled by a volume `part`."""
    for d in static_range(DIMENSIONS):
        place = energy - (DIMENSIONS - d) * cells
        store(U, place, load(U, place) - paid[n, d] / part)
    store(U, energy, load(U, energy) - paid[n, DIMENSIONS] / part)


@driver
def pay_drag(
    begin, end, rows, place, at, velocity, mass, impulse, paid, U, swept, volume, shape, spacing, start, order, lower,
    size, low, window, strides,
):  # fmt: skip
    """The gas of each cell pays the impulse and the work that lone particles in it get, with the first of them: its
    paid[n] (D + 1,) [N s, J], 0 of the others."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        for d in range(DIMENSIONS + 1):
            paid[n, d] = 0.0
        first = -1
        x = tuple(place[n, d] for d in static_range(DIMENSIONS))
        reach = tuple(spacing[d] for d in static_range(DIMENSIONS))
        bx, by, bz = bins_around(x, reach, lower, size, low, window)
        for k in range(bz[0], bz[1]):
            for j in range(by[0], by[1]):
                row = k * strides[2] + j * strides[1]
                for m in range(start[row + bx[0]], start[row + bx[1]]):
                    q = order[m]
                    if at[n] >= 0 and at[q] == at[n]:
                        first = q if first < 0 else first
                        for d in static_range(DIMENSIONS):
                            J = impulse[rows[q], d]
                            paid[n, d] += J
                            paid[n, DIMENSIONS] += J * (velocity[rows[q], d] + 0.5 * (J / mass[rows[q]]))
        if first == n:
            energy = at[n] + (at[n] // cells * (VARIABLES - 1) + PHASES + DIMENSIONS) * cells
            pay(U, energy, at[n], cells, load(swept, share_at(at[n], cells)) * volume, paid, n)
        else:
            for d in range(DIMENSIONS + 1):
                paid[n, d] = 0.0
