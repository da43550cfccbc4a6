"""The pass that remembers the peaks of the flow in every cell, once per step and only where a scene asks for it."""

from typing import Any, NamedTuple

from distfsi.coupling.kernels.cells import COVERED
from distfsi.device.markers import driver, load, row, store
from distfsi.diagnostics.formulas.peaks import arrival, dynamic_pressure, overpressure, positive_impulse
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import VARIABLES
from distfsi.mesh.kernels.grid import BlockGrid, block_of_row, block_size, cells_of_row, first_value, ghosts

OVERPRESSURE, IMPULSE, ARRIVAL, DYNAMIC_PRESSURE = 0, 1, 2, 3  # what is remembered
REMEMBERED = 4


class Step(NamedTuple):
    """A step of `dt` [s] that ends at `time` [s]: states (blocks, VARIABLES, Z, Y, X) before and after it."""

    before: Any
    after: Any
    time: float
    dt: float


class Limits(NamedTuple):
    """What pressures are compared with: that of the air at rest, and the overpressure of an arrival [Pa]."""

    ambient: float
    arrival: float


@row
def peaks_row(step: Step, Q, K, u, q, k, su, n, limits: Limits):
    """Q[q …] takes in the step of the n cells at U[u …]; cells covered by K[k …] stay as they are."""
    for i in range(n):
        state = tuple(load(step.after, u + v * su + i) for v in static_range(VARIABLES))
        old = tuple(load(step.before, u + v * su + i) for v in static_range(VARIABLES))
        before, after = overpressure(old, limits.ambient), overpressure(state, limits.ambient)
        is_fluid = load(K, k + i) < COVERED
        peak = load(Q, q + OVERPRESSURE * su + i)
        impulse = load(Q, q + IMPULSE * su + i)
        arrived = load(Q, q + ARRIVAL * su + i)
        dynamic = load(Q, q + DYNAMIC_PRESSURE * su + i)
        now = arrival(before, after, limits.arrival, step.time, step.dt)
        gain = positive_impulse(before, after, step.dt)
        store(Q, q + OVERPRESSURE * su + i, max(peak, after) if is_fluid else peak)
        store(Q, q + IMPULSE * su + i, impulse + gain if is_fluid else impulse)
        store(Q, q + ARRIVAL * su + i, min(arrived, now) if is_fluid else arrived)
        store(Q, q + DYNAMIC_PRESSURE * su + i, max(dynamic, dynamic_pressure(state)) if is_fluid else dynamic)


@driver
def remember_peaks(begin, end, step: Step, peaks, kind, limits: Limits, grid: BlockGrid):
    """peaks (blocks, 4, Z, Y, X) float64 takes in a step. kind (blocks, 1, Z, Y, X): what the coupling says of each
    cell. An item is a row of cells along x, numbered as it lies in memory."""
    cells = block_size(grid)
    for r in range(begin, end):
        n = cells_of_row(r, block_of_row(r, grid), grid)
        if n > 0:
            at = r * grid.shape[2] + ghosts()[0]
            u, q = first_value(at, VARIABLES, cells), first_value(at, REMEMBERED, cells)
            peaks_row(step, peaks, kind, u, q, at, cells, n, limits)
