"""What a moving wall does to a cell: the pressure on it, the content that fluxes and wall leave, and its state.

The conserved content of a cell is Q = v U, where v is its fluid volume fraction: not the geometric one but the one that
the fluxes leave by the geometric conservation law, so that a uniform flow stays uniform. For two phases the energies of
both belong to the content until they are relaxed.
"""

from math import pow, sqrt

from distfsi.fluid.formulas.relaxation import phases_before, relaxed_fraction_change
from distfsi.fluid.formulas.six_equation import phase_energies
from distfsi.fluid.formulas.stiffness import exponent_1, weight_1
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    BODY_FORCE,
    DIMENSIONS,
    MINIMUM_FRACTION,
    PHASES,
    VARIABLES,
    grueneisen_1,
    grueneisen_2,
    primitives,
    reference_1,
    reference_2,
    sound_speed,
)
from distfsi.formulas.tensors import dot


def growth(W):
    """Exponent of the stiffened gas with the same bulk modulus; both phases share a mixture's pressure change."""
    if PHASES == 1:
        return exponent_1(W[0])
    else:
        a1 = W[3 + DIMENSIONS]
        omega1, omega_slope1 = grueneisen_1(W[0])
        omega2, omega_slope2 = grueneisen_2(W[1])
        return 1.0 + 1.0 / (a1 * (1.0 / omega1) + (1.0 - a1) * (1.0 / omega2))


def weight(W):
    """1, but for a fluid whose omega depends on its density (fluid/formulas/stiffness.py)."""
    if PHASES == 1:
        return weight_1(W[0])
    else:
        return 1.0


def wall_pressure(U, W, approach):
    """Pressure [Pa] on a wall that the fluid approaches at this speed: a shock, or a fan if it recedes.

    Exact for ideal, stiffened, Noble-Abel and Noble-Abel stiffened gas; else for such a gas with the same rho c^2.
    """
    rho = sum(U[v] for v in static_range(PHASES))
    p, c, gamma = W[PHASES + DIMENSIONS], sound_speed(W), growth(W)
    g = weight(W)
    stiff = rho * c * c / gamma
    square = rho * approach * approach
    b = 0.5 * (gamma + g) * square
    shock = 0.5 * b + sqrt(0.25 * b * b + gamma * stiff * square)
    q = max(1.0 + 0.5 * (gamma - g) * approach / c, 0.0)
    fan = stiff * (pow(q, 2.0 * gamma / (gamma - g)) - 1.0)
    return p + (shock if approach >= 0.0 else fan)


def wall_impedance(U, W, approach):
    """By how much wall_pressure() falls [Pa s/m] when the wall goes faster: not more than this, and that in sound."""
    rho = sum(U[v] for v in static_range(PHASES))
    return rho * (sound_speed(W) + (growth(W) + weight(W)) * max(approach, 0.0))


def with_energies(U, volume):
    """Content (VARIABLES, and both phase energies) of a relaxed state that fills the part `volume`."""
    if PHASES == 1:
        return tuple(volume * U[v] for v in static_range(VARIABLES))
    else:
        e1, e2 = phase_energies(primitives(U))
        return (*(volume * U[v] for v in static_range(VARIABLES)), volume * e1, volume * e2)


def stage_content(U_n, U, v_n, v, D, freed, b, dt):
    """Content after a stage of a cell that held U_n in v_n before the step and holds U in v now.

    D: dt times the divergence of the fluxes through the open parts of its faces, the wall's included; freed: the part
    of the cell that the wall has freed.
    """
    Q_n, Q = with_energies(U_n, v_n), with_energies(U, v)
    rho = sum(Q[k] for k in static_range(PHASES))
    force = tuple(dt * (BODY_FORCE[d] * rho) for d in static_range(DIMENSIONS))
    work = dt * sum(BODY_FORCE[d] * Q[PHASES + d] for d in static_range(DIMENSIONS))
    E = PHASES + DIMENSIONS
    transported = (
        *(Q_n[k] + b * (Q[k] - D[k] - Q_n[k]) for k in static_range(PHASES)),
        *(
            Q_n[PHASES + d] + b * (Q[PHASES + d] - D[PHASES + d] + force[d] - Q_n[PHASES + d])
            for d in static_range(DIMENSIONS)
        ),
        Q_n[E] + b * (Q[E] - D[E] + work - Q_n[E]),
    )
    if PHASES == 1:
        return transported
    else:
        growth_of_volume = D[VARIABLES + 2] + freed
        W = primitives(U)
        a1, p = W[3 + DIMENSIONS], W[2 + DIMENSIONS]
        w1, w2 = a1 * p * growth_of_volume, (1.0 - a1) * p * growth_of_volume
        return (
            *(transported[k] for k in static_range(E + 1)),
            Q_n[E + 1] + b * (Q[E + 1] - D[E + 1] + a1 * growth_of_volume - Q_n[E + 1]),
            *(Q_n[v] + b * (Q[v] - D[v] - Q_n[v]) for v in static_range(E + 2, VARIABLES)),
            Q_n[VARIABLES] + b * (Q[VARIABLES] - D[VARIABLES] - w1 - Q_n[VARIABLES]),
            Q_n[VARIABLES + 1] + b * (Q[VARIABLES + 1] - D[VARIABLES + 1] - w2 - Q_n[VARIABLES + 1]),
        )


def state_before_relaxation(Q, volume):
    """State of a content that fills `volume`, and where both phases stand (relaxation.py)."""
    U = tuple(Q[v] / volume for v in static_range(VARIABLES))
    a1 = min(max(U[3 + DIMENSIONS], MINIMUM_FRACTION), 1.0 - MINIMUM_FRACTION)
    a2 = 1.0 - a1
    W = primitives(
        (
            *(U[v] for v in static_range(3 + DIMENSIONS)),
            a1,
            *(U[v] for v in static_range(4 + DIMENSIONS, VARIABLES)),
        )
    )
    p = W[2 + DIMENSIONS]
    ref1, slope1 = reference_1(W[0])
    ref2, slope2 = reference_2(W[1])
    omega1, omega_slope1 = grueneisen_1(W[0])
    omega2, omega_slope2 = grueneisen_2(W[1])
    excess1 = omega1 * (Q[VARIABLES] / volume) - a1 * (p - ref1)
    excess2 = omega2 * (Q[VARIABLES + 1] / volume) - a2 * (p - ref2)
    return (U, phases_before(p, a1, 0.0, U[0], U[1], ref1, ref2, excess1, excess2))


def state_of(Q, volume):
    """State of a content that fills `volume`; two phases relax to one pressure, unless what follows is negative."""
    if PHASES == 1:
        return (*(Q[v] / volume for v in static_range(VARIABLES)), 0.0)
    else:
        U, phases = state_before_relaxation(Q, volume)
        change, settled = relaxed_fraction_change(phases)
        a1 = min(max(phases[1] + change, MINIMUM_FRACTION), 1.0 - MINIMUM_FRACTION)
        return (
            *(U[v] for v in static_range(3 + DIMENSIONS)),
            a1,
            *(U[v] for v in static_range(4 + DIMENSIONS, VARIABLES)),
            settled,
        )


def normal_of(area):
    """Unit vector along an area vector, and its length."""
    size = sqrt(dot(area, area))
    return (size, tuple(area[d] / max(size, 1e-300) for d in static_range(DIMENSIONS)))
