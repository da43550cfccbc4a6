"""Compressible Euler equations of one material.

Conserved state U = (rho, rho u (DIMENSIONS), rho E); primitive state W = (rho, u (DIMENSIONS), p).
At faces the velocity components are rotated so that the normal one comes first.
"""

from math import sqrt

from distfsi.fluid.formulas.riemann import contact_speed
from distfsi.fluid.formulas.stiffness import weight_1
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    BODY_FORCE,
    DIMENSIONS,
    VARIABLES,
    bounding_speeds,
    contact_jump_diffusion,
    grueneisen_1,
    reference_1,
    slip_viscosity,
    stored_reference_1,
)


def primitives(U):
    """Primitive state of a conserved one."""
    rho = U[0]
    velocity = tuple(U[1 + d] / rho for d in static_range(DIMENSIONS))
    kinetic = 0.5 * sum(U[1 + d] * velocity[d] for d in static_range(DIMENSIONS))
    reference, slope = stored_reference_1(rho)
    omega, omega_slope = grueneisen_1(rho)
    p = omega * (U[1 + DIMENSIONS] - kinetic) + reference
    return (rho, *(velocity[d] for d in static_range(DIMENSIONS)), p)


def conserved(W):
    """Conserved state of a primitive one."""
    return (W[0], *(W[0] * W[1 + d] for d in static_range(DIMENSIONS)), total_energy(W))


def total_energy(W):
    """rho E [J/m3]."""
    reference, slope = stored_reference_1(W[0])
    omega, omega_slope = grueneisen_1(W[0])
    kinetic = 0.5 * W[0] * sum(W[1 + d] * W[1 + d] for d in static_range(DIMENSIONS))
    return (W[1 + DIMENSIONS] - reference) / omega + kinetic


def bulk_modulus(W):
    """rho c^2 [Pa] (paper, Eq. 23; stiffness.py)."""
    reference, slope = reference_1(W[0])
    omega, omega_slope = grueneisen_1(W[0])
    p = W[1 + DIMENSIONS]
    return W[0] * slope + (weight_1(W[0]) * (p - reference) + omega * p)


def sound_speed(W):
    """Speed of sound [m/s]."""
    return sqrt(bulk_modulus(W) / W[0])


def behind_wave(W, s, u_face):
    """The conserved state that a wave of speed s leaves behind when it changes the normal velocity to u_face."""
    rho, u, p = W[0], W[1], W[1 + DIMENSIONS]
    chi = (s - u) / (s - u_face)  # compression; 1 if no wave passes
    mass = chi * rho
    energy = chi * (total_energy(W) + (u_face - u) * (rho * u_face + p / (s - u)))
    return (mass, mass * u_face, *(mass * W[1 + d] for d in static_range(1, DIMENSIONS)), energy)


def face_flux(left, right, jump):
    """Flux of (rho, rho u, rho E), normal momentum first (paper, Eqs. 17-21; fluid/formulas/riemann.py).

    jump [Pa]: the largest pressure difference along the face.
    """
    rho_l, u_l, p_l, c_l = left[0], left[1], left[1 + DIMENSIONS], sound_speed(left)
    rho_r, u_r, p_r, c_r = right[0], right[1], right[1 + DIMENSIONS], sound_speed(right)
    s_l, s_r = bounding_speeds(rho_l, u_l, c_l, rho_r, u_r, c_r)
    s_star = contact_speed(rho_l, u_l, p_l, s_l, rho_r, u_r, p_r, s_r)

    from_left = s_star >= 0.0
    W = tuple(left[v] if from_left else right[v] for v in static_range(VARIABLES))
    there = tuple(right[v] if from_left else left[v] for v in static_range(VARIABLES))
    s, s_there = s_l if from_left else s_r, s_r if from_left else s_l
    subsonic = s_l < 0.0 if from_left else s_r > 0.0
    rho, u, p = W[0], W[1], W[1 + DIMENSIONS]
    u_face = s_star if subsonic else u
    p_face = p + rho * (s - u) * (u_face - u)
    U, U_there = behind_wave(W, s, u_face), behind_wave(there, s_there, s_star)

    reach = s if subsonic else 0.0
    kappa = contact_jump_diffusion(reach, s_there, s_star)
    bulk = min(rho_l * (c_l * c_l), rho_r * (c_r * c_r))
    viscosity = slip_viscosity(rho_l * (s_l - u_l), rho_r * (s_r - u_r), jump, bulk)
    F = tuple(U[v] * u_face - kappa * (U_there[v] - U[v]) for v in static_range(VARIABLES))
    slip = tuple(right[1 + d] - left[1 + d] for d in static_range(DIMENSIONS))
    work = 0.5 * sum(slip[d] * (right[1 + d] + left[1 + d]) for d in static_range(1, DIMENSIONS))
    return (
        F[0],
        F[1] + p_face,
        *(F[1 + d] - viscosity * slip[d] for d in static_range(1, DIMENSIONS)),
        F[1 + DIMENSIONS] + p_face * u_face - viscosity * work,
    )


def updated(U_n, U, W, D, b, dt):
    """U_n + b (U - D + dt S - U_n): one stage of SSP-RK3 (paper, Eq. 16).

    D is dt times the flux divergence, S the body force and its work. Written so that a uniform state stays as it is to
    the bit.
    """
    rho = U[0]
    work = sum(BODY_FORCE[d] * U[1 + d] for d in static_range(DIMENSIONS))
    return (
        U_n[0] + b * (U[0] - D[0] - U_n[0]),
        *(
            U_n[1 + d] + b * (U[1 + d] - D[1 + d] + dt * (BODY_FORCE[d] * rho) - U_n[1 + d])
            for d in static_range(DIMENSIONS)
        ),
        U_n[1 + DIMENSIONS] + b * (U[1 + DIMENSIONS] - D[1 + DIMENSIONS] + dt * work - U_n[1 + DIMENSIONS]),
    )
