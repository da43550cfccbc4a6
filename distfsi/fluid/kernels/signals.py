"""The fastest signal of each block, which bounds the time step."""

from math import sqrt

from distfsi.device.markers import ByHand, driver, load, real, row, store, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES, primitives, sound_speed
from distfsi.mesh.kernels.grid import BlockGrid, block_size, cell_at, first_value


@row
def signal_row(U, S, u, su, n, rx, ry, rz):
    """S[i] = sum over axes of (|u| + c)/h, largest so far in column i; S[n + i] stays 0 as long as every signal is
    finite; that of a cell with a negative mass is not."""
    for i in range(n):
        W = primitives(tuple(load(U, u + v * su + i) for v in static_range(VARIABLES)))
        c = sound_speed(W)
        signal = (abs(W[PHASES]) + c) * rx
        if DIMENSIONS > 1:
            signal = signal + (abs(W[PHASES + 1]) + c) * ry
        if DIMENSIONS > 2:
            signal = signal + (abs(W[PHASES + 2]) + c) * rz
        lightest = load(U, u + i)
        for k in static_range(1, PHASES):
            lightest = min(lightest, load(U, u + k * su + i))
        signal = signal + (sqrt(lightest) - sqrt(lightest))
        store(S, i, max(load(S, i), signal))
        store(S, n + i, load(S, n + i) + (signal - signal))


def signal_block(constants, arguments):
    """The block's threads share the cells of a block of the grid."""
    return {"THREADS": 128, "SHARED": 0}


@ByHand("stage.cu", ("primitives", "sound_speed"), signal_block)
@driver
def fastest_signals(begin, end, chosen, U, fastest, grid: BlockGrid):
    """fastest[block] = max over its cells of sum_d (|u_d| + c)/h_d [1/s] for the blocks chosen[begin:end]; NaN when a
    cell has no valid state."""
    su, S = block_size(grid), workspace(2 * grid.shape[2])
    for at in range(begin, end):
        block = chosen[at]
        n = grid.extent[block, 0]
        rx, ry, rz = tuple(real(1.0 / grid.spacing[block, d]) for d in static_range(3))
        for i in range(2 * n):
            S[i] = 0.0
        for k in range(grid.extent[block, 2]):
            for j in range(grid.extent[block, 1]):
                signal_row(U, S, first_value(cell_at(block, 0, j, k, grid), VARIABLES, su), su, n, rx, ry, rz)
        # the largest of all columns, or NaN
        largest, invalid = S[0], S[n]
        for i in range(1, n):
            largest, invalid = max(largest, S[i]), invalid + S[n + i]
        fastest[block] = largest + invalid
