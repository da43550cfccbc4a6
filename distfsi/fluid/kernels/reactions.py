"""The pass over cells in which shares that a phase carries fall: detonation and afterburn."""

from distfsi.device.markers import driver, helper, load, store
from distfsi.fluid.formulas.reactions import (
    carried_shares,
    change_at_once,
    phases_of_release,
    released_energy,
    shares_after,
)
from distfsi.fluid.kernels.rows import HALVINGS
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    BISECTION_FALLBACK,
    CARRIED,
    CARRIER,
    DIMENSIONS,
    RELAXES,
    VARIABLES,
    fraction_after,
    halved_range,
    range_of_change,
)
from distfsi.mesh.kernels.grid import (
    BlockGrid,
    block_of_row,
    block_size,
    cell_at,
    cells_of_row,
    first_value,
    index_of_row,
)


@helper
def relaxed_fraction(U, released):
    """The volume fraction when the carrier has got the energy released and both phases have one pressure again."""
    if RELAXES:
        phases = phases_of_release(U, released)
        if BISECTION_FALLBACK:
            low, high = range_of_change(phases)
            for _ in range(HALVINGS):
                low, high = halved_range(phases, low, high)
            return fraction_after(U, 0.5 * (low + high))
        return fraction_after(U, change_at_once(phases))
    return U[3 + DIMENSIONS]


@helper
def cell_size(block, grid: BlockGrid):
    """The largest extent of the cells of a block [m]."""
    size = grid.spacing[block, 0]
    for d in static_range(1, DIMENSIONS):
        size = max(size, grid.spacing[block, d])
    return size


@driver
def react(begin, end, U, lighting, changed, grid: BlockGrid, time, dt):
    """Shares of all cells after a step of `dt` [s] that ends at `time` [s].

    lighting  (blocks, 1, Z, Y, X) float64 times [s]
    changed   (blocks,) set to 1 where a cell has changed

    An item is a row of cells along x.
    """
    cells = block_size(grid)
    for r in range(begin, end):
        block = block_of_row(r, grid)
        size = cell_size(block, grid)
        j, k = index_of_row(r, grid)
        for i in range(cells_of_row(r, block, grid)):
            at = cell_at(block, i, j, k, grid)
            first = first_value(at, VARIABLES, cells)
            held = 0.0
            for v in static_range(4 + DIMENSIONS, VARIABLES):
                held += abs(load(U, first + v * cells))
            if held > 0.0:
                state = tuple(load(U, first + v * cells) for v in static_range(VARIABLES))
                before = carried_shares(state)
                shares = shares_after(state, time - load(lighting, at), size, dt)
                fall = sum(abs(before[n] - shares[n]) for n in static_range(CARRIED))
                if fall > 0.0:
                    fraction = relaxed_fraction(state, released_energy(state, shares))
                    store(U, first + (3 + DIMENSIONS) * cells, fraction)
                    for n in static_range(CARRIED):
                        store(U, first + (4 + DIMENSIONS + n) * cells, state[CARRIER] * shares[n])
                    changed[block] = 1
