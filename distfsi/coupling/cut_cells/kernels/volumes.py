"""Loops of the exchange of volumes: fluid volume fractions stay near the geometric ones.

Cells whose fluid has more volume than is open of them give to neighbours with less, with the content that belongs to
it.
"""

from distfsi.coupling.cut_cells.kernels.records import States, Walls, aperture_at, state_at, volume_at
from distfsi.coupling.kernels.cells import FLUID
from distfsi.device.markers import driver, helper, load, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES, bulk_modulus, primitives
from distfsi.mesh.kernels.grid import BlockGrid, block_size, index_of, is_along

LARGEST_SHARE = 0.125  # of its volume: the most that a cell gives to a neighbour at a time
TOLERATED = 0.05  # of a whole cell: what may be missing to its volume
LARGEST_LOSS = 0.05  # of its pressure: what a cell loses at a time when it fills what is missing


@helper
def surplus(states: States, walls: Walls, at, cells):
    """Fluid less geometric volume fraction of a cell; 0 where nothing may be exchanged."""
    part = load(walls.new_fraction, at)
    held = load(states.volume, volume_at(at, cells)) - part
    return held if walls.kind[at] == FLUID and part > 0.0 else 0.0


@helper
def opposite(states: States, walls: Walls, at, sign, index, grid: BlockGrid):
    """Sum of what the neighbours behind open faces of a cell, of an index in the grid, have too little, if `sign` is
    positive, or too much."""
    cells, total = block_size(grid), 0.0
    for axis in range(DIMENSIONS):
        for side in range(2):
            if is_along(index, axis, 2 * side - 1, grid):
                if aperture_at(walls, at + side * grid.steps[axis], axis, cells) > 0.0:
                    other = surplus(states, walls, at + (2 * side - 1) * grid.steps[axis], cells)
                    total += max(-sign * other, 0.0)
    return total


@helper
def volume_given(states: States, walls: Walls, at, other, own, around, sign, grid: BlockGrid):
    """What volume a cell gives to the `other`, if `sign` is positive, or gets: its share of both sums of what may be
    exchanged, `own` and `around` being this cell's surplus and what its neighbours lack, or have."""
    cells = block_size(grid)
    theirs, moved = surplus(states, walls, other, cells), 0.0
    if own * theirs < 0.0:
        beyond = opposite(states, walls, other, -sign, index_of(other, grid), grid)
        giver = at if own > 0.0 else other
        held = load(states.volume, volume_at(giver, cells))
        moved = min(-own * theirs / max(around, beyond), LARGEST_SHARE * held)
    return moved


@helper
def expand(new, n):
    """The fluid of a whole cell fills what is missing in it, and loses no more than LARGEST_LOSS of its pressure."""
    state, volume = tuple(new[n, v] for v in static_range(VARIABLES)), new[n, VARIABLES]
    missing = 1.0 - TOLERATED - volume
    if missing > 0.0:
        W = primitives(state)
        gained = max(min(missing, volume * (LARGEST_LOSS * W[PHASES + DIMENSIONS] / bulk_modulus(W))), 0.0)
        for v in static_range(PHASES + DIMENSIONS + 1):
            new[n, v] = state[v] * (volume / (volume + gained))
        for v in static_range(PHASES + DIMENSIONS + 2, VARIABLES):
            new[n, v] = state[v] * (volume / (volume + gained))
        new[n, VARIABLES] = volume + gained


@driver
def exchange_volumes(begin, end, chosen, new, states: States, walls: Walls, expands, grid: BlockGrid):
    """new (n, VARIABLES + 1) = state and volume of the cells `chosen`, among them all with too much or too little,
    after the exchange.

    What is missing in whole cells all the same their own fluid fills, if it `expands`.
    """
    cells = block_size(grid)
    total = workspace(VARIABLES)
    for n in range(begin, end):
        at, gained = chosen[n], 0.0
        state, volume = state_at(states.U, at, cells), load(states.volume, volume_at(at, cells))
        own = surplus(states, walls, at, cells)
        if own != 0.0:
            for v in static_range(VARIABLES):
                total[v] = volume * state[v]
            sign = 1.0 if own > 0.0 else -1.0
            index = index_of(at, grid)
            around = opposite(states, walls, at, sign, index, grid)
            # what passes each open face
            for axis in range(DIMENSIONS):
                for side in range(2):
                    way = 2 * side - 1
                    other = at + way * grid.steps[axis]
                    inside = is_along(index, axis, way, grid)
                    if inside and aperture_at(walls, at + side * grid.steps[axis], axis, cells) > 0.0:
                        moved = volume_given(states, walls, at, other, own, around, sign, grid)
                        if moved != 0.0:
                            given = state_at(states.U, at if own > 0.0 else other, cells)
                            gained -= sign * moved
                            for v in static_range(VARIABLES):
                                total[v] -= sign * moved * given[v]
        # the new state
        for v in static_range(VARIABLES):
            new[n, v] = total[v] / (volume + gained) if gained != 0.0 else state[v]
        new[n, VARIABLES] = volume + gained
        if expands > 0 and walls.kind[at] == FLUID and load(walls.new_fraction, at) == 1.0:
            expand(new, n)
