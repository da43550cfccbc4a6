"""The pass that remembers the peaks of the flow in every cell, once per step and only where a scene asks for it."""

from distfsi.coupling.kernels.cells import COVERED
from distfsi.device.markers import driver, load, row, store
from distfsi.diagnostics.formulas.peaks import arrival, dynamic_pressure, overpressure, positive_impulse
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, VARIABLES

OVERPRESSURE, IMPULSE, ARRIVAL, DYNAMIC_PRESSURE = 0, 1, 2, 3  # what is remembered


@row
def peaks_row(U, U_old, Q, K, u, q, k, su, n, ambient, threshold, time, dt):
    """Q[q …] takes in the step from U_old to U of the n cells at U[u …]; cells covered by K[k …] stay as they are."""
    for i in range(n):
        state = tuple(load(U, u + v * su + i) for v in static_range(VARIABLES))
        old = tuple(load(U_old, u + v * su + i) for v in static_range(VARIABLES))
        before, after = overpressure(old, ambient), overpressure(state, ambient)
        is_fluid = load(K, k + i) < COVERED
        peak = load(Q, q + OVERPRESSURE * su + i)
        impulse = load(Q, q + IMPULSE * su + i)
        arrived = load(Q, q + ARRIVAL * su + i)
        dynamic = load(Q, q + DYNAMIC_PRESSURE * su + i)
        now = arrival(before, after, threshold, time, dt)
        gain = positive_impulse(before, after, dt)
        store(Q, q + OVERPRESSURE * su + i, max(peak, after) if is_fluid else peak)
        store(Q, q + IMPULSE * su + i, impulse + gain if is_fluid else impulse)
        store(Q, q + ARRIVAL * su + i, min(arrived, now) if is_fluid else arrived)
        store(Q, q + DYNAMIC_PRESSURE * su + i, max(dynamic, dynamic_pressure(state)) if is_fluid else dynamic)


@driver
def remember_peaks(begin, end, layers, U, U_old, peaks, kind, shape, extent, ambient, threshold, time, dt):
    """peaks (blocks, 4, Z, Y, X) float64 takes in the step of `dt` [s] from U_old to U, which ends at `time` [s].

    layers: of ghosts; kind (blocks, 1, Z, Y, X): what the coupling says of each cell; `ambient`, `threshold` [Pa]. An
    item is a row of cells along x, numbered as it lies in memory.
    """
    cells = shape[0] * shape[1] * shape[2]
    gy, gz = (layers if DIMENSIONS > 1 else 0), (layers if DIMENSIONS > 2 else 0)
    for r in range(begin, end):
        b, at = r // (shape[0] * shape[1]), r * shape[2] + layers
        j, k = r % shape[1] - gy, r // shape[1] % shape[0] - gz
        u, q = at + b * (VARIABLES - 1) * cells, at + b * 3 * cells
        if j >= 0 and j < extent[b, 1] and k >= 0 and k < extent[b, 2]:
            peaks_row(U, U_old, peaks, kind, u, q, at, cells, extent[b, 0], ambient, threshold, time, dt)
