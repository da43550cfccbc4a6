"""The immersed boundary: weights between cells and particles, what a cell behind the wall holds (paper, Sec. 3.2)."""

from math import pi

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES
from distfsi.solid.formulas.smoothing import smoothing_kernel


def immersed_weight(distance2, radius):
    """Wendland C2 kernel [1/m^d] that vanishes at `radius`, at the squared distance `distance2` [m2] below radius^2."""
    return smoothing_kernel(distance2, 0.5 * radius)


def broad_weight(distance2, radius):
    """Kernel (1 - q^2)^2 [1/m^d] of `radius`, q = r/radius, at the squared distance `distance2` [m2]; 0 beyond it."""
    s = max(1.0 - distance2 / (radius * radius), 0.0)
    if DIMENSIONS == 1:
        return 0.9375 / radius * s * s
    if DIMENSIONS == 2:
        return 3.0 / pi / (radius * radius) * s * s
    if DIMENSIONS == 3:
        return 3.28125 / pi / (radius * radius * radius) * s * s


def moving_with(W, velocity):
    """Primitive state W with another velocity: the boundary's (Eq. 31) behind a wall."""
    return (
        *(W[v] for v in static_range(PHASES)),
        *(velocity[d] for d in static_range(DIMENSIONS)),
        *(W[v] for v in static_range(PHASES + DIMENSIONS, VARIABLES)),
    )


def impulse_on_wall(passed, velocity):
    """Impulse [N s] on the solid in a cell that moves with `velocity` [m/s] (Eq. 33; only faces to fluid count).

    passed: the amounts (masses, momentum, energy) that have crossed these faces into the cell.
    """
    mass = sum(passed[v] for v in static_range(PHASES))
    return tuple(passed[PHASES + d] - velocity[d] * mass for d in static_range(DIMENSIONS))
