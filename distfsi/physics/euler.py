"""Compressible Euler equations of one material.

Conserved state U = (rho, rho u (DIMENSIONS), rho E); primitive state W = (rho, u (DIMENSIONS), p).
At faces the velocity components are rotated so that the normal one comes first.
"""

from math import sqrt

from distfsi.physics.riemann import contact_speed, einfeldt_speeds
from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS, GRAVITY, OMEGA_1, reference_1


def primitives(U):
    """Primitive state of a conserved one."""
    rho = U[0]
    velocity = tuple(U[1 + d] / rho for d in static_range(DIMENSIONS))
    kinetic = 0.5 * sum(U[1 + d] * velocity[d] for d in static_range(DIMENSIONS))
    reference, slope = reference_1(rho)
    p = OMEGA_1 * (U[1 + DIMENSIONS] - kinetic) + reference
    return (rho, *(velocity[d] for d in static_range(DIMENSIONS)), p)


def conserved(W):
    """Conserved state of a primitive one."""
    return (W[0], *(W[0] * W[1 + d] for d in static_range(DIMENSIONS)), total_energy(W))


def total_energy(W):
    """rho E [J/m3]."""
    reference, slope = reference_1(W[0])
    kinetic = 0.5 * W[0] * sum(W[1 + d] * W[1 + d] for d in static_range(DIMENSIONS))
    return (W[1 + DIMENSIONS] - reference) / OMEGA_1 + kinetic


def sound_speed(W):
    """c^2 = d reference/d rho + (p - reference)/rho + omega p/rho (paper, Eq. 23)."""
    reference, slope = reference_1(W[0])
    p = W[1 + DIMENSIONS]
    return sqrt(slope + (p - reference + OMEGA_1 * p) / W[0])


def face_flux(left, right):
    """HLLC flux of (rho, rho u, rho E), normal momentum first (paper, Eqs. 17-21 with Einfeldt's speeds)."""
    rho_l, u_l, p_l = left[0], left[1], left[1 + DIMENSIONS]
    rho_r, u_r, p_r = right[0], right[1], right[1 + DIMENSIONS]
    s_l, s_r = einfeldt_speeds(rho_l, u_l, sound_speed(left), rho_r, u_r, sound_speed(right))
    s_star = contact_speed(rho_l, u_l, p_l, s_l, rho_r, u_r, p_r, s_r)

    from_left = s_star >= 0.0
    W = tuple(left[v] if from_left else right[v] for v in static_range(DIMENSIONS + 2))
    s = s_l if from_left else s_r
    subsonic = s_l < 0.0 if from_left else s_r > 0.0
    rho, u, p = W[0], W[1], W[1 + DIMENSIONS]
    u_face = s_star if subsonic else u
    chi = (s - u) / (s - u_face)  # compression by the wave that reaches the face; 1 if none does
    p_face = p + rho * (s - u) * (u_face - u)
    energy = chi * (total_energy(W) + (u_face - u) * (rho * u_face + p / (s - u)))
    mass = chi * rho * u_face
    return (
        mass,
        mass * u_face + p_face,
        *(mass * W[1 + d] for d in static_range(1, DIMENSIONS)),
        (energy + p_face) * u_face,
    )


def updated(U_n, U, W, D, b, dt):
    """U_n + b (U - D + dt S - U_n): one stage of SSP-RK3 (paper, Eq. 16).

    D is dt times the flux divergence, S the body force and its work. Written so that a uniform state stays as it is to
    the bit.
    """
    rho = U[0]
    work = sum(GRAVITY[d] * U[1 + d] for d in static_range(DIMENSIONS))
    return (
        U_n[0] + b * (U[0] - D[0] - U_n[0]),
        *(
            U_n[1 + d] + b * (U[1 + d] - D[1 + d] + dt * (GRAVITY[d] * rho) - U_n[1 + d])
            for d in static_range(DIMENSIONS)
        ),
        U_n[1 + DIMENSIONS] + b * (U[1 + DIMENSIONS] - D[1 + DIMENSIONS] + dt * work - U_n[1 + DIMENSIONS]),
    )
