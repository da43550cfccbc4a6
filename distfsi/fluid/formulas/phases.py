"""The laws of three to five phases, a value per phase, and their volume fractions.

Stored and primitive states hold the volume fractions of all phases but the last, whose is what they leave.
"""

from distfsi.fluid.formulas.stiffness import weight_1, weight_2, weight_3, weight_4, weight_5
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    DIMENSIONS,
    MINIMUM_FRACTION,
    PHASES,
    grueneisen_1,
    grueneisen_2,
    grueneisen_3,
    grueneisen_4,
    grueneisen_5,
    reference_1,
    reference_2,
    reference_3,
    reference_4,
    reference_5,
    stored_reference_1,
    stored_reference_2,
    stored_reference_3,
    stored_reference_4,
    stored_reference_5,
)


def references(rho):
    """Of each phase its reference pressure [Pa] and the slope of that with density [m2/s2]."""
    if PHASES == 3:
        return (reference_1(rho[0]), reference_2(rho[1]), reference_3(rho[2]))
    elif PHASES == 4:
        return (reference_1(rho[0]), reference_2(rho[1]), reference_3(rho[2]), reference_4(rho[3]))
    else:
        return (
            reference_1(rho[0]),
            reference_2(rho[1]),
            reference_3(rho[2]),
            reference_4(rho[3]),
            reference_5(rho[4]),
        )


def stored_references(rho):
    """The same, to the energies that are stored."""
    if PHASES == 3:
        return (stored_reference_1(rho[0]), stored_reference_2(rho[1]), stored_reference_3(rho[2]))
    elif PHASES == 4:
        return (
            stored_reference_1(rho[0]),
            stored_reference_2(rho[1]),
            stored_reference_3(rho[2]),
            stored_reference_4(rho[3]),
        )
    else:
        return (
            stored_reference_1(rho[0]),
            stored_reference_2(rho[1]),
            stored_reference_3(rho[2]),
            stored_reference_4(rho[3]),
            stored_reference_5(rho[4]),
        )


def omegas(rho):
    """Grueneisen coefficient of each phase."""
    if PHASES == 3:
        return (grueneisen_1(rho[0])[0], grueneisen_2(rho[1])[0], grueneisen_3(rho[2])[0])
    elif PHASES == 4:
        return (
            grueneisen_1(rho[0])[0],
            grueneisen_2(rho[1])[0],
            grueneisen_3(rho[2])[0],
            grueneisen_4(rho[3])[0],
        )
    else:
        return (
            grueneisen_1(rho[0])[0],
            grueneisen_2(rho[1])[0],
            grueneisen_3(rho[2])[0],
            grueneisen_4(rho[3])[0],
            grueneisen_5(rho[4])[0],
        )


def weights(rho):
    """g of each phase (stiffness.py)."""
    if PHASES == 3:
        return (weight_1(rho[0]), weight_2(rho[1]), weight_3(rho[2]))
    elif PHASES == 4:
        return (weight_1(rho[0]), weight_2(rho[1]), weight_3(rho[2]), weight_4(rho[3]))
    else:
        return (weight_1(rho[0]), weight_2(rho[1]), weight_3(rho[2]), weight_4(rho[3]), weight_5(rho[4]))


def fractions(U):
    """Volume fractions of all phases in a stored or primitive state."""
    return (
        *(U[PHASES + DIMENSIONS + 1 + k] for k in static_range(PHASES - 1)),
        1.0 - sum(U[PHASES + DIMENSIONS + 1 + k] for k in static_range(PHASES - 1)),
    )


def bounded(a):
    """Volume fractions of all phases but the last, such that no phase has less than MINIMUM_FRACTION.

    Where they come to too much they give back what they have beyond that, each in proportion. Fractions within their
    bounds keep their bits.
    """
    raised = tuple(max(a[k], MINIMUM_FRACTION) for k in static_range(PHASES - 1))
    beyond = tuple(raised[k] - MINIMUM_FRACTION for k in static_range(PHASES - 1))
    surplus = max(sum(raised[k] for k in static_range(PHASES - 1)) - (1.0 - MINIMUM_FRACTION), 0.0)
    part = surplus / max(sum(beyond[k] for k in static_range(PHASES - 1)), MINIMUM_FRACTION)
    return tuple(raised[k] - part * beyond[k] for k in static_range(PHASES - 1))


def in_bounds(W):
    """A state between cells whose volume fractions were reconstructed one by one: none is less than the minimum."""
    a = bounded(tuple(W[PHASES + DIMENSIONS + 1 + k] for k in static_range(PHASES - 1)))
    return (*(W[v] for v in static_range(PHASES + DIMENSIONS + 1)), *(a[k] for k in static_range(PHASES - 1)))
