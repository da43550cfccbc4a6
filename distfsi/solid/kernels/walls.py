"""Loops over particles beside the walls of the domain: rigid planes, with friction or without."""

from math import sqrt

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, SMOOTHING_RATIO, WALL_FRICTION
from distfsi.formulas.tensors import dot
from distfsi.solid.formulas.bonds import signal_time
from distfsi.solid.formulas.contact import contact_pressure
from distfsi.solid.kernels.contact import STICKING, TINY, modulus_of
from distfsi.solid.kernels.records import DENSITY, MASS, SMOOTHING, SOUND_SPEED, VELOCITY, Particles


@helper
def wall_pressure(particles: Particles, i, strain, approach):
    """Pressure of contact with the own mirror image, with the speed of `approach` [m/s] to the wall."""
    spacing, density = particles.state[i, SMOOTHING] / SMOOTHING_RATIO, particles.state[i, DENSITY]
    modulus, sound_speed, rate = modulus_of(particles, i), particles.state[i, SOUND_SPEED], 2.0 * approach / spacing
    moduli, densities, sound_speeds = (modulus, modulus), (density, density), (sound_speed, sound_speed)
    pressure = contact_pressure(strain, rate, spacing, moduli, densities, sound_speeds)
    return pressure if strain > 0.0 else 0.0


@helper
def wall_friction(particles: Particles, i, axis, pressing):
    """Friction of a wall across an `axis` that presses on a particle with the force `pressing` (Coulomb): against its
    motion along the wall, as large as that allows, or as stops it within STICKING stable steps."""
    along = tuple(0.0 if d == axis else particles.state[i, VELOCITY + d] for d in static_range(DIMENSIONS))
    size, sound_speed, density = (
        particles.state[i, SMOOTHING],
        particles.state[i, SOUND_SPEED],
        particles.state[i, DENSITY],
    )
    sliding = WALL_FRICTION * pressing / max(sqrt(dot(along, along)), TINY)
    stopping = particles.state[i, MASS] / (STICKING * signal_time(size, sound_speed, 0.0, density))
    factor = min(sliding, stopping)
    return tuple(-factor * along[d] for d in static_range(DIMENSIONS))


@driver
def press_walls(begin, end, particles: Particles, ends, touching, force, mark, acceleration):
    """force[i] (D D,) = what the walls across each axis do to a particle, and its share of the acceleration; ends
    (2 D,): where there are walls, low and high along each axis, infinitely far where there are none; mark[i] = 1 where
    one presses, else 0.

    touching[i] = distance from a wall, in half spacings, at which it begins to press: 1, or as near as the particle was
    at the start, as long as it stays there.
    """
    for i in range(begin, end):
        half, area, pressed = 0.5 * particles.state[i, SMOOTHING] / SMOOTHING_RATIO, 1.0, 0
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
        # Forces inwards, and friction.
        for d in static_range(DIMENSIONS):
            x, v = particles.position[i, d], particles.state[i, VELOCITY + d]
            low = wall_pressure(particles, i, touching[i] - (x - ends[2 * d]) / half, -v)
            high = wall_pressure(particles, i, touching[i] - (ends[2 * d + 1] - x) / half, v)
            inwards = area * (low - high)
            pressed = pressed if inwards == 0.0 else 1
            for e in static_range(DIMENSIONS):
                force[i, DIMENSIONS * d + e] = 0.0
            force[i, DIMENSIONS * d + d] = inwards
            acceleration[i, d] += inwards / particles.state[i, MASS]
            if WALL_FRICTION:
                rubbing = wall_friction(particles, i, d, abs(inwards))
                for e in static_range(DIMENSIONS):
                    force[i, DIMENSIONS * d + e] += rubbing[e]
                    acceleration[i, e] += rubbing[e] / particles.state[i, MASS]
        mark[i] = pressed


@driver
def load_walls(begin, end, dt, force, load):
    """load[i] (2 D D,) = impulse in `dt` on each wall, low and high across each axis, of what it does to a particle."""
    for i in range(begin, end):
        for d in static_range(DIMENSIONS):
            inwards = force[i, DIMENSIONS * d + d]
            for e in static_range(DIMENSIONS):
                given = -dt * force[i, DIMENSIONS * d + e]
                load[i, DIMENSIONS * (2 * d) + e] = given if inwards > 0.0 else 0.0
                load[i, DIMENSIONS * (2 * d + 1) + e] = given if inwards < 0.0 else 0.0


@driver
def heat_walls(begin, end, dt, particles: Particles, force, velocity, energy):
    """Advance the energy by the work against the walls in `dt`, at the means of the old and the new `velocity`."""
    for i in range(begin, end):
        power = 0.0
        for e in static_range(DIMENSIONS):
            total = sum(force[i, DIMENSIONS * d + e] for d in static_range(DIMENSIONS))
            power -= 0.5 * total * (particles.state[i, VELOCITY + e] + velocity[i, e])
        energy[i] += dt * power / particles.state[i, MASS]
