"""The six-equation model of three to five materials: one velocity and, after relaxation, one pressure.

Stored state U = (a_k rho_k of N phases, rho u (DIMENSIONS), rho E, a_k of all but the last); primitive state W =
(rho_k, u (DIMENSIONS), p, a_k). Everything else is that of two materials (six_equation.py), with sums over phases.
"""

from math import sqrt

from distfsi.fluid.formulas.phases import bounded, fractions, omegas, references, stored_references, weights
from distfsi.fluid.formulas.relaxation_many import phases_before, relaxed_changes
from distfsi.fluid.formulas.six_equation import energy_behind_wave, face_flux, mixture_density, updated_conserved
from distfsi.fluid.formulas.stiffness import ROOM
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, FLUXES, PHASES, VARIABLES

__all__ = [
    "before_relaxation",
    "behind_wave",
    "bulk_modulus",
    "conserved",
    "face_flux",
    "fractions_after",
    "primitives",
    "sound_speed",
    "updated",
]


def primitives(U):
    """Primitive state of a relaxed conserved one; the pressure from the total energy (paper, Eq. 29)."""
    a = fractions(U)
    densities = tuple(U[k] / a[k] for k in static_range(PHASES))
    rho = sum(U[k] for k in static_range(PHASES))
    velocity = tuple(U[PHASES + d] / rho for d in static_range(DIMENSIONS))
    kinetic = 0.5 * sum(U[PHASES + d] * velocity[d] for d in static_range(DIMENSIONS))
    reference = stored_references(densities)
    omega = omegas(densities)
    stiff = sum(a[k] * (reference[k][0] / omega[k]) for k in static_range(PHASES))
    p = (U[PHASES + DIMENSIONS] - kinetic + stiff) / sum(a[k] * (1.0 / omega[k]) for k in static_range(PHASES))
    return (
        *(densities[k] for k in static_range(PHASES)),
        *(velocity[d] for d in static_range(DIMENSIONS)),
        p,
        *(a[k] for k in static_range(PHASES - 1)),
    )


def conserved(W):
    """Stored state of a primitive one."""
    a = fractions(W)
    masses = tuple(a[k] * W[k] for k in static_range(PHASES))
    rho = sum(masses[k] for k in static_range(PHASES))
    return (
        *(masses[k] for k in static_range(PHASES)),
        *(rho * W[PHASES + d] for d in static_range(DIMENSIONS)),
        total_energy(W),
        *(a[k] for k in static_range(PHASES - 1)),
    )


def total_energy(W):
    """rho E [J/m3]."""
    a, p = fractions(W), W[PHASES + DIMENSIONS]
    densities = tuple(W[k] for k in static_range(PHASES))
    reference = stored_references(densities)
    omega = omegas(densities)
    internal = sum(a[k] * ((p - reference[k][0]) / omega[k]) for k in static_range(PHASES))
    squared = sum(W[PHASES + d] * W[PHASES + d] for d in static_range(DIMENSIONS))
    return internal + 0.5 * mixture_density(W) * squared


def phase_energies(W):
    """a_k rho_k e_k [J/m3] of each phase."""
    a, p = fractions(W), W[PHASES + DIMENSIONS]
    densities = tuple(W[k] for k in static_range(PHASES))
    reference = references(densities)
    omega = omegas(densities)
    return tuple(a[k] * ((p - reference[k][0]) * (1.0 / omega[k])) for k in static_range(PHASES))


def bulk_moduli(W):
    """rho_k c_k^2 [Pa] of each phase."""
    p = W[PHASES + DIMENSIONS]
    densities = tuple(W[k] for k in static_range(PHASES))
    reference = references(densities)
    omega = omegas(densities)
    weight = weights(densities)
    return tuple(
        W[k] * reference[k][1] + weight[k] * (p - reference[k][0]) + omega[k] * p for k in static_range(PHASES)
    )


def bulk_modulus(W):
    """rho c^2 [Pa] of the frozen mixture: the mean of the phases' rho_k c_k^2 by volume."""
    a, bulk = fractions(W), bulk_moduli(W)
    return sum(a[k] * bulk[k] for k in static_range(PHASES))


def sound_speed(W):
    """Frozen speed of sound [m/s]."""
    return sqrt(bulk_modulus(W) / mixture_density(W))


def behind_wave(W, s, u_face):
    """All that is transported, per volume, behind a wave of speed s that changes the normal velocity to u_face.

    The stored state, the energies of all phases, and 1 for the volume itself.
    """
    a, u, p = fractions(W), W[PHASES], W[PHASES + DIMENSIONS]
    chi = (s - u) / (s - u_face)  # compression; 1 if no wave passes
    energy = chi * (total_energy(W) + (u_face - u) * (mixture_density(W) * u_face + p / (s - u)))
    before = tuple(W[k] for k in static_range(PHASES))
    weight = weights(before)
    held = tuple(
        chi if weight[k] == 1.0 else min(chi, 1.0 + ROOM / max(weight[k] - 1.0, 1e-30)) for k in static_range(PHASES)
    )
    behind = tuple(held[k] * W[k] for k in static_range(PHASES))
    reference = references(before)
    omega = omegas(before)
    reference_behind = references(behind)
    omega_behind = omegas(behind)
    masses = tuple(a[k] * (chi * W[k]) for k in static_range(PHASES))
    mass = sum(masses[k] for k in static_range(PHASES))
    excess = tuple(omega_behind[k] / omega[k] * (p - reference[k][0]) for k in static_range(PHASES))
    return (
        *(masses[k] for k in static_range(PHASES)),
        mass * u_face,
        *(mass * W[PHASES + d] for d in static_range(1, DIMENSIONS)),
        energy,
        *(a[k] for k in static_range(PHASES - 1)),
        *(
            a[k] * energy_behind_wave(p, held[k], excess[k], reference_behind[k][0], omega_behind[k])
            for k in static_range(PHASES)
        ),
        1.0,
    )


def before_relaxation(U_n, U, W, D, b, dt):
    """Where all phases stand after a stage (relaxation_many.py), and by how much transport has changed their volumes.

    Phase energies obey the paper's Eq. 15 (sign corrected); rho E is the conserved energy, from which they are reset
    (Eq. 30).
    """
    W_n = primitives(U_n)
    p_n, p, du = W_n[PHASES + DIMENSIONS], W[PHASES + DIMENSIONS], D[FLUXES - 1]
    a_n, a = fractions(U_n), fractions(W)
    masses = tuple(U_n[k] + b * (U[k] - D[k] - U_n[k]) for k in static_range(PHASES))
    moved = tuple(b * (a[k] - D[PHASES + DIMENSIONS + 1 + k] + a[k] * du - a_n[k]) for k in static_range(PHASES - 1))
    da = changes_of(U_n, fractions_after(U_n, moved))
    before, now = tuple(W_n[k] for k in static_range(PHASES)), tuple(W[k] for k in static_range(PHASES))
    after = tuple(masses[k] / (a_n[k] + da[k]) for k in static_range(PHASES))
    reference_n = references(before)
    reference = references(now)
    omega_n = omegas(before)
    omega = omegas(now)
    omega_new = omegas(after)
    e_n = tuple(a_n[k] * ((p_n - reference_n[k][0]) / omega_n[k]) for k in static_range(PHASES))
    e = tuple(a[k] * ((p - reference[k][0]) / omega[k]) for k in static_range(PHASES))
    de = tuple(b * (e[k] - D[VARIABLES + k] + a[k] * p * -du - e_n[k]) for k in static_range(PHASES))
    gained = tuple(
        omega_new[k] * de[k] + (omega_new[k] / omega_n[k] - 1.0) * (a_n[k] * (p_n - reference_n[k][0]))
        for k in static_range(PHASES)
    )
    volumes = tuple(a_n[k] + da[k] for k in static_range(PHASES))
    references_n = tuple(reference_n[k][0] for k in static_range(PHASES))
    return (phases_before(p_n, volumes, da, masses, references_n, gained), da)


def fractions_after(U_n, changes):
    """Volume fractions of all phases but the last after their changes in a stage."""
    return bounded(tuple(U_n[PHASES + DIMENSIONS + 1 + k] + changes[k] for k in static_range(PHASES - 1)))


def changes_of(U_n, a):
    """By how much the volumes of all phases have changed when all but the last have the volume fractions `a`."""
    before, last = fractions(U_n), 1.0 - sum(a[k] for k in static_range(PHASES - 1))
    return (*(a[k] - before[k] for k in static_range(PHASES - 1)), last - before[PHASES - 1])


def updated(U_n, U, W, D, b, dt):
    """One stage of SSP-RK3: U_n + b (U - D + dt S - U_n), then volumes change until all phases share a pressure; behind
    the state a value that is negative where they do not yet.

    D is dt times the divergence of the fluxes. Everything is written as a change of U_n, so that a uniform state stays
    as it is to the bit.
    """
    phases, da = before_relaxation(U_n, U, W, D, b, dt)
    relaxed, settled = relaxed_changes(phases)
    new = updated_conserved(U_n, U, D, b, dt)
    a = fractions_after(U_n, tuple(da[k] + relaxed[k] for k in static_range(PHASES - 1)))
    return (
        *(new[v] for v in static_range(PHASES + DIMENSIONS + 1)),
        *(a[k] for k in static_range(PHASES - 1)),
        settled,
    )
