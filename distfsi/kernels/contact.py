"""Loops over pairs of particles that touch without a bond."""

from math import sqrt

from distfsi.device.markers import driver, helper
from distfsi.kernels.solid import DENSITY, SOUND_SPEED, VELOCITY, difference
from distfsi.physics.contact import contact_force
from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS
from distfsi.physics.tensors import dot

SAME_BODY = 0.6  # of the size: lattices that flow plastically do not touch themselves


@helper
def force_between(position, state, reference, size, body, i, j):
    """Contact force on particle i by j. Particles of one body have not touched each other in the reference state."""
    touching = 0.5 * (size[i] + size[j])
    if body[i] == body[j]:
        X = difference(reference, 0, i, j)
        touching = SAME_BODY * min(touching, sqrt(dot(X, X)))
    densities = (state[i, DENSITY], state[j, DENSITY])
    speeds = (state[i, SOUND_SPEED], state[j, SOUND_SPEED])
    moduli = (densities[0] * speeds[0] * speeds[0], densities[1] * speeds[1] * speeds[1])
    dx, dv = difference(position, 0, i, j), difference(state, VELOCITY, i, j)
    return contact_force(dx, dv, touching, moduli, densities, speeds)


@driver
def touch(begin, end, rows, neighbours, neighbour_count, position, state, reference, size, body, mass, acceleration):
    """Add the contact forces to the acceleration of the particles `rows`, each with its row of `neighbours`."""
    for r in range(begin, end):
        i = rows[r]
        force = tuple(0.0 for _ in static_range(DIMENSIONS))
        for n in range(neighbour_count[r]):
            push = force_between(position, state, reference, size, body, i, neighbours[r, n])
            force = tuple(force[d] + push[d] for d in static_range(DIMENSIONS))
        for d in static_range(DIMENSIONS):
            acceleration[i, d] += force[d] / mass[i]


@driver
def heat_contact(
    begin, end, rows, neighbours, neighbour_count, position, state, reference, size, body, mass, dt, motion, energy
):
    """Advance the energy by half the work of the contact forces; `motion` (count, D …): means of velocities."""
    for r in range(begin, end):
        i = rows[r]
        power = 0.0
        for n in range(neighbour_count[r]):
            j = neighbours[r, n]
            push = force_between(position, state, reference, size, body, i, j)
            power -= 0.5 * dot(push, difference(motion, 0, i, j))
        energy[i] += dt * power / mass[i]
