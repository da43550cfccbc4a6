"""Concrete of Holmquist, Johnson & Cook 1993 (paper, A.8-A.11 corrected): compaction, pressure-dependent strength.

A material's `concrete` is the tuple (crush_pressure, crush_strain, lock_pressure, lock_strain, full_strain, K1, K2, K3,
compressive_strength, tensile_strength, A, B, N, C, cap, D1, D2, least_strain, reference_rate, cut_off);
compressive_strength = 0: not of concrete. mu = rho/rho0 - 1. The pores are closed at full_strain, where the curve of
the dense material, which starts at lock_strain, reaches lock_pressure. No tension beyond cut_off is carried: it is
tensile_strength, or infinite where cracks (damage.py) limit the tension instead. `wear` in 0 ... 1 is the material's
own damage.
"""

from math import log, pow

from distfsi.formulas.subset import static_range


def dense_pressure(mu, concrete):
    """Pressure [Pa] of the material without pores."""
    x = (mu - concrete[3]) / (1.0 + concrete[3])
    return x * (concrete[5] + x * (concrete[6] + x * concrete[7]))


def loading_pressure(mu, concrete):
    """Pressure [Pa] on first loading to mu >= 0: elastic, crushing, dense."""
    elastic = concrete[0] / concrete[1] * mu
    share = (mu - concrete[1]) / (concrete[4] - concrete[1])
    crushing = concrete[0] + share * (concrete[2] - concrete[0])
    return elastic if mu < concrete[1] else (crushing if mu < concrete[4] else dense_pressure(mu, concrete))


def unloading_modulus(peak, concrete):
    """dp/dmu [Pa] of unloading from `peak`, between that of the sound and that of the dense material."""
    share = min(max((peak - concrete[1]) / (concrete[4] - concrete[1]), 0.0), 1.0)
    return (1.0 - share) * concrete[0] / concrete[1] + share * concrete[5]


def compacted_strain(peak, concrete):
    """mu at which no pressure is left after loading to `peak`."""
    return peak - loading_pressure(peak, concrete) / unloading_modulus(peak, concrete)


def concrete_pressure(mu, peak, wear, concrete):
    """Pressure [Pa] at mu <= `peak`, the largest compression so far (from 0); tension to the strength that is left."""
    linear = loading_pressure(peak, concrete) + unloading_modulus(peak, concrete) * (mu - peak)
    return max(linear, -concrete[19] * (1.0 - wear)) if wear < 1.0 else max(linear, 0.0)


def concrete_strength(pressure, rate, wear, concrete):
    """Von Mises stress [Pa] at yield (A.8, A.9 with the cap); falls to zero at the largest tension, or is the cap in
    tension where cracks limit it."""
    fc, tensile_strength, A, B, N, C, cap = tuple(concrete[k] for k in static_range(8, 15))
    cut_off = concrete[19] * (1.0 - wear) if wear < 1.0 else 0.0
    faster = 1.0 + C * log(max(rate / concrete[18], 1.0))
    cohesion = A * (1.0 - wear)
    pulled = cohesion * max(1.0 + pressure / max(cut_off, 1.0), 0.0) if concrete[19] < 1e300 else cap
    pressed = cohesion + B * pow(max(pressure, 0.0) / fc, N)
    return fc * min((pressed if pressure > 0.0 else pulled) * faster, cap)


def concrete_wear(increment, compaction, pressure, concrete):
    """Growth of the damage by plastic strain and by the growth of the compacted strain (A.10, A.11 with the floor)."""
    normal = max((pressure + concrete[9]) / concrete[8], 0.0)
    return (increment + compaction) / max(concrete[15] * pow(normal, concrete[16]), concrete[17])
