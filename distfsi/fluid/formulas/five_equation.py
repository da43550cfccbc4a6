"""The five-equation model of two compressible materials with one velocity and one pressure all the time.

Stored and primitive states, pressure and flux are those of the six-equation model (six_equation.py); there are no phase
energies and there is no relaxation. The volume fraction is carried along, Da1/Dt = 0 (Allaire, Clerc, Kokh, J. Comput.
Phys. 181, 2002). The term K div u of Kapila et al. (Phys. Fluids 13, 2001) would let compression change it, as the
relaxation of the six-equation model does; taken explicitly it doubles the errors of a tube of water and air and ends in
invalid states, so it is left out: this model is for materials that do not mix.
"""

from math import sqrt

from distfsi.fluid.formulas.six_equation import (
    conserved,
    face_flux,
    mixture_density,
    primitives,
    total_energy,
    updated_conserved,
)
from distfsi.fluid.formulas.stiffness import weight_1, weight_2
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    CARRIER,
    DIMENSIONS,
    FLUXES,
    MINIMUM_FRACTION,
    VARIABLES,
    grueneisen_1,
    grueneisen_2,
    reference_1,
    reference_2,
)

__all__ = ["behind_wave", "bulk_modulus", "conserved", "face_flux", "primitives", "sound_speed", "updated"]


def bulk_modulus(W):
    """rho c^2 [Pa]: the mean of the phases' rho_k c_k^2 weighted with a_k/omega_k."""
    p = W[2 + DIMENSIONS]
    reference1, slope1 = reference_1(W[0])
    reference2, slope2 = reference_2(W[1])
    omega1, omega_slope1 = grueneisen_1(W[0])
    omega2, omega_slope2 = grueneisen_2(W[1])
    bulk1 = W[0] * slope1 + weight_1(W[0]) * (p - reference1) + omega1 * p
    bulk2 = W[1] * slope2 + weight_2(W[1]) * (p - reference2) + omega2 * p
    share1, share2 = W[3 + DIMENSIONS] * (1.0 / omega1), (1.0 - W[3 + DIMENSIONS]) * (1.0 / omega2)
    return (share1 * bulk1 + share2 * bulk2) / (share1 + share2)


def sound_speed(W):
    """Speed of sound [m/s]."""
    return sqrt(bulk_modulus(W) / mixture_density(W))


def behind_wave(W, s, u_face):
    """All that is transported, per volume, behind a wave of speed s that changes the normal velocity to u_face.

    The stored state, and 1 for the volume itself.
    """
    a1, u, p = W[3 + DIMENSIONS], W[2], W[2 + DIMENSIONS]
    rho = mixture_density(W)
    chi = (s - u) / (s - u_face)  # compression; 1 if no wave passes
    energy = chi * (total_energy(W) + (u_face - u) * (rho * u_face + p / (s - u)))
    mass = chi * rho
    return (
        chi * (a1 * W[0]),
        chi * ((1.0 - a1) * W[1]),
        mass * u_face,
        *(mass * W[2 + d] for d in static_range(1, DIMENSIONS)),
        energy,
        a1,
        *(
            chi * ((a1 * W[0] if CARRIER == 0 else (1.0 - a1) * W[1]) * W[v])
            for v in static_range(4 + DIMENSIONS, VARIABLES)
        ),
        1.0,
    )


def updated(U_n, U, W, D, b, dt):
    """One stage of SSP-RK3: U_n + b (U - D + dt S - U_n), written as a change of U_n (six_equation.py)."""
    a1, a1_n = W[3 + DIMENSIONS], U_n[3 + DIMENSIONS]
    change = b * (a1 - D[3 + DIMENSIONS] + a1 * D[FLUXES - 1] - a1_n)
    a1_new = min(max(a1_n + change, MINIMUM_FRACTION), 1.0 - MINIMUM_FRACTION)
    new = updated_conserved(U_n, U, D, b, dt)
    return (
        *(new[v] for v in static_range(3 + DIMENSIONS)),
        a1_new,
        *(U_n[v] + b * (U[v] - D[v] - U_n[v]) for v in static_range(4 + DIMENSIONS, VARIABLES)),
    )
