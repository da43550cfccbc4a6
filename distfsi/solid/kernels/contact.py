"""Loops over pairs of particles of different sides (solid/sides.py)."""

from math import sqrt

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, FRICTION, SMOOTHING_RATIO
from distfsi.formulas.tensors import dot
from distfsi.solid.formulas.bonds import signal_time
from distfsi.solid.formulas.contact import contact_pressure
from distfsi.solid.formulas.smoothing import smoothing_kernel, smoothing_slope
from distfsi.solid.kernels.matrices import difference, store_vector, zero_vector
from distfsi.solid.kernels.records import (
    DENSITY,
    MASS,
    SMOOTHING,
    SOUND_SPEED,
    VELOCITY,
    Neighbours,
    Particles,
    SurfaceTables,
)

EMPTY, MIXED = -1, -2  # in the place of the side of a search cell
WIDTH = 1.3  # smoothing length in spacings of the coarser side; with 1 lattices that face each other slip aside
STICKING = 5.0  # stable steps in which friction stops a slip at best
TINY = 1e-300  # to divide by
UNKNOWN = 1e300  # more than can be seen: whatever a particle sees first is touch


# ---- who may meet ----------------------------------------------------------------------------------------------------


@driver
def mark_moved(begin, end, farthest, particles: Particles, last: Particles, mark):
    """mark[i] = 1 where a particle has moved, or its reach has grown, by more than `farthest` [m] since the `last`
    search, else 0."""
    for i in range(begin, end):
        x = tuple(particles.position[i, d] - last.position[i, d] for d in static_range(DIMENSIONS))
        grown = (particles.state[i, SMOOTHING] - last.state[i, SMOOTHING]) / SMOOTHING_RATIO
        mark[i] = 0 if sqrt(dot(x, x)) + 2.0 * WIDTH * grown <= farthest else 1


@driver
def find_sides_of_cells(begin, end, start, order, side, found):
    """found[c] = side of the particles of a search cell, MIXED where they have several, EMPTY where there are none."""
    for c in range(begin, end):
        common = EMPTY
        for n in range(start[c], start[c + 1]):
            other = side[order[n]]
            common = other if common == EMPTY or common == other else MIXED
        found[c] = common


@driver
def mark_meeting(begin, end, cell, rows, side_of_cell, side, mark):
    """mark[i] = 1 where the search cells around a particle, in `rows` of three, hold other sides, else 0."""
    for i in range(begin, end):
        meets = 0
        for r in range(len(rows)):
            for c in range(cell[i] + rows[r] - 1, cell[i] + rows[r] + 2):
                if side_of_cell[c] != EMPTY and side_of_cell[c] != side[i]:
                    meets = 1
        mark[i] = meets


@helper
def contact_length(particles: Particles, i, j):
    """Smoothing length of a pair in contact."""
    return WIDTH * max(particles.state[i, SMOOTHING], particles.state[j, SMOOTHING]) / SMOOTHING_RATIO


@driver
def find_meeting(
    begin, end, skin, chosen, particles: Particles, key, side, cell, start, order, rows, neighbours: Neighbours
):
    """The particles of other sides that particle chosen[r] sees, or that are farther by up to `skin` [m], in the order
    of their keys. The count may exceed the table's width; then the table is not complete."""
    for r in range(begin, end):
        i, found = chosen[r], 0
        for row in range(len(rows)):
            first = cell[i] + rows[row]
            for n in range(start[first - 1], start[first + 2]):
                j = order[n]
                dx, reach = difference(particles.position, 0, i, j), 2.0 * contact_length(particles, i, j) + skin
                if side[j] != side[i] and dot(dx, dx) < reach * reach:
                    if found < neighbours.table.shape[1]:
                        # Those with a higher key move up.
                        slot = found
                        while slot > 0 and key[neighbours.table[r, slot - 1]] > key[j]:
                            neighbours.table[r, slot] = neighbours.table[r, slot - 1]
                            slot -= 1
                        neighbours.table[r, slot] = j
                    found += 1
        neighbours.count[r] = found


# ---- forces ----------------------------------------------------------------------------------------------------------


@helper
def volume_of(particles: Particles, i):
    """Volume of a particle."""
    return particles.state[i, MASS] / particles.state[i, DENSITY]


@helper
def modulus_of(particles: Particles, i):
    """Longitudinal modulus of a particle."""
    return particles.state[i, DENSITY] * particles.state[i, SOUND_SPEED] * particles.state[i, SOUND_SPEED]


@driver
def press_surfaces(
    begin, end, chosen, neighbours: Neighbours, particles: Particles, side, tables: SurfaceTables, touching, pressure
):
    """pressure[i] = contact pressure of particle i = chosen[r].

    What it sees of other sides is counted in what it sees of them at touch: with more than touching[i] they press. That
    is 1, or what it sees of a neighbour with which it has been at rest from the start, as long as they stay as near.
    """
    bodies = tables.fill.shape[0]
    for r in range(begin, end):
        i, seen, rate = chosen[r], 0.0, 0.0
        own = side[i] % bodies
        # Sums over the other sides: what is seen, and means of what they are.
        strain, modulus, density, sound_speed, length = 0.0, 0.0, 0.0, 0.0, 0.0
        for n in range(neighbours.count[r]):
            j = neighbours.table[r, n]
            dx, h, other = difference(particles.position, 0, i, j), contact_length(particles, i, j), side[j] % bodies
            distance2 = dot(dx, dx)
            if distance2 < 4.0 * h * h:
                part = volume_of(particles, j) / tables.fill[own, other]
                weight = part * smoothing_kernel(distance2, h)
                seen += weight
                rate += part * smoothing_slope(distance2, h) * dot(dx, difference(particles.state, VELOCITY, i, j))
                strain += weight * tables.strain[own, other]
                modulus += weight * modulus_of(particles, j)
                density += weight * particles.state[j, DENSITY]
                sound_speed += weight * particles.state[j, SOUND_SPEED]
                length += weight * particles.state[j, SMOOTHING]
        # Who comes nearer than touch is pressed.
        touching[i] = max(min(touching[i], seen), 1.0)
        pressure[i] = 0.0
        if seen > touching[i]:
            per_seen = 1.0 / seen
            moduli = (modulus_of(particles, i), modulus * per_seen)
            densities = (particles.state[i, DENSITY], density * per_seen)
            sound_speeds = (particles.state[i, SOUND_SPEED], sound_speed * per_seen)
            strain *= per_seen
            gap = 0.5 * (particles.state[i, SMOOTHING] + length * per_seen) / SMOOTHING_RATIO
            approach, growth = strain * (seen - touching[i]), strain * rate
            pressure[i] = contact_pressure(approach, growth, gap, moduli, densities, sound_speeds)


@driver
def begin_touch(begin, end, touching):
    """touching[i] = 1 for particles that have seen no other side in the first step."""
    for i in range(begin, end):
        touching[i] = 1.0 if touching[i] == UNKNOWN else touching[i]


@driver
def drag_surfaces(
    begin, end, chosen, neighbours: Neighbours, particles: Particles, side, tables: SurfaceTables, pressure, traction
):
    """traction[i] = what makes friction of the pressure of particle i = chosen[r] (Coulomb): along its slip past the
    other sides, as large as the pressure allows, or as stops the slip within STICKING stable steps."""
    bodies = tables.fill.shape[0]
    for r in range(begin, end):
        i = chosen[r]
        slip, normal, seen, stretched = zero_vector(), zero_vector(), 0.0, 0.0
        for n in range(neighbours.count[r]):
            j = neighbours.table[r, n]
            dx, h, other = difference(particles.position, 0, i, j), contact_length(particles, i, j), side[j] % bodies
            distance2 = dot(dx, dx)
            if distance2 < 4.0 * h * h:
                dv = difference(particles.state, VELOCITY, i, j)
                weight = -volume_of(particles, j) * smoothing_slope(distance2, h)
                steepness = tables.steepness[side[i] % bodies, other]
                slip = tuple(slip[d] + weight * dv[d] for d in static_range(DIMENSIONS))
                normal = tuple(normal[d] + weight * dx[d] / steepness for d in static_range(DIMENSIONS))
                seen += weight
        # Slip along the surface, and how much of the motion along it pairs feel.
        length2 = max(dot(normal, normal), TINY)
        across = dot(slip, normal) / length2
        slip = tuple((slip[d] - across * normal[d]) / max(seen, TINY) for d in static_range(DIMENSIONS))
        speed2 = dot(slip, slip)
        for n in range(neighbours.count[r]):
            j = neighbours.table[r, n]
            dx, h = difference(particles.position, 0, i, j), contact_length(particles, i, j)
            distance2 = dot(dx, dx)
            if distance2 < 4.0 * h * h:
                along = dot(dx, slip)
                stretched -= volume_of(particles, j) * smoothing_slope(distance2, h) * along * along
        # Coulomb's law, or rest.
        size, sound_speed = particles.state[i, SMOOTHING], particles.state[i, SOUND_SPEED]
        slowest = STICKING * signal_time(size, sound_speed, 0.0, particles.state[i, DENSITY])
        sliding = FRICTION * 0.5 * pressure[i] * sqrt(length2) * sqrt(speed2)
        stopping = particles.state[i, DENSITY] * speed2 / slowest
        factor = min(sliding, stopping) / max(stretched, TINY) if pressure[i] > 0.0 else 0.0
        store_vector(traction, i, tuple(factor * slip[d] for d in static_range(DIMENSIONS)))


@helper
def push_between(particles: Particles, side, tables: SurfaceTables, pressure, traction, i, j):
    """Contact force on particle i by j: along the line between them, odd in i and j to the bit. Friction is carried by
    the lines that slip lengthens or shortens."""
    dx, h = difference(particles.position, 0, i, j), contact_length(particles, i, j)
    bodies, distance2 = tables.fill.shape[0], dot(dx, dx)
    own, other = side[i] % bodies, side[j] % bodies
    pressures = pressure[i] / tables.steepness[own, other] + pressure[j] / tables.steepness[other, own]
    volumes = volume_of(particles, i) * volume_of(particles, j)
    slope = smoothing_slope(distance2, h) if distance2 < 4.0 * h * h else 0.0
    push = -0.5 * volumes * pressures * slope
    if FRICTION:
        push += volumes * slope * dot(difference(traction, 0, i, j), dx)
    return tuple(push * dx[d] for d in static_range(DIMENSIONS))


@driver
def push_surfaces(
    begin, end, chosen, neighbours: Neighbours, particles: Particles, side, tables: SurfaceTables, pressure,
    traction, acceleration,
):  # fmt: skip
    """Add to acceleration[i] that of the contact forces on particle i = chosen[r]; `pressure` and
    `traction` of all."""
    for r in range(begin, end):
        i, force = chosen[r], zero_vector()
        for n in range(neighbours.count[r]):
            push = push_between(particles, side, tables, pressure, traction, i, neighbours.table[r, n])
            force = tuple(force[d] + push[d] for d in static_range(DIMENSIONS))
        for d in static_range(DIMENSIONS):
            acceleration[i, d] += force[d] / particles.state[i, MASS]


@driver
def heat_surfaces(
    begin, end, dt, chosen, neighbours: Neighbours, particles: Particles, side, tables: SurfaceTables, pressure,
    traction, velocity, energy,
):  # fmt: skip
    """Advance the energy by half the work of the contact forces in `dt`, at the means of the old and the new
    `velocity` (count, D)."""
    for r in range(begin, end):
        i, power = chosen[r], 0.0
        for n in range(neighbours.count[r]):
            j = neighbours.table[r, n]
            before, after = difference(particles.state, VELOCITY, i, j), difference(velocity, 0, i, j)
            mean = tuple(0.5 * (before[d] + after[d]) for d in static_range(DIMENSIONS))
            power -= 0.5 * dot(push_between(particles, side, tables, pressure, traction, i, j), mean)
        energy[i] += dt * power / particles.state[i, MASS]
