"""What is remembered of a blast wave at a point: overpressure, its impulse, its arrival, the dynamic pressure."""

from math import inf

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, primitives


def overpressure(U, ambient):
    """Pressure of a conserved state above `ambient` [Pa]."""
    return primitives(U)[PHASES + DIMENSIONS] - ambient


def dynamic_pressure(U):
    """0.5 rho u^2 [Pa] of a conserved state."""
    rho = sum(U[v] for v in static_range(PHASES))
    return 0.5 * sum(U[PHASES + d] * U[PHASES + d] for d in static_range(DIMENSIONS)) / rho


def positive_impulse(before, after, dt):
    """Time integral [Pa s] of the positive part of an overpressure over a step, by the trapezoidal rule."""
    return 0.5 * dt * (max(before, 0.0) + max(after, 0.0))


def arrival(before, after, threshold, time, dt):
    """When an overpressure that is `after` at `time` [s] rose to `threshold` [Pa] in the step before; inf if below."""
    share = (after - threshold) / (after - before) if before < threshold else 1.0
    return time - share * dt if after >= threshold else inf
