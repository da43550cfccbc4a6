"""Loops of state redistribution: the contents of merged cells are added, and all of them get the state of the sum.

Between a stage and the redistribution after it the cells of the band hold contents, otherwise states.
"""

from distfsi.coupling.cut_cells.kernels.records import (
    Contents,
    Merging,
    States,
    put_content,
    put_state,
    state_at,
    step_to_target,
    volume_at,
)
from distfsi.coupling.formulas.moving_wall import state_before_relaxation, state_of, with_energies
from distfsi.coupling.kernels.cells import FLUID, ISOLATED
from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.fluid.formulas.relaxation import halved_range, range_of_change
from distfsi.fluid.kernels.rows import HALVINGS
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import BISECTION_FALLBACK, DIMENSIONS, LANES, PHASES, VARIABLES
from distfsi.mesh.kernels.grid import BlockGrid, block_size, step_to

MINIMUM_TRAPPED = 1e-3  # of a cell: the least volume of fluid that is trapped

# ---- states and contents --------------------------------------------------------------------------------------------


@driver
def take_contents(begin, end, band, states: States, grid: BlockGrid):
    """States of the band become contents, in place."""
    cells = block_size(grid)
    for n in range(begin, end):
        at = band[n]
        content = with_energies(state_at(states.U, at, cells), load(states.volume, volume_at(at, cells)))
        put_content(states.U, states.volume, at, cells, content)


@driver
def keep_volumes(begin, end, band, states: States, volume, grid: BlockGrid):
    """volume[n] = that of the fluid in a cell of the band."""
    cells = block_size(grid)
    for n in range(begin, end):
        volume[n] = load(states.volume, volume_at(band[n], cells))


@helper
def add_content(total, contents: Contents, fraction, at, cells):
    """Add a cell's content, phase energies, volume and open fraction to the four parts of `total`."""
    Q, volume = state_at(contents.Q, at, cells), volume_at(at, cells)
    for v in static_range(VARIABLES):
        total[v] += Q[v]
    if PHASES == 2:
        total[VARIABLES] += load(contents.volume, volume + cells)
        total[VARIABLES + 1] += load(contents.volume, volume + 2 * cells)
    total[VARIABLES + 2] += load(contents.volume, volume)
    total[VARIABLES + 3] += load(fraction, at)


# ---- absorption of isolated cells -----------------------------------------------------------------------------------


@driver
def mark_absorbed(begin, end, band, mark, kind, target, grid: BlockGrid):
    """mark[n] = 1 where a cell of the band is isolated and has a receiver, else 0."""
    cells = block_size(grid)
    for n in range(begin, end):
        has_receiver = step_to_target(target, band[n], cells, grid) != 0
        mark[n] = 1 if kind[band[n]] == ISOLATED and has_receiver else 0


@driver
def absorb(begin, end, band, moved, contents: Contents, kind, fraction, target, grid: BlockGrid):
    """moved (n, VARIABLES + 3) = contents, phase energies and volumes of the band's cells after isolated ones have
    handed theirs to their receivers."""
    cells = block_size(grid)
    total = workspace(VARIABLES + 4)
    for n in range(begin, end):
        at = band[n]
        for v in range(VARIABLES + 4):
            total[v] = 0.0
        # what it keeps
        if kind[at] == FLUID or step_to_target(target, at, cells, grid) == 0:
            add_content(total, contents, fraction, at, cells)
        # what isolated neighbours hand to it
        for axis in range(DIMENSIONS):
            for side in range(2):
                step = (2 * side - 1) * grid.steps[axis]
                if kind[at + step] == ISOLATED and step_to_target(target, at + step, cells, grid) == -step:
                    add_content(total, contents, fraction, at + step, cells)
        for v in range(VARIABLES + 3):
            moved[n, v] = total[v]


@driver
def put_moved(begin, end, band, moved, contents: Contents, grid: BlockGrid):
    """Store the contents and volumes of the band."""
    cells = block_size(grid)
    for n in range(begin, end):
        content = tuple(moved[n, v] for v in static_range(VARIABLES + 2))
        put_content(contents.Q, contents.volume, band[n], cells, content)
        store(contents.volume, volume_at(band[n], cells), moved[n, VARIABLES + 2])


@driver
def find_trapped(begin, end, band, held, states: States, kind, grid: BlockGrid):
    """held (n, PHASES) [kg/m3] = masses per volume of an isolated cell of the band, 0 of the others."""
    cells = block_size(grid)
    for n in range(begin, end):
        state, volume = state_at(states.U, band[n], cells), load(states.volume, volume_at(band[n], cells))
        for k in static_range(PHASES):
            held[n, k] = state[k] * volume if kind[band[n]] == ISOLATED else 0.0


# ---- redistribution -------------------------------------------------------------------------------------------------


@row
def states_row(Q, S, n):
    """S = states of the n contents Q, behind which their volumes stand, and a negative value where phases have not
    relaxed; values of a cell are LANES apart."""
    for i in range(n):
        content = tuple(load(Q, v * LANES + i) for v in static_range(VARIABLES + 2))
        state = state_of(content, load(Q, (VARIABLES + 2) * LANES + i))
        for v in static_range(VARIABLES + 1):
            store(S, v * LANES + i, state[v])


@helper
def relaxed_by_bisection(Q, i):
    """Volume fraction at which both phases of the content in lane i have one pressure."""
    content = tuple(load(Q, v * LANES + i) for v in static_range(VARIABLES + 2))
    U, phases = state_before_relaxation(content, load(Q, (VARIABLES + 2) * LANES + i))
    low, high = range_of_change(phases)
    for _ in range(HALVINGS):
        low, high = halved_range(phases, low, high)
    return phases[1] + 0.5 * (low + high)


@helper
def repeat_lane(Q, values, n):
    """Lanes n … LANES of so many values hold what the first does."""
    for v in range(values):
        for i in range(n, LANES):
            store(Q, v * LANES + i, load(Q, v * LANES))


@helper
def add_merged(total, n, at, contents: Contents, fraction, merging: Merging, grid: BlockGrid):
    """total = sum over the cell number n of the band, `at`, and those it is merged with; returns whether there are
    such."""
    cells = block_size(grid)
    center = at + step_to_target(merging.target, at, cells, grid)
    for v in range(VARIABLES + 4):
        total[v] = 0.0
    add_content(total, contents, fraction, center, cells)
    merged = center != at
    for m in range(len(merging.offsets)):
        if merging.joined[n, m] > 0:
            merged = True
            add_content(total, contents, fraction, center + step_to(merging.offsets, m, grid), cells)
    return merged


@driver
def redistribute(begin, end, band, new, contents: Contents, fraction, merging: Merging, grid: BlockGrid):
    """new (n, VARIABLES + 1) = state and volume of the band's cells, once merged ones share theirs. An item is a box
    of LANES cells.

    Volumes are shared as the `fraction` of cells is that is open.
    """
    total, Q, S = workspace(VARIABLES + 4), workspace((VARIABLES + 3) * LANES), workspace((VARIABLES + 1) * LANES)
    for box in range(begin, end):
        lanes = min(LANES, len(band) - box * LANES)
        # contents of merged cells, and each one's share of their volume
        for i in range(lanes):
            n, at = box * LANES + i, band[box * LANES + i]
            merged = add_merged(total, n, at, contents, fraction, merging, grid)
            total[VARIABLES + 2] = max(total[VARIABLES + 2], MINIMUM_TRAPPED)
            for v in range(VARIABLES + 3):
                store(Q, v * LANES + i, total[v])
            part = load(fraction, at) / total[VARIABLES + 3] if merged else 1.0
            new[n, VARIABLES] = total[VARIABLES + 2] * part
        # their states, phases relaxed to one pressure
        repeat_lane(Q, VARIABLES + 3, lanes)
        states_row(Q, S, LANES)
        for i in range(lanes):
            for v in range(VARIABLES):
                new[box * LANES + i, v] = load(S, v * LANES + i)
            if BISECTION_FALLBACK:
                if load(S, VARIABLES * LANES + i) < 0.0:
                    new[box * LANES + i, PHASES + DIMENSIONS + 1] = relaxed_by_bisection(Q, i)


@driver
def put_states(begin, end, chosen, new, states: States, grid: BlockGrid):
    """Store the `new` states and volumes (n, VARIABLES + 1) of the cells `chosen`."""
    cells = block_size(grid)
    for n in range(begin, end):
        put_state(states.U, chosen[n], cells, tuple(new[n, v] for v in static_range(VARIABLES)))
        store(states.volume, volume_at(chosen[n], cells), new[n, VARIABLES])


@driver
def put_rest(begin, end, covered, states: States, rest, grid: BlockGrid):
    """Covered cells hold the state `rest` in no volume."""
    cells = block_size(grid)
    for n in range(begin, end):
        put_state(states.U, covered[n], cells, tuple(rest[v] for v in static_range(VARIABLES)))
        store(states.volume, volume_at(covered[n], cells), 0.0)
