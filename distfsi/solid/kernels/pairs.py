"""Loops of the updated Lagrangian form: forces and strain of particles that are near each other.

All sums gather: the neighbours of a particle are visited in one order on any number of ranks and threads.
"""

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import ARTIFICIAL_STRESS, COMPONENTS, DIMENSIONS
from distfsi.formulas.tensors import components, dot, positive_part, product, rows, times, trace
from distfsi.solid.formulas.pair import (
    approach_speeds,
    gradient_correction,
    mid_step,
    pair_acceleration,
    pair_gradient,
    pair_heating,
    repulsion,
    stable_time,
    viscosity,
    whole_stress,
)
from distfsi.solid.formulas.smoothing import smoothing_slope
from distfsi.solid.kernels.matrices import (
    difference,
    matrix_of,
    matrix_sum,
    store_matrix,
    store_vector,
    tensor_of,
    vector_of,
    zero_matrix,
)
from distfsi.solid.kernels.records import (
    DENSITY,
    MASS,
    SMOOTHING,
    SOUND_SPEED,
    VELOCITY,
    Interaction,
    Neighbours,
    Particles,
)

# ---- a pair ----------------------------------------------------------------------------------------------------------


@helper
def along(matrix, dx):
    """dx . matrix dx"""
    return dot(dx, times(matrix, dx))


@helper
def pair_geometry(particles: Particles, rates, i, j):
    """dx, slope of W, approach speed and Monaghan's Pi of a pair; `rates`: velocity gradients."""
    dx = difference(particles.position, 0, i, j)
    distance2 = dot(dx, dx)
    h = 0.5 * (particles.state[i, SMOOTHING] + particles.state[j, SMOOTHING])
    own, other = matrix_of(rates, i), matrix_of(rates, j)
    seen, dilation = (along(own, dx), along(other, dx)), trace(own) + trace(other)
    dv = difference(particles.state, VELOCITY, i, j)
    approach, rough = approach_speeds(dv, dx, seen, dilation, distance2, h)
    mean_sound = 0.5 * (particles.state[i, SOUND_SPEED] + particles.state[j, SOUND_SPEED])
    mean_density = 0.5 * (particles.state[i, DENSITY] + particles.state[j, DENSITY])
    return (dx, smoothing_slope(distance2, h), approach, viscosity(approach, rough, mean_sound, mean_density))


@helper
def tension_of(stress, i):
    """The tensile part of the particle's stress, behind its corrected stress."""
    return rows(tuple(stress[i, DIMENSIONS * DIMENSIONS + c] for c in static_range(COMPONENTS)))


@helper
def repelling(state, i, j, dx, tension):
    """What the artificial stress of a `tension` of particle i, j or both adds to the pair's Pi."""
    h = 0.5 * (state[i, SMOOTHING] + state[j, SMOOTHING])
    return repulsion(dot(dx, dx), h, state[i, DENSITY] * state[j, DENSITY]) * along(tension, dx)


# ---- a step ----------------------------------------------------------------------------------------------------------


@driver
def keep_own_side(begin, end, side, neighbours: Neighbours):
    """Of the neighbours of a particle those of its own side stay, in their order."""
    for i in range(begin, end):
        kept = 0
        for n in range(neighbours.count[i]):
            j = neighbours.table[i, n]
            if side[j] == side[i]:
                neighbours.table[i, kept] = j
                kept += 1
        neighbours.count[i] = kept


@driver
def correct_gradients(begin, end, particles: Particles, neighbours: Neighbours, pressure, deviator, correction, stress):
    """correction[i] = what makes gradients exact for linear fields; stress[i] = the particle's stress times it and, for
    artificial stress, behind it the tensile part of the stress."""
    for i in range(begin, end):
        # The gradient of the positions without correction.
        moment = zero_matrix()
        for n in range(neighbours.count[i]):
            j = neighbours.table[i, n]
            dx = difference(particles.position, 0, i, j)
            slope = smoothing_slope(dot(dx, dx), 0.5 * (particles.state[i, SMOOTHING] + particles.state[j, SMOOTHING]))
            volume = particles.state[j, MASS] / particles.state[j, DENSITY]
            moment = matrix_sum(moment, pair_gradient(dx, dx, slope, volume))
        # Its inverse corrects gradients, and so the stress in the forces.
        matrix = gradient_correction(moment)
        sigma = whole_stress(tensor_of(deviator, i), pressure[i])
        store_matrix(correction, i, matrix)
        store_matrix(stress, i, product(sigma, matrix))
        if ARTIFICIAL_STRESS:
            tension = components(positive_part(sigma))
            for c in static_range(COMPONENTS):
                stress[i, DIMENSIONS * DIMENSIONS + c] = tension[c]


@driver
def accelerate_pairs(
    begin, end, particles: Particles, neighbours: Neighbours, rates, stress, acceleration, limits, viscous
):
    """Add to acceleration[i] that of the forces between particles (Eq. 5b); limits[i] = the time steps they allow;
    viscous[i] = Pi of each pair."""
    for i in range(begin, end):
        total = vector_of(acceleration, i)
        fastest = 0.0
        own = matrix_of(stress, i)
        for n in range(neighbours.count[i]):
            # Viscosity, and with it artificial stress.
            j = neighbours.table[i, n]
            dx, slope, approach, Pi = pair_geometry(particles, rates, i, j)
            viscous[i, n] = Pi
            densities = particles.state[i, DENSITY] * particles.state[j, DENSITY]
            if ARTIFICIAL_STRESS:
                Pi += repelling(particles.state, i, j, dx, matrix_sum(tension_of(stress, i), tension_of(stress, j)))
            # The force of the pair.
            pull = pair_acceleration(dx, slope, matrix_sum(own, matrix_of(stress, j)), densities, Pi)
            total = tuple(total[d] + particles.state[j, MASS] * pull[d] for d in static_range(DIMENSIONS))
            fastest = max(fastest, approach)
        store_vector(acceleration, i, total)
        h, sound_speed = particles.state[i, SMOOTHING], particles.state[i, SOUND_SPEED]
        limits[i, 0], limits[i, 1] = stable_time(h, sound_speed, fastest, total)


@driver
def strain_pairs(begin, end, dt, particles: Particles, pairs: Interaction, velocity, energy, gradient):
    """Advance the energy (Eq. 5c) by `dt` and find the velocity gradient; `velocity` is the new one, of all particles.

    The energy takes the mean of the old and the new velocities, so that kinetic and internal energy exchange exactly.
    """
    for i in range(begin, end):
        power = 0.0
        total = zero_matrix()
        own = matrix_of(pairs.stress, i)
        for n in range(pairs.neighbours.count[i]):
            j = pairs.neighbours.table[i, n]
            dx, Pi = difference(particles.position, 0, i, j), pairs.viscous[i, n]
            slope = smoothing_slope(dot(dx, dx), 0.5 * (particles.state[i, SMOOTHING] + particles.state[j, SMOOTHING]))
            # Power of the forces, at the mean velocities.
            before, after = difference(particles.state, VELOCITY, i, j), difference(velocity, 0, i, j)
            mean = tuple(0.5 * (before[d] + after[d]) for d in static_range(DIMENSIONS))
            densities = particles.state[i, DENSITY] * particles.state[j, DENSITY]
            if ARTIFICIAL_STRESS:
                # Of viscosity either particle takes a half; of its own tension it takes all.
                Pi += 2.0 * repelling(particles.state, i, j, dx, tension_of(pairs.stress, i))
            power += particles.state[j, MASS] * pair_heating(mean, dx, slope, own, densities, Pi)
            # Gradient of the new velocities.
            volume = particles.state[j, MASS] / particles.state[j, DENSITY]
            total = matrix_sum(total, pair_gradient(after, dx, slope, volume))
        energy[i] += dt * power
        store_matrix(gradient, i, mid_step(product(total, matrix_of(pairs.correction, i)), dt))
