"""Loops of the solid: neighbour search and forces; those of the material point are in material.py.

`position` (count, DIMENSIONS) and `state` (count, columns below) hold a rank's own particles first, then its ghosts and
images. All sums gather: the neighbours of a particle are visited in one order on any number of ranks and threads.
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
from distfsi.solid.kernels.material import matrix_of

MASS, DENSITY, SMOOTHING, SOUND_SPEED, VELOCITY = range(5)  # columns of `state`

# ---- neighbour search -----------------------------------------------------------------------------------------------


@driver
def find_neighbours(begin, end, position, state, cell, start, order, rows, neighbours, neighbour_count):
    """neighbours[i] = all particles closer than 2 h_ij, cell by cell in the order of their keys.

    `rows` are the offsets of the rows of three cells around a cell. The count may exceed the table's width; then the
    table is not complete.
    """
    for i in range(begin, end):
        found = 0
        for r in range(len(rows)):
            c = cell[i] + rows[r]
            for n in range(start[c - 1], start[c + 2]):
                j = order[n]
                reach = state[i, SMOOTHING] + state[j, SMOOTHING]
                dx = difference(position, 0, i, j)
                if dot(dx, dx) < reach * reach and j != i:
                    if found < neighbours.shape[1]:
                        neighbours[i, found] = j
                    found += 1
        neighbour_count[i] = found


@driver
def place_among(begin, end, rows, table, count, neighbours, neighbour_count):
    """The neighbours of the particles `rows`, counted among these, become those of all."""
    for r in range(begin, end):
        neighbour_count[rows[r]] = count[r]
        for n in range(count[r]):
            neighbours[rows[r], n] = rows[table[r, n]]


# ---- pairs ---------------------------------------------------------------------------------------------------------


@helper
def difference(A, column, i, j):
    """Vector of A[i] minus that of A[j]."""
    return tuple(A[i, column + d] - A[j, column + d] for d in static_range(DIMENSIONS))


@helper
def no_matrix():
    """Matrix of zeros."""
    return tuple(tuple(0.0 for _ in static_range(DIMENSIONS)) for _ in static_range(DIMENSIONS))


@helper
def plus(first, second):
    """Sum of two matrices."""
    return tuple(tuple(first[a][b] + second[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


@helper
def store_matrix(A, i, matrix):
    """A[i] = rows of the matrix, one after the other."""
    for a in static_range(DIMENSIONS):
        for b in static_range(DIMENSIONS):
            A[i, a * DIMENSIONS + b] = matrix[a][b]


@helper
def along(matrix, dx):
    """dx . matrix dx"""
    return dot(dx, times(matrix, dx))


@helper
def pair_geometry(position, state, rates, i, j):
    """dx, slope of W, approach speed and Monaghan's Pi of a pair; `rates`: velocity gradients."""
    dx = difference(position, 0, i, j)
    distance2 = dot(dx, dx)
    h = 0.5 * (state[i, SMOOTHING] + state[j, SMOOTHING])
    own, other = matrix_of(rates, i), matrix_of(rates, j)
    seen, dilation = (along(own, dx), along(other, dx)), trace(own) + trace(other)
    approach, rough = approach_speeds(difference(state, VELOCITY, i, j), dx, seen, dilation, distance2, h)
    mean_sound = 0.5 * (state[i, SOUND_SPEED] + state[j, SOUND_SPEED])
    mean_density = 0.5 * (state[i, DENSITY] + state[j, DENSITY])
    return (dx, smoothing_slope(distance2, h), approach, viscosity(approach, rough, mean_sound, mean_density))


@helper
def tension_of(stress, i):
    """The tension that `correct` left beside the particle's corrected stress."""
    return rows(tuple(stress[i, DIMENSIONS * DIMENSIONS + c] for c in static_range(COMPONENTS)))


@helper
def repelling(state, i, j, dx, tension):
    """What the artificial stress of a `tension` of particle i, j or both adds to the pair's Pi."""
    h = 0.5 * (state[i, SMOOTHING] + state[j, SMOOTHING])
    return repulsion(dot(dx, dx), h, state[i, DENSITY] * state[j, DENSITY]) * along(tension, dx)


@driver
def correct(begin, end, position, state, neighbours, neighbour_count, pressure, deviator, correction, stress):
    """correction[i] = what makes gradients exact for linear fields; stress[i] = the particle's stress times it and, for
    artificial stress, behind it the tensile part of the stress."""
    for i in range(begin, end):
        moment = no_matrix()
        for n in range(neighbour_count[i]):
            j = neighbours[i, n]
            dx = difference(position, 0, i, j)
            slope = smoothing_slope(dot(dx, dx), 0.5 * (state[i, SMOOTHING] + state[j, SMOOTHING]))
            moment = plus(moment, pair_gradient(dx, dx, slope, state[j, MASS] / state[j, DENSITY]))
        matrix = gradient_correction(moment)
        sigma = whole_stress(tuple(deviator[i, c] for c in static_range(COMPONENTS)), pressure[i])
        store_matrix(correction, i, matrix)
        store_matrix(stress, i, product(sigma, matrix))
        if ARTIFICIAL_STRESS:
            tension = components(positive_part(sigma))
            for c in static_range(COMPONENTS):
                stress[i, DIMENSIONS * DIMENSIONS + c] = tension[c]


@driver
def press(begin, end, pressure, pushed):
    """pushed[i] = the pressure where it is none of tension, else 0."""
    for i in range(begin, end):
        pushed[i] = max(pressure[i], 0.0)


@driver
def accelerate(
    begin, end, position, state, neighbours, neighbour_count, rates, stress, acceleration, limits, viscous
):  # fmt: skip
    """acceleration[i] = that of the forces between particles (Eq. 5b); limits[i] = the time steps they allow;
    viscous[i] = Pi of each pair."""
    for i in range(begin, end):
        total = tuple(0.0 for _ in static_range(DIMENSIONS))
        fastest = 0.0
        own = matrix_of(stress, i)
        for n in range(neighbour_count[i]):
            j = neighbours[i, n]
            dx, slope, approach, Pi = pair_geometry(position, state, rates, i, j)
            viscous[i, n] = Pi
            densities = state[i, DENSITY] * state[j, DENSITY]
            if ARTIFICIAL_STRESS:
                Pi += repelling(state, i, j, dx, plus(tension_of(stress, i), tension_of(stress, j)))
            pull = pair_acceleration(dx, slope, plus(own, matrix_of(stress, j)), densities, Pi)
            total = tuple(total[d] + state[j, MASS] * pull[d] for d in static_range(DIMENSIONS))
            fastest = max(fastest, approach)
        for d in static_range(DIMENSIONS):
            acceleration[i, d] = total[d]
        limits[i, 0], limits[i, 1] = stable_time(state[i, SMOOTHING], state[i, SOUND_SPEED], fastest, total)


# ---- update ---------------------------------------------------------------------------------------------------------


@driver
def heat(
    begin, end, position, state, neighbours, neighbour_count, viscous, dt, stress, correction, velocity, energy,
    gradient,
):  # fmt: skip
    """Advance the energy (Eq. 5c) and find the velocity gradient; `velocity` is the new one, of all particles.

    The energy takes the mean of the old and the new velocities, so that kinetic and internal energy exchange exactly.
    """
    for i in range(begin, end):
        power = 0.0
        total = no_matrix()
        own = matrix_of(stress, i)
        for n in range(neighbour_count[i]):
            j = neighbours[i, n]
            dx, Pi = difference(position, 0, i, j), viscous[i, n]
            slope = smoothing_slope(dot(dx, dx), 0.5 * (state[i, SMOOTHING] + state[j, SMOOTHING]))
            before, after = difference(state, VELOCITY, i, j), difference(velocity, 0, i, j)
            mean = tuple(0.5 * (before[d] + after[d]) for d in static_range(DIMENSIONS))
            densities = state[i, DENSITY] * state[j, DENSITY]
            if ARTIFICIAL_STRESS:
                Pi += 2.0 * repelling(state, i, j, dx, tension_of(stress, i))  # of viscosity either takes a half
            power += state[j, MASS] * pair_heating(mean, dx, slope, own, densities, Pi)
            total = plus(total, pair_gradient(after, dx, slope, state[j, MASS] / state[j, DENSITY]))
        energy[i] += dt * power
        store_matrix(gradient, i, mid_step(product(total, matrix_of(correction, i)), dt))
