"""The five-equation model (five_equation.py) of three to five materials, with the states of six_equation_many.py."""

from math import sqrt

from distfsi.fluid.formulas.phases import fractions, omegas
from distfsi.fluid.formulas.six_equation import face_flux, mixture_density, updated_conserved
from distfsi.fluid.formulas.six_equation_many import (
    bulk_moduli,
    conserved,
    fractions_after,
    primitives,
    total_energy,
)
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, FLUXES, PHASES

__all__ = ["behind_wave", "bulk_modulus", "conserved", "face_flux", "primitives", "sound_speed", "updated"]


def bulk_modulus(W):
    """rho c^2 [Pa]: the mean of the phases' rho_k c_k^2 weighted with a_k/omega_k."""
    a, bulk = fractions(W), bulk_moduli(W)
    omega = omegas(tuple(W[k] for k in static_range(PHASES)))
    share = tuple(a[k] * (1.0 / omega[k]) for k in static_range(PHASES))
    return sum(share[k] * bulk[k] for k in static_range(PHASES)) / sum(share[k] for k in static_range(PHASES))


def sound_speed(W):
    """Speed of sound [m/s]."""
    return sqrt(bulk_modulus(W) / mixture_density(W))


def behind_wave(W, s, u_face):
    """All that is transported, per volume, behind a wave of speed s that changes the normal velocity to u_face.

    The stored state, and 1 for the volume itself.
    """
    a, u, p = fractions(W), W[PHASES], W[PHASES + DIMENSIONS]
    rho = mixture_density(W)
    chi = (s - u) / (s - u_face)  # compression; 1 if no wave passes
    energy = chi * (total_energy(W) + (u_face - u) * (rho * u_face + p / (s - u)))
    mass = chi * rho
    return (
        *(chi * (a[k] * W[k]) for k in static_range(PHASES)),
        mass * u_face,
        *(mass * W[PHASES + d] for d in static_range(1, DIMENSIONS)),
        energy,
        *(a[k] for k in static_range(PHASES - 1)),
        1.0,
    )


def updated(U_n, U, W, D, b, dt):
    """One stage of SSP-RK3: U_n + b (U - D + dt S - U_n), written as a change of U_n."""
    a_n, a, du = fractions(U_n), fractions(W), D[FLUXES - 1]
    changes = tuple(b * (a[k] - D[PHASES + DIMENSIONS + 1 + k] + a[k] * du - a_n[k]) for k in static_range(PHASES - 1))
    new, fractions_new = updated_conserved(U_n, U, D, b, dt), fractions_after(U_n, changes)
    return (
        *(new[v] for v in static_range(PHASES + DIMENSIONS + 1)),
        *(fractions_new[k] for k in static_range(PHASES - 1)),
    )
