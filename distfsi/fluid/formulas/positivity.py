"""A face-local limiter that keeps masses and the square of the sound speed positive.

A cell's stage is the mean of what it would be after each of its faces alone, if each had the whole change to itself
(`rate` = number of faces * dt/h). Where that is inadmissible for either cell of a face, the flux is blended with the
first-order flux between the cells' means, just as far as needed (after Hu, Adams, Shu, J. Comput. Phys. 242, 2013).
It depends on the face's two cells only and is the same for both: conservative, and the same bits on any cut.
"""

from distfsi.fluid.formulas.phases import bounded, fractions
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    DIMENSIONS,
    FLUXES,
    MINIMUM_FRACTION,
    PHASES,
    VARIABLES,
    bulk_modulus,
    conserved,
    face_flux,
    primitives,
)

FLOOR = 0.01  # the part of each mass and of rho c^2 that one face must leave
MILD_SLIP = 0.7  # jump of the velocity in c that cannot turn all internal energy of a cell into motion
MILD_WORK = 1.2  # velocity that waves bring, in c, times rate * c: less cannot use up a cell's internal energy


def partial_masses(W):
    """a_k rho_k of each phase."""
    if PHASES == 1:
        return (W[0],)
    elif PHASES == 2:
        return (W[3 + DIMENSIONS] * W[0], (1.0 - W[3 + DIMENSIONS]) * W[1])
    else:
        a = fractions(W)
        return tuple(a[k] * W[k] for k in static_range(PHASES))


def limiter_indicator(left, right, F, c, rate):
    """Negative where the flux F between the cell means `left` and `right` may need limiting; cheap.

    c: the smaller sound speed at the face [m/s]. It is positive for the flux of a smooth flow.
    """
    slip = sum(abs(right[PHASES + d] - left[PHASES + d]) for d in static_range(DIMENSIONS))
    jump = abs(right[PHASES + DIMENSIONS] - left[PHASES + DIMENSIONS])
    mass_l, mass_r = partial_masses(left), partial_masses(right)
    impedance = c * min(sum(mass_l[k] for k in static_range(PHASES)), sum(mass_r[k] for k in static_range(PHASES)))
    lowest = min(MILD_SLIP * c - slip, impedance * (MILD_WORK - rate * slip) - rate * jump)
    share_l, share_r = (1.0 - FLOOR) + rate * left[PHASES], (1.0 - FLOOR) - rate * right[PHASES]
    for k in static_range(PHASES):
        lowest = min(lowest, min(mass_l[k] * share_l - rate * F[k], mass_r[k] * share_r + rate * F[k]))
    return lowest


def margins(W, F, rate):
    """What a cell of state W has of each mass and of rho c^2 above FLOOR after its change by one face alone.

    The face brings -rate (F - own flux of the cell); normal velocity first.
    """
    U = conserved(W)
    u, p = W[PHASES], W[PHASES + DIMENSIONS]
    own = tuple(
        U[v] * u + (p if v == PHASES else p * u if v == PHASES + DIMENSIONS else 0.0)
        for v in static_range(PHASES + DIMENSIONS + 1)
    )
    new = tuple(U[v] - rate * (F[v] - own[v]) for v in static_range(PHASES + DIMENSIONS + 1))
    if PHASES == 1:
        after = primitives(new)
    elif PHASES > 2:
        first = PHASES + DIMENSIONS + 1
        a = bounded(
            tuple(W[first + k] - rate * (F[first + k] - W[first + k] * F[FLUXES - 1]) for k in static_range(PHASES - 1))
        )
        after = primitives((*(new[v] for v in static_range(first)), *(a[k] for k in static_range(PHASES - 1))))
    else:
        a1 = W[3 + DIMENSIONS] - rate * (F[3 + DIMENSIONS] - W[3 + DIMENSIONS] * F[FLUXES - 1])
        a1 = min(max(a1, MINIMUM_FRACTION), 1.0 - MINIMUM_FRACTION)
        after = primitives(
            (
                *(new[v] for v in static_range(PHASES + DIMENSIONS + 1)),
                a1,
                *(U[v] - rate * (F[v] - U[v] * u) for v in static_range(4 + DIMENSIONS, VARIABLES)),
            )
        )
    spared = bulk_modulus(after) - FLOOR * bulk_modulus(W)
    return (*(new[k] - FLOOR * U[k] for k in static_range(PHASES)), spared)


def allowed_part(low, high):
    """How much of the way from a margin `low` (of the first-order flux) to a margin `high` leaves it positive."""
    safe = max(low, 0.0)
    part = safe / (safe - high)
    return 1.0 if high >= 0.0 else 0.999 * part if part > 0.0 else 0.0  # a NaN counts as negative


def is_admissible(left, right, F, rate):
    """Whether the flux F alone leaves both cells their masses and a sound speed."""
    margins_l, margins_r = margins(left, F, rate), margins(right, F, -rate)
    inside = True
    for k in static_range(PHASES + 1):
        inside = inside and margins_l[k] >= 0.0 and margins_r[k] >= 0.0
    return inside


def limited_flux(left, right, F, jump, rate):
    """F blended with the flux between the cell means `left` and `right`, so that it leaves both admissible."""
    F_low = face_flux(left, right, jump)
    low_l, high_l = margins(left, F_low, rate), margins(left, F, rate)
    low_r, high_r = margins(right, F_low, -rate), margins(right, F, -rate)
    theta = 1.0
    for k in static_range(PHASES + 1):
        theta = min(theta, min(allowed_part(low_l[k], high_l[k]), allowed_part(low_r[k], high_r[k])))
    blend = tuple(F_low[v] + theta * (F[v] - F_low[v]) for v in static_range(FLUXES))
    enough = is_admissible(left, right, blend, rate)  # rho c^2 may be less than linear in theta
    return tuple(blend[v] if enough else F_low[v] for v in static_range(FLUXES))
