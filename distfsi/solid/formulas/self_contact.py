"""Contact of particles without a bond: an elastic spring while they overlap, and a viscous pressure on approach."""

from math import sqrt

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.formulas.tensors import dot
from distfsi.solid.formulas.bonds import bulk_viscosity, shocked_share


def contact_force(dx, dv, touching, moduli, densities, sound_speeds):
    """Force [N] on the first of two particles `touching` [m] apart when they begin to touch; each pair (first, second).

    Along dx = x_first - x_second, odd in it to the bit. The spring is that of a rod of both materials between them.
    """
    distance = max(sqrt(dot(dx, dx)), 1e-12 * touching)
    overlap = max(1.0 - distance / touching, 0.0)
    approach = max(-dot(dv, dx) / distance, 0.0) if overlap > 0.0 else 0.0
    modulus = 2.0 * moduli[0] * moduli[1] / (moduli[0] + moduli[1])
    density, sound_speed = 0.5 * (densities[0] + densities[1]), 0.5 * (sound_speeds[0] + sound_speeds[1])
    share = shocked_share(-approach / touching, touching, sound_speed)
    viscous = bulk_viscosity(-approach / touching, density, touching, sound_speed, share)
    area = 1.0
    if DIMENSIONS == 2:
        area = touching
    if DIMENSIONS == 3:
        area = touching * touching
    push = area * (modulus * overlap + viscous) / distance
    return tuple(push * dx[d] for d in static_range(DIMENSIONS))
