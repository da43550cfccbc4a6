"""Failure of a solid: Johnson-Cook fracture strain, largest principal stress, softening by the fracture energy.

Damage D in 0 ... 1 multiplies the stress of the intact material by 1 - D, pressure only in tension; a particle whose
damage is 1 has failed. A material's `failure` is the tuple (D1, D2, D3, D4, D5, reference_rate, tensile_strength,
fracture_energy, size): D1 = inf and tensile_strength = inf switch a criterion off, fracture_energy = 0 means failure at
once. A crack in particles that take up `size` [m] across it takes fracture_energy [J/m2], whatever the size.
"""

from math import exp, log, sqrt

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import COMPONENTS, DIMENSIONS
from distfsi.formulas.tensors import determinant, rows

CRUSHED, HIGHEST_TRIAXIALITY = -1.0 / 3.0, 1.5  # below the one no void grows; above the other the law was not measured
BRITTLE = 1e-300  # J/m2: smallest fracture energy, to divide by


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


def failure_strain(triaxiality, rate, homologous, failure):
    """(D1 + D2 exp(D3 eta)) (1 + D4 ln rate*) (1 + D5 T*) of Johnson & Cook 1985, eta = mean / von Mises stress."""
    D1, D2, D3, D4, D5, reference_rate, tensile_strength, fracture_energy, size = failure
    opening = D1 + D2 * exp(D3 * min(triaxiality, HIGHEST_TRIAXIALITY))
    return opening * (1.0 + D4 * log(max(rate / reference_rate, 1.0))) * (1.0 + D5 * homologous)


def ductile_wear(increment, pressure, stress, dt, homologous, toughness, failure):
    """What a plastic strain `increment` at the von Mises `stress` uses up of the fracture strain; none if crushed."""
    triaxiality = -pressure / max(stress, 1.0)
    limit = toughness * failure_strain(triaxiality, increment / dt, homologous, failure)
    return increment / limit if triaxiality > CRUSHED else 0.0


def crack_share(work, failure):
    """D after a `work` [J/m3] on the intact material: plastic, and of its mean tension, which a crack lets go as well.

    The damaged material takes 1 - D of it, half of it all until D = 1: the crack's energy over its width.
    """
    D1, D2, D3, D4, D5, reference_rate, tensile_strength, fracture_energy, size = failure
    return work * size / (2.0 * max(fracture_energy, BRITTLE))


def elastic_energy(mises, tension, shear_modulus, bulk_modulus):
    """Energy [J/m3] that a crack lets go: of the deviator (its von Mises stress `mises`) and of a mean `tension`."""
    return mises * mises / max(6.0 * shear_modulus, BRITTLE) + 0.5 * tension * tension / bulk_modulus


def tensile_damage(principal, energy, toughness, failure):
    """D of a crack across the largest `principal` stress of the intact material: linear softening (Hillerborg 1976).

    `energy` [J/m3] is that of the intact material under its stress, so that the crack takes its own however the
    material is held across its direction. A particle too large to let its energy out slowly fails at once.
    """
    D1, D2, D3, D4, D5, reference_rate, tensile_strength, fracture_energy, size = failure
    ratio = max(principal / (toughness * tensile_strength), 1.0)
    widest = fracture_energy * ratio * ratio / (max(energy, BRITTLE) * size)  # strain of the open crack over the first
    soft = widest * (ratio - 1.0) / (ratio * max(widest - 1.0, BRITTLE))
    return (min(soft, 1.0) if widest > 1.0 else 1.0) if ratio > 1.0 else 0.0
