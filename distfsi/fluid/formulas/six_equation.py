"""The six-equation model of two compressible materials with one velocity and, after relaxation, one pressure.

Stored state U = (a1 rho1, a2 rho2, rho u (DIMENSIONS), rho E, a1); primitive state W = (rho1, rho2, u (DIMENSIONS), p,
a1). Behind them may stand shares that a phase carries along, in U times its mass, in W alone; each holds back an energy
from the pressure (fluid/reactions.py). Phase energies live inside a stage and are reset from rho E (Saurel, Petitpas,
Berry, J. Comput. Phys. 228, 2009; paper, Eqs. 9-30). At faces the velocity components are rotated so that the normal
one comes first.
"""

from math import sqrt

from distfsi.fluid.formulas.phases import fractions, in_bounds
from distfsi.fluid.formulas.relaxation import phases_before, relaxed_fraction_change
from distfsi.fluid.formulas.riemann import contact_speed
from distfsi.fluid.formulas.stiffness import held_compression_1, held_compression_2, weight_1, weight_2
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    BODY_FORCE,
    CARRIED,
    CARRIER,
    CLOSED_FORM,
    DIMENSIONS,
    FLUXES,
    HELD_ENERGY,
    MINIMUM_FRACTION,
    PHASES,
    VARIABLES,
    bounding_speeds,
    contact_jump_diffusion,
    grueneisen_1,
    grueneisen_2,
    reference_1,
    reference_2,
    slip_viscosity,
    state_behind_wave,
    stored_reference_1,
    stored_reference_2,
)


def primitives(U):
    """Primitive state of a relaxed conserved one; the pressure from the total energy (paper, Eq. 29)."""
    a1 = U[3 + DIMENSIONS]
    a2 = 1.0 - a1
    rho1 = U[0] / a1
    rho2 = U[1] / a2
    rho = U[0] + U[1]
    velocity = tuple(U[2 + d] / rho for d in static_range(DIMENSIONS))
    kinetic = 0.5 * sum(U[2 + d] * velocity[d] for d in static_range(DIMENSIONS))
    reference1, slope1 = stored_reference_1(rho1)
    reference2, slope2 = stored_reference_2(rho2)
    omega1, omega_slope1 = grueneisen_1(rho1)
    omega2, omega_slope2 = grueneisen_2(rho2)
    held = sum(HELD_ENERGY[n] * U[4 + DIMENSIONS + n] for n in static_range(CARRIED))
    energy = U[2 + DIMENSIONS] - held - kinetic + a1 * (reference1 / omega1) + a2 * (reference2 / omega2)
    p = energy / (a1 * (1.0 / omega1) + a2 * (1.0 / omega2))
    return (
        rho1,
        rho2,
        *(velocity[d] for d in static_range(DIMENSIONS)),
        p,
        a1,
        *(U[v] / U[CARRIER] for v in static_range(4 + DIMENSIONS, VARIABLES)),
    )


def conserved(W):
    """Stored state of a primitive one."""
    a1 = W[3 + DIMENSIONS]
    m1 = a1 * W[0]
    m2 = (1.0 - a1) * W[1]
    return (
        m1,
        m2,
        *((m1 + m2) * W[2 + d] for d in static_range(DIMENSIONS)),
        total_energy(W),
        a1,
        *((m1 if CARRIER == 0 else m2) * W[v] for v in static_range(4 + DIMENSIONS, VARIABLES)),
    )


def total_energy(W):
    """rho E [J/m3]."""
    a1 = W[3 + DIMENSIONS]
    a2 = 1.0 - a1
    p = W[2 + DIMENSIONS]
    reference1, slope1 = stored_reference_1(W[0])
    reference2, slope2 = stored_reference_2(W[1])
    omega1, omega_slope1 = grueneisen_1(W[0])
    omega2, omega_slope2 = grueneisen_2(W[1])
    internal = a1 * ((p - reference1) / omega1) + a2 * ((p - reference2) / omega2)
    squared = sum(W[2 + d] * W[2 + d] for d in static_range(DIMENSIONS))
    held = sum(
        HELD_ENERGY[n] * ((a1 * W[0] if CARRIER == 0 else a2 * W[1]) * W[4 + DIMENSIONS + n])
        for n in static_range(CARRIED)
    )
    return internal + 0.5 * (a1 * W[0] + a2 * W[1]) * squared + held


def phase_energies(W):
    """alpha_k rho_k e_k [J/m3] of both phases."""
    a1, p = W[3 + DIMENSIONS], W[2 + DIMENSIONS]
    ref1, slope1 = reference_1(W[0])
    ref2, slope2 = reference_2(W[1])
    omega1, omega_slope1 = grueneisen_1(W[0])
    omega2, omega_slope2 = grueneisen_2(W[1])
    return (a1 * ((p - ref1) * (1.0 / omega1)), (1.0 - a1) * ((p - ref2) * (1.0 / omega2)))


def bulk_modulus(W):
    """rho c^2 [Pa] of the frozen mixture: a1 rho1 c1^2 + a2 rho2 c2^2 (paper, Eqs. 22, 23)."""
    a1 = W[3 + DIMENSIONS]
    a2 = 1.0 - a1
    p = W[2 + DIMENSIONS]
    reference1, slope1 = reference_1(W[0])
    reference2, slope2 = reference_2(W[1])
    omega1, omega_slope1 = grueneisen_1(W[0])
    omega2, omega_slope2 = grueneisen_2(W[1])
    bulk1 = W[0] * slope1 + weight_1(W[0]) * (p - reference1) + omega1 * p
    bulk2 = W[1] * slope2 + weight_2(W[1]) * (p - reference2) + omega2 * p
    return a1 * bulk1 + a2 * bulk2


def sound_speed(W):
    """Frozen speed of sound c^2 = Y1 c1^2 + Y2 c2^2 (paper, Eq. 22)."""
    return sqrt(bulk_modulus(W) / mixture_density(W))


def mixture_density(W):
    """rho = sum a_k rho_k [kg/m3]."""
    if PHASES == 2:
        return W[3 + DIMENSIONS] * W[0] + (1.0 - W[3 + DIMENSIONS]) * W[1]
    else:
        a = fractions(W)
        return sum(a[k] * W[k] for k in static_range(PHASES))


def energy_behind_wave(p, chi, excess, reference_behind, omega):
    """rho e of one phase behind a wave that compresses it by chi: the phase's own Hugoniot (in place of Eq. 27).

    excess: omega rho e in front of the wave, with the omega behind it. The pressure grows without bound at the limiting
    compression; beyond 0.9 of it the denominator is held.
    """
    y = 1.0 / chi
    growth = max(y - 0.5 * omega * (1.0 - y), 0.1 * y)
    p_behind = (excess + reference_behind * y + 0.5 * omega * p * (1.0 - y)) / growth
    return (p_behind - reference_behind) / omega


def behind_wave(W, s, u_face):
    """All that is transported, per volume, behind a wave of speed s that changes the normal velocity to u_face.

    The stored state, both phase energies, and 1 for the volume itself.
    """
    a1, u, p = W[3 + DIMENSIONS], W[2], W[2 + DIMENSIONS]
    a2 = 1.0 - a1
    rho = a1 * W[0] + a2 * W[1]
    chi = (s - u) / (s - u_face)  # compression; 1 if no wave passes
    energy = chi * (total_energy(W) + (u_face - u) * (rho * u_face + p / (s - u)))
    chi1, chi2 = held_compression_1(chi, W[0]), held_compression_2(chi, W[1])
    before1, slope1 = reference_1(W[0])
    before2, slope2 = reference_2(W[1])
    behind1, slope1b = reference_1(chi1 * W[0])
    behind2, slope2b = reference_2(chi2 * W[1])
    omega1, omega_slope1 = grueneisen_1(W[0])
    omega2, omega_slope2 = grueneisen_2(W[1])
    omega1b, omega_slope1b = grueneisen_1(chi1 * W[0])
    omega2b, omega_slope2b = grueneisen_2(chi2 * W[1])
    mass1, mass2 = a1 * (chi * W[0]), a2 * (chi * W[1])
    mass = mass1 + mass2
    return (
        mass1,
        mass2,
        mass * u_face,
        *(mass * W[2 + d] for d in static_range(1, DIMENSIONS)),
        energy,
        a1,
        *((mass1 if CARRIER == 0 else mass2) * W[v] for v in static_range(4 + DIMENSIONS, VARIABLES)),
        a1 * energy_behind_wave(p, chi1, omega1b / omega1 * (p - before1), behind1, omega1b),
        a2 * energy_behind_wave(p, chi2, omega2b / omega2 * (p - before2), behind2, omega2b),
        1.0,
    )


def face_flux(left, right, jump):
    """Fluxes of U (normal momentum first), of the phase energies, and the face velocity (paper, Eqs. 17-27); in the
    five-equation model without phase energies. Of any number of phases.

    Everything is smeared alike (fluid/formulas/riemann.py), so that pressure and velocity stay uniform across an
    interface. jump [Pa]: the largest pressure difference along the face.
    """
    if PHASES > 2:
        return flux_between(in_bounds(left), in_bounds(right), jump)
    else:
        return flux_between(left, right, jump)


def flux_between(left, right, jump):
    """The flux between states whose volume fractions are within their bounds."""
    rho_l, u_l, p_l, c_l = mixture_density(left), left[PHASES], left[PHASES + DIMENSIONS], sound_speed(left)
    rho_r, u_r, p_r, c_r = mixture_density(right), right[PHASES], right[PHASES + DIMENSIONS], sound_speed(right)
    s_l, s_r = bounding_speeds(rho_l, u_l, c_l, rho_r, u_r, c_r)
    s_star = contact_speed(rho_l, u_l, p_l, s_l, rho_r, u_r, p_r, s_r)

    from_left = s_star >= 0.0
    W = tuple(left[v] if from_left else right[v] for v in static_range(VARIABLES))
    there = tuple(right[v] if from_left else left[v] for v in static_range(VARIABLES))
    rho = rho_l if from_left else rho_r
    s, s_there = s_l if from_left else s_r, s_r if from_left else s_l
    subsonic = s_l < 0.0 if from_left else s_r > 0.0
    u, p = W[PHASES], W[PHASES + DIMENSIONS]
    u_face = s_star if subsonic else u
    p_face = p + rho * (s - u) * (u_face - u)
    U, U_there = state_behind_wave(W, s, u_face), state_behind_wave(there, s_there, s_star)

    reach = s if subsonic else 0.0
    kappa = contact_jump_diffusion(reach, s_there, s_star)
    bulk = min(rho_l * (c_l * c_l), rho_r * (c_r * c_r))
    viscosity = slip_viscosity(rho_l * (s_l - u_l), rho_r * (s_r - u_r), jump, bulk)
    F = tuple(U[v] * u_face - kappa * (U_there[v] - U[v]) for v in static_range(FLUXES))
    slip = tuple(right[PHASES + d] - left[PHASES + d] for d in static_range(DIMENSIONS))
    work = 0.5 * sum(slip[d] * (right[PHASES + d] + left[PHASES + d]) for d in static_range(1, DIMENSIONS))
    return (
        *(F[k] for k in static_range(PHASES)),
        F[PHASES] + p_face,
        *(F[PHASES + d] - viscosity * slip[d] for d in static_range(1, DIMENSIONS)),
        F[PHASES + DIMENSIONS] + p_face * u_face - viscosity * work,
        *(F[v] for v in static_range(PHASES + DIMENSIONS + 1, FLUXES)),
    )


def updated_conserved(U_n, U, D, b, dt):
    """U_n + b (U - D + dt S - U_n) of masses, momentum and total energy; S is the body force and its work."""
    E = PHASES + DIMENSIONS
    rho = sum(U[k] for k in static_range(PHASES))
    work = sum(BODY_FORCE[d] * U[PHASES + d] for d in static_range(DIMENSIONS))
    return (
        *(U_n[k] + b * (U[k] - D[k] - U_n[k]) for k in static_range(PHASES)),
        *(
            U_n[PHASES + d] + b * (U[PHASES + d] - D[PHASES + d] + dt * (BODY_FORCE[d] * rho) - U_n[PHASES + d])
            for d in static_range(DIMENSIONS)
        ),
        U_n[E] + b * (U[E] - D[E] + dt * work - U_n[E]),
    )


def before_relaxation(U_n, U, W, D, b, dt):
    """Where both phases stand after a stage (relaxation.py), and by how much transport has changed a1.

    Phase energies obey the paper's Eq. 15 (sign corrected); rho E is the conserved energy, from which they are reset
    (Eq. 30).
    """
    W_n = primitives(U_n)
    p_n, a1_n = W_n[2 + DIMENSIONS], U_n[3 + DIMENSIONS]
    p, a1 = W[2 + DIMENSIONS], W[3 + DIMENSIONS]
    a2_n, a2, du = 1.0 - a1_n, 1.0 - a1, D[VARIABLES + 2]

    m1, m2 = tuple(U_n[k] + b * (U[k] - D[k] - U_n[k]) for k in static_range(2))
    da = b * (a1 - D[3 + DIMENSIONS] + a1 * du - a1_n)
    da = min(max(da, MINIMUM_FRACTION - a1_n), (1.0 - MINIMUM_FRACTION) - a1_n)
    reference1_n, slope1_n = reference_1(W_n[0])
    reference2_n, slope2_n = reference_2(W_n[1])
    reference1, slope1 = reference_1(W[0])
    reference2, slope2 = reference_2(W[1])
    omega1_n, omega_slope1_n = grueneisen_1(W_n[0])
    omega2_n, omega_slope2_n = grueneisen_2(W_n[1])
    omega1, omega_slope1 = grueneisen_1(W[0])
    omega2, omega_slope2 = grueneisen_2(W[1])
    e1_n, e1 = a1_n * ((p_n - reference1_n) / omega1_n), a1 * ((p - reference1) / omega1)
    e2_n, e2 = a2_n * ((p_n - reference2_n) / omega2_n), a2 * ((p - reference2) / omega2)
    de1 = b * (e1 - D[VARIABLES] + a1 * p * -du - e1_n)
    de2 = b * (e2 - D[VARIABLES + 1] + a2 * p * -du - e2_n)
    omega1_new, omega_slope1_new = grueneisen_1(m1 / (a1_n + da))
    omega2_new, omega_slope2_new = grueneisen_2(m2 / (1.0 - (a1_n + da)))
    we1 = omega1_new * de1 + (omega1_new / omega1_n - 1.0) * (a1_n * (p_n - reference1_n))
    we2 = omega2_new * de2 + (omega2_new / omega2_n - 1.0) * (a2_n * (p_n - reference2_n))
    phases = phases_before(p_n, a1_n + da, da, m1, m2, reference1_n, reference2_n, we1, we2)
    return (phases, da)


def fraction_after(U_n, change):
    """a1 after its change in a stage."""
    return min(max(U_n[3 + DIMENSIONS] + change, MINIMUM_FRACTION), 1.0 - MINIMUM_FRACTION)


def updated(U_n, U, W, D, b, dt):
    """One stage of SSP-RK3: U_n + b (U - D + dt S - U_n), then a1 moves until both phases share a pressure; with JWL a
    value behind the state that is negative where they do not yet.

    D is dt times the divergence of the fluxes. Everything is written as a change of U_n, so that a uniform state stays
    as it is to the bit.
    """
    phases, da = before_relaxation(U_n, U, W, D, b, dt)
    relaxed, settled = relaxed_fraction_change(phases)
    new = updated_conserved(U_n, U, D, b, dt)
    state = (
        *(new[v] for v in static_range(3 + DIMENSIONS)),
        fraction_after(U_n, da + relaxed),
        *(U_n[v] + b * (U[v] - D[v] - U_n[v]) for v in static_range(4 + DIMENSIONS, VARIABLES)),
    )
    if CLOSED_FORM:
        return state
    else:
        return (*(state[v] for v in static_range(VARIABLES)), settled)
