"""How the shares that a phase carries fall in a step, and what that does to the cell.

The energy that shares hold back is in the total energy from the start, so nothing is created: when a share falls, the
phase gets what it held, and both phases come to one pressure again as after a stage (relaxation.py).
"""

from distfsi.fluid.formulas.relaxation import phases_before, relaxed_fraction_change
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    AFTERBURNS,
    BURNS,
    CARRIED,
    CARRIER,
    DIMENSIONS,
    HELD_ENERGY,
    VARIABLES,
    afterburn_left,
    grueneisen_1,
    grueneisen_2,
    primitives,
    reference_1,
    reference_2,
    unburnt_share,
)


def carried_shares(U):
    """The shares that the carrier carries."""
    return tuple(U[v] / U[CARRIER] for v in static_range(4 + DIMENSIONS, VARIABLES))


def shares_after(U, since, spacing, dt):
    """The shares of the carrier after a step of `dt` [s] that ends `since` [s] after the lighting time of the cell."""
    W = primitives(U)
    p, density = W[2 + DIMENSIONS], W[CARRIER]
    shares = tuple(min(max(W[4 + DIMENSIONS + n], 0.0), 1.0) for n in static_range(CARRIED))
    unburnt = unburnt_share(shares[0], since, density, spacing) if BURNS else 0.0
    air = U[1 - CARRIER] / U[CARRIER] if AFTERBURNS else 0.0
    left = afterburn_left(shares[CARRIED - 1], unburnt, p, air, dt) if AFTERBURNS else 0.0
    if BURNS and AFTERBURNS:
        return (unburnt, left)
    return (unburnt if BURNS else left,)


def released_energy(U, shares):
    """Energy [J/m3] that is no longer held back with these shares."""
    mass = U[CARRIER]
    return sum(HELD_ENERGY[n] * (U[4 + DIMENSIONS + n] - mass * shares[n]) for n in static_range(CARRIED))


def phases_of_release(U, released):
    """Where both phases stand (relaxation.py) when the carrier has got the energy released [J/m3]."""
    W = primitives(U)
    p, a1 = W[2 + DIMENSIONS], W[3 + DIMENSIONS]
    reference1, slope1 = reference_1(W[0])
    reference2, slope2 = reference_2(W[1])
    omega1, omega_slope1 = grueneisen_1(W[0])
    omega2, omega_slope2 = grueneisen_2(W[1])
    gained1 = omega1 * released if CARRIER == 0 else 0.0
    gained2 = 0.0 if CARRIER == 0 else omega2 * released
    return phases_before(p, a1, 0.0, U[0], U[1], reference1, reference2, gained1, gained2)


def change_at_once(phases):
    """Change of the volume fraction where phases relax in closed form."""
    change, settled = relaxed_fraction_change(phases)
    return change
