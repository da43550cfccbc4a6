"""Drag of a lone particle: that of a sphere (of a disc of its area in a plane) at large Reynolds numbers."""

from math import exp, pi, pow, sqrt

from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS, PHASES
from distfsi.physics.tensors import dot

SLOW = 0.44  # drag coefficient of a sphere at small Mach numbers (Newton's range)
SLOWEST = 0.1  # Mach number below which the coefficient does not change any more


def drag_coefficient(mach):
    """It doubles as the Mach number grows (Carlson, Hoglund, AIAA J. 2 (1964) 1980, without viscosity)."""
    return SLOW * (1.0 + exp(-0.427 / pow(max(mach, SLOWEST), 4.63)))


def frontal_area(volume):
    """What a sphere of a `volume` [m^d] shows to the flow [m^(d-1)]."""
    if DIMENSIONS == 1:
        return 1.0
    if DIMENSIONS == 2:
        return sqrt(4.0 * volume / pi)
    if DIMENSIONS == 3:
        return 0.25 * pi * pow(6.0 * volume / pi, 2.0 / 3.0)


def mass_that_follows(U, W, c, velocity, mass, volume, dt):
    """Mass [kg] by which a particle's momentum counts in the common velocity of gas and particles after `dt` [s].

    The drag k |u - v| (u - v) is taken with |u - v| from before the step and u - v from after it; with one particle
    in much gas that is exact.
    """
    rho = sum(U[k] for k in static_range(PHASES))
    slip = tuple(W[PHASES + d] - velocity[d] for d in static_range(DIMENSIONS))
    speed = sqrt(dot(slip, slip))
    given = dt * (0.5 * rho * speed * drag_coefficient(speed / c) * frontal_area(volume))
    return mass * given / (mass + given)
