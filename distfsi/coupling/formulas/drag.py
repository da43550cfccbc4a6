"""Force of the gas on a lone particle: drag, and what accelerates the gas; those of a sphere (in a plane, a disc).

Maxey, Riley, Phys. Fluids 26 (1983) 883, without viscosity: with the mass b = rho V that the particle displaces and its
added mass a = C_M b,

    m dv/dt = (a + b) Du/Dt - a dv/dt + k |u - v| (u - v),    rho Du/Dt = -grad p.

Accelerations are those beyond gravity's, which has no part in this. In compressible flow the added mass takes the time
in which sound passes the particle (Parmar, Haselbacher, Balachandar, Phil. Trans. R. Soc. A 366 (2008) 2161), and grows
with the Mach number; particles are smaller than cells and steps, so neither is resolved.
"""

from math import exp, pi, pow, sqrt

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES
from distfsi.formulas.tensors import dot

ADDED_MASS = (0.0, 0.0, 1.0, 0.5)  # C_M, in so many dimensions, of a disc and a sphere in incompressible flow
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


def masses_that_follow(U, W, c, velocity, mass, volume, dt):
    """Masses [kg] by which the change of velocity w that pressure gives to the gas in `dt` [s], and the gas's velocity
    u' after it, act on a particle: it gets P w + K (u' - v).

    From (m + a)(v' - v) = (a + b) w + k dt |u - v| (u' - v'): the drag is taken with |u - v| from before the step and
    u - v from after it. With one particle in much gas that is exact.
    """
    rho = sum(U[k] for k in static_range(PHASES))
    slip = tuple(W[PHASES + d] - velocity[d] for d in static_range(DIMENSIONS))
    speed = sqrt(dot(slip, slip))
    given = dt * (0.5 * rho * speed * drag_coefficient(speed / c) * frontal_area(volume))
    displaced = rho * volume
    added = ADDED_MASS[DIMENSIONS] * displaced
    share = mass / (mass + added + given)
    return (share * (added + displaced), share * given)
