"""The fastest signal of each block, which bounds the time step."""

from math import sqrt

from distfsi.device.markers import ByHand, driver, load, row, store, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES, primitives, sound_speed


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
def fastest_signals(begin, end, chosen, U, start, extent, rx, ry, rz, fastest):
    """fastest[block] = max over its cells of sum_d (|u_d| + c)/h_d [1/s] for the blocks chosen[begin:end]; NaN when a
    cell has no valid state.

    start: index of a block's first active cell within one variable; rx, ry, rz: 1/h.
    """
    sy = U.shape[4]
    sz = sy * U.shape[3]
    su = sz * U.shape[2]
    S = workspace(2 * sy)
    for at in range(begin, end):
        block = chosen[at]
        n = extent[block, 0]
        for i in range(2 * n):
            S[i] = 0.0
        for k in range(extent[block, 2]):
            for j in range(extent[block, 1]):
                signal_row(U, S, block * VARIABLES * su + start + k * sz + j * sy, su, n, rx, ry, rz)
        # the largest of all columns, or NaN
        largest, invalid = S[0], S[n]
        for i in range(1, n):
            largest, invalid = max(largest, S[i]), invalid + S[n + i]
        fastest[block] = largest + invalid
