"""Loops over pairs of particles that touch without a bond."""

from math import sqrt

from distfsi.device.markers import driver, helper
from distfsi.formulas.geometry import side_of_cube
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.formulas.tensors import dot
from distfsi.mesh.kernels.particles import IMAGES
from distfsi.solid.formulas.contact import contact_force
from distfsi.solid.kernels.bonds import BODY, DEBRIS, EXPOSED, PARTED
from distfsi.solid.kernels.pairs import DENSITY, MASS, SOUND_SPEED, VELOCITY, difference

SAME_BODY = 0.6  # of the size: lattices that flow plastically do not touch themselves


@driver
def mark_touching(begin, end, state, facts, key, through, size, parted, side, mark):
    """mark[i] = 1 for exposed particles and debris, else 0; size[i] [m] of a particle; side[i] = number of its body;
    parted[i] as solid/kernels/bonds.py has it.

    through (bodies,): the axes, as bits, along which a body goes on behind a symmetry plane; an image at a plane where
    its body ends belongs to another one.
    """
    for i in range(begin, end):
        own = int(facts[i, BODY])
        beyond = key[i] % IMAGES & (IMAGES - 1 - through[own]) > 0
        size[i] = side_of_cube(state[i, MASS] / state[i, DENSITY])
        parted[i] = facts[i, PARTED]
        side[i] = own + (len(through) if beyond else 0)
        mark[i] = 1 if facts[i, EXPOSED] > 0.0 or facts[i, DEBRIS] > 0.0 else 0


@driver
def remember(begin, end, rows, key, facts, position, size, who, place, size_then):
    """What still_valid() compares later of the particles `rows`."""
    for r in range(begin, end):
        i = rows[r]
        who[r] = 2 * key[i] + (1 if facts[i, DEBRIS] > 0.0 else 0)
        size_then[r] = size[i]
        for d in static_range(DIMENSIONS):
            place[r, d] = position[i, d]


@driver
def mark_invalid(begin, end, skin, rows, key, facts, position, size, who, place, size_then, mark):
    """mark[r] = 1 where row r is another particle than it was, or has come closer to others than half its `skin`."""
    for r in range(begin, end):
        i = rows[r]
        x = tuple(position[i, d] - place[r, d] for d in static_range(DIMENSIONS))
        closer = sqrt(dot(x, x)) + 0.5 * (size[i] - size_then[r])
        same = who[r] == 2 * key[i] + (1 if facts[i, DEBRIS] > 0.0 else 0)
        mark[r] = 0 if same and closer <= 0.5 * skin * size_then[r] else 1


@helper
def force_between(position, state, reference, size, parted, body, i, j):
    """Contact force on particle i by j. Particles of one body have not touched each other in the reference state, nor
    when their bond was cut: a spring must be pressed before it pushes."""
    touching = 0.5 * (size[i] + size[j])
    if body[i] == body[j]:
        X = difference(reference, 0, i, j)
        touching = min(SAME_BODY * min(touching, sqrt(dot(X, X))), max(parted[i], parted[j]))
    densities = (state[i, DENSITY], state[j, DENSITY])
    speeds = (state[i, SOUND_SPEED], state[j, SOUND_SPEED])
    moduli = (densities[0] * speeds[0] * speeds[0], densities[1] * speeds[1] * speeds[1])
    dx, dv = difference(position, 0, i, j), difference(state, VELOCITY, i, j)
    return contact_force(dx, dv, touching, moduli, densities, speeds)


@driver
def touch(
    begin, end, rows, neighbours, neighbour_count, position, state, reference, size, parted, body, mass, acceleration
):
    """Add the contact forces to the acceleration of the particles `rows`, each with its row of `neighbours`, which are
    counted among the `rows`."""
    for r in range(begin, end):
        i = rows[r]
        force = tuple(0.0 for _ in static_range(DIMENSIONS))
        for n in range(neighbour_count[r]):
            push = force_between(position, state, reference, size, parted, body, i, rows[neighbours[r, n]])
            force = tuple(force[d] + push[d] for d in static_range(DIMENSIONS))
        for d in static_range(DIMENSIONS):
            acceleration[i, d] += force[d] / mass[i]


@driver
def heat_contact(
    begin, end, rows, neighbours, neighbour_count, position, state, reference, size, parted, body, mass, dt, motion,
    energy,
):  # fmt: skip
    """Advance the energy by half the work of the contact forces; `motion` (count, D …): means of velocities."""
    for r in range(begin, end):
        i = rows[r]
        power = 0.0
        for n in range(neighbour_count[r]):
            j = rows[neighbours[r, n]]
            push = force_between(position, state, reference, size, parted, body, i, j)
            power -= 0.5 * dot(push, difference(motion, 0, i, j))
        energy[i] += dt * power / mass[i]
