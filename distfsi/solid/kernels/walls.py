"""Loops over particles beside the walls of the domain: rigid planes without friction."""

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, SMOOTHING_RATIO
from distfsi.solid.formulas.contact import contact_pressure
from distfsi.solid.kernels.contact import modulus_of
from distfsi.solid.kernels.records import DENSITY, MASS, SMOOTHING, SOUND_SPEED, VELOCITY, Particles


@helper
def wall_pressure(particles: Particles, i, strain, approach):
    """Pressure of contact with the own mirror image, with the speed of `approach` [m/s] to the wall."""
    spacing, density = particles.state[i, SMOOTHING] / SMOOTHING_RATIO, particles.state[i, DENSITY]
    modulus, sound_speed, rate = modulus_of(particles, i), particles.state[i, SOUND_SPEED], 2.0 * approach / spacing
    moduli, densities, sound_speeds = (modulus, modulus), (density, density), (sound_speed, sound_speed)
    pressure = contact_pressure(strain, rate, spacing, moduli, densities, sound_speeds)
    return pressure if strain > 0.0 else 0.0


@driver
def press_walls(begin, end, particles: Particles, ends, touching, force, acceleration):
    """force[i] = what the walls do to a particle, and its share of the acceleration; ends (2 D,): where there are
    walls, low and high along each axis, infinitely far where there are none.

    touching[i] = distance from a wall, in half spacings, at which it begins to press: 1, or as near as the particle was
    at the start, as long as it stays there.
    """
    for i in range(begin, end):
        half, area = 0.5 * particles.state[i, SMOOTHING] / SMOOTHING_RATIO, 1.0
        if DIMENSIONS == 2:
            area = 2.0 * half
        if DIMENSIONS == 3:
            area = 4.0 * half * half
        # Distance from the nearest wall.
        nearest = 1.0
        for d in static_range(DIMENSIONS):
            x = particles.position[i, d]
            nearest = min(nearest, min(x - ends[2 * d], ends[2 * d + 1] - x) / half)
        touching[i] = min(max(touching[i], nearest), 1.0)
        # Forces inwards.
        for d in static_range(DIMENSIONS):
            x, v = particles.position[i, d], particles.state[i, VELOCITY + d]
            low = wall_pressure(particles, i, touching[i] - (x - ends[2 * d]) / half, -v)
            high = wall_pressure(particles, i, touching[i] - (ends[2 * d + 1] - x) / half, v)
            force[i, d] = area * (low - high)
            acceleration[i, d] += force[i, d] / particles.state[i, MASS]


@driver
def heat_walls(begin, end, dt, particles: Particles, force, velocity, energy):
    """Advance the energy by the work against the walls in `dt`, at the means of the old and the new `velocity`."""
    for i in range(begin, end):
        power = 0.0
        for d in static_range(DIMENSIONS):
            power -= 0.5 * force[i, d] * (particles.state[i, VELOCITY + d] + velocity[i, d])
        energy[i] += dt * power / particles.state[i, MASS]
