"""Stress of a solid: Hooke's law, invariants, the sound speed (paper, A.2-A.4).

The deviatoric stress is the tuple of its COMPONENTS (tensors.py); the normal stresses out of the plane share what makes
its trace vanish. `gradient` is the velocity gradient by rows, gradient[a][b] = dv_a/dx_b [1/s].
"""

from math import sqrt

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import COMPONENTS, DIMENSIONS
from distfsi.formulas.tensors import components, determinant, product, rows, trace, transposed
from distfsi.solid.formulas.rotation import rotation

SHEARLESS = 1e-300  # Pa: smallest shear modulus, to divide by


def stretching(gradient):
    """Deviator of the rate of strain [1/s], by components."""
    mean = trace(gradient) / 3.0
    return components(
        tuple(
            tuple(0.5 * (gradient[a][b] + gradient[b][a]) - (mean if a == b else 0.0) for b in static_range(DIMENSIONS))
            for a in static_range(DIMENSIONS)
        )
    )


def trial_deviator(deviator, gradient, spin, shear_modulus, dt):
    """Elastic trial stress [Pa] after `dt` (A.3): half of the strain (Hooke's law) comes before the stress is turned
    with the `spin` of its axes, half after."""
    strain = stretching(gradient)
    half = tuple(shear_modulus * dt * strain[c] for c in static_range(COMPONENTS))
    turn = rotation(spin, dt)
    strained = tuple(deviator[c] + half[c] for c in static_range(COMPONENTS))
    turned = components(product(product(turn, rows(strained)), transposed(turn)))
    return tuple(turned[c] + half[c] for c in static_range(COMPONENTS))


def von_mises(deviator):
    """sqrt(3 J2) [Pa] with the stresses out of the plane (A.4)."""
    normal = sum(deviator[a] * deviator[a] for a in static_range(DIMENSIONS))
    shear = sum(deviator[c] * deviator[c] for c in static_range(DIMENSIONS, COMPONENTS))
    if DIMENSIONS < 3:
        along = sum(deviator[a] for a in static_range(DIMENSIONS))
        return sqrt(1.5 * (normal + along * along * (1.0 / (3 - DIMENSIONS))) + 3.0 * shear)
    return sqrt(1.5 * normal + 3.0 * shear)


def largest_principal(deviator):
    """Largest principal value [Pa] of a deviator, the normal stresses out of the plane among them."""
    if DIMENSIONS == 1:
        return max(deviator[0], -0.5 * deviator[0])
    if DIMENSIONS == 2:
        mean, half = 0.5 * (deviator[0] + deviator[1]), 0.5 * (deviator[0] - deviator[1])
        return max(mean + sqrt(half * half + deviator[2] * deviator[2]), -2.0 * mean)
    if DIMENSIONS == 3:
        normal = sum(deviator[a] * deviator[a] for a in static_range(3))
        shear = sum(deviator[c] * deviator[c] for c in static_range(3, COMPONENTS))
        scale = sqrt((0.5 * normal + shear) / 3.0) + 1e-300
        q = min(max(0.5 * determinant(rows(deviator)) / (scale * scale * scale), -1.0), 1.0)
        y = 1.0 + sqrt(0.5 * (1.0 + q))  # of y^3 - 3 y = 2 q, the largest root
        for _ in static_range(4):
            y = y - (y * y * y - 3.0 * y - 2.0 * q) / max(3.0 * y * y - 3.0, 1e-12)
        return scale * y


def crack_energy(mises, pressure, shear_modulus, bulk_modulus):
    """Energy [J/m3] that a crack lets go: of the deviator (its von Mises stress `mises`) and of a mean tension."""
    tension = max(-pressure, 0.0)
    return mises * mises / max(6.0 * shear_modulus, SHEARLESS) + 0.5 * tension * tension / bulk_modulus


def longitudinal_speed(density, bulk, shear_modulus, minimum_modulus):
    """Longitudinal sound speed [m/s]; the bulk modulus is `minimum_modulus` or more."""
    return sqrt((max(bulk, minimum_modulus) + 4.0 / 3.0 * shear_modulus) / density)
