"""Loops over pairs of particles of one body that touch without a bond."""

from math import sqrt

from distfsi.device.markers import driver, helper
from distfsi.formulas.geometry import side_of_cube
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.formulas.tensors import dot
from distfsi.solid.formulas.self_contact import contact_force
from distfsi.solid.kernels.matrices import difference, zero_vector
from distfsi.solid.kernels.records import (
    DENSITY,
    EXPOSED,
    MASS,
    RUPTURE_LENGTH,
    SOUND_SPEED,
    UNBONDED,
    VELOCITY,
    Contacts,
    Neighbours,
    SearchMemory,
)

TOUCHING = 0.6  # of the size: lattices that flow plastically do not touch themselves


# ---- who may touch ---------------------------------------------------------------------------------------------------


@driver
def mark_exposed(begin, end, state, payload, size, rupture_length, mark):
    """mark[i] = 1 for exposed and unbonded particles, else 0; size[i] and rupture_length[i] = those of `Contacts`."""
    for i in range(begin, end):
        size[i] = side_of_cube(state[i, MASS] / state[i, DENSITY])
        rupture_length[i] = payload[i, RUPTURE_LENGTH]
        mark[i] = 1 if payload[i, EXPOSED] > 0.0 or payload[i, UNBONDED] > 0.0 else 0


@helper
def identity_of(key, payload, i):
    """A particle's key, and whether it is unbonded."""
    return 2 * key[i] + (1 if payload[i, UNBONDED] > 0.0 else 0)


@driver
def remember_search(begin, end, rows, key, payload, position, size, last: SearchMemory):
    """What mark_outdated() compares later of the particles `rows`."""
    for r in range(begin, end):
        i = rows[r]
        last.identity[r] = identity_of(key, payload, i)
        last.size[r] = size[i]
        for d in static_range(DIMENSIONS):
            last.position[r, d] = position[i, d]


@driver
def mark_outdated(begin, end, skin, rows, key, payload, position, size, last: SearchMemory, mark):
    """mark[r] = 1 where row r is another particle than it was, or has come closer to others than half its `skin`."""
    for r in range(begin, end):
        i = rows[r]
        x = tuple(position[i, d] - last.position[r, d] for d in static_range(DIMENSIONS))
        closer = sqrt(dot(x, x)) + 0.5 * (size[i] - last.size[r])
        same = last.identity[r] == identity_of(key, payload, i)
        mark[r] = 0 if same and closer <= 0.5 * skin * last.size[r] else 1


# ---- forces ----------------------------------------------------------------------------------------------------------


@helper
def force_between(contacts: Contacts, i, j):
    """Contact force on particle i by j. They have not touched each other in the reference state, nor when their bond
    was cut: a spring must be pressed before it pushes."""
    X, size = difference(contacts.reference, 0, i, j), 0.5 * (contacts.size[i] + contacts.size[j])
    ruptured = max(contacts.rupture_length[i], contacts.rupture_length[j])
    touching = min(TOUCHING * min(size, sqrt(dot(X, X))), ruptured)
    densities = (contacts.state[i, DENSITY], contacts.state[j, DENSITY])
    speeds = (contacts.state[i, SOUND_SPEED], contacts.state[j, SOUND_SPEED])
    moduli = (densities[0] * speeds[0] * speeds[0], densities[1] * speeds[1] * speeds[1])
    dx, dv = difference(contacts.position, 0, i, j), difference(contacts.state, VELOCITY, i, j)
    return contact_force(dx, dv, touching, moduli, densities, speeds)


@driver
def accelerate_contacts(begin, end, rows, neighbours: Neighbours, contacts: Contacts, mass, acceleration):
    """Add the contact forces to the acceleration of the particles `rows`, each with its row of neighbours, which are
    counted among the `rows`."""
    for r in range(begin, end):
        i = rows[r]
        force = zero_vector()
        for n in range(neighbours.count[r]):
            push = force_between(contacts, i, rows[neighbours.table[r, n]])
            force = tuple(force[d] + push[d] for d in static_range(DIMENSIONS))
        for d in static_range(DIMENSIONS):
            acceleration[i, d] += force[d] / mass[i]


@driver
def heat_contacts(begin, end, rows, neighbours: Neighbours, contacts: Contacts, mass, dt, motion, energy):
    """Advance the energy by half the work of the contact forces; `motion` (count, D …): means of velocities."""
    for r in range(begin, end):
        i = rows[r]
        power = 0.0
        for n in range(neighbours.count[r]):
            j = rows[neighbours.table[r, n]]
            power -= 0.5 * dot(force_between(contacts, i, j), difference(motion, 0, i, j))
        energy[i] += dt * power / mass[i]
