"""Contact of different sides: how much of the other one a particle sees, and the pressure that follows."""

from distfsi.solid.formulas.bonds import bulk_viscosity, shocked_share


def contact_pressure(strain, rate, touching, moduli, densities, sound_speeds):
    """Pressure [Pa] on a particle that another side presses on; each pair (own, of the other side).

    `strain` is the approach beyond touch over the distance `touching` [m] of the outermost particles of both, `rate`
    [1/s] its growth. The spring is that of a rod of both materials between them; it never pulls. On approach comes the
    viscous pressure of a shock.
    """
    modulus = 2.0 * moduli[0] * moduli[1] / (moduli[0] + moduli[1])
    density, sound_speed = 0.5 * (densities[0] + densities[1]), 0.5 * (sound_speeds[0] + sound_speeds[1])
    closing = max(rate, 0.0)
    share = shocked_share(-closing, touching, sound_speed)
    return modulus * strain + bulk_viscosity(-closing, density, touching, sound_speed, share)
