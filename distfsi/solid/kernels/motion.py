"""Loops over a solid's particles that look at no neighbours: velocities, positions, the packed state."""

from distfsi.device.markers import driver
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import BODY_FORCE, DIMENSIONS
from distfsi.solid.kernels.records import DENSITY, MASS, SMOOTHING, SOUND_SPEED, VELOCITY

WORK, IMPULSE = 0, 1  # columns of the budget of kick()


@driver
def pack_state(begin, end, mass, density, h, sound_speed, velocity, state):
    """state[i] = what neighbours must know of a particle, in the columns of records.py."""
    for i in range(begin, end):
        state[i, MASS] = mass[i]
        state[i, DENSITY] = density[i]
        state[i, SMOOTHING] = h[i]
        state[i, SOUND_SPEED] = sound_speed[i]
        for d in static_range(DIMENSIONS):
            state[i, VELOCITY + d] = velocity[i, d]


@driver
def kick(begin, end, dt, mass, fixed, acceleration, velocity, budget):
    """velocity[i] = that after `dt` of forces and gravity; a fixed particle keeps its own.

    budget (n, 1 + D): work of gravity and of what moves the fixed particles; impulse that all forces leave.
    """
    for i in range(begin, end):
        work = 0.0
        for d in static_range(DIMENSIONS):
            # All forces; what holds a fixed particle takes them.
            weight = mass[i] * BODY_FORCE[d] * dt
            given = mass[i] * acceleration[i, d] * dt + weight
            held = -given if fixed[i] else 0.0
            before = velocity[i, d]
            after = before if fixed[i] else before + given / mass[i]
            # Gravity works at the mean velocity.
            work += weight * 0.5 * (before + after) + held * after
            budget[i, IMPULSE + d] = given + held
            velocity[i, d] = after
        budget[i, WORK] = work


@driver
def apply_impulse(begin, end, impulse, mass, fixed, mean, velocity, excess, budget):
    """velocity[i] grows by what the fluid's impulse gives; that of a fixed particle does not.

    excess[i] = velocity at which the impulse works beyond the `mean` one with which the particle moved;
    budget (n, 2 + D): work of the impulse, work of what holds the fixed particles; their impulse.
    """
    for i in range(begin, end):
        work, held_work = 0.0, 0.0
        for d in static_range(DIMENSIONS):
            given, before = impulse[i, d], velocity[i, d]
            held = -given if fixed[i] else 0.0
            gained = 0.0 if fixed[i] else given / mass[i]
            # An impulse works at the mean of the velocities before and after it.
            work += given * (before + 0.5 * gained)
            held_work += held * before
            budget[i, 2 + d] = held
            excess[i, d] = before - mean[i, d] + 0.5 * gained
            velocity[i, d] = before + gained
        budget[i, 0] = work
        budget[i, 1] = held_work


@driver
def average_velocity(begin, end, count, velocity, mean):
    """mean[i] of the last `count` velocities, when `velocity` is the newest."""
    for i in range(begin, end):
        for d in static_range(DIMENSIONS):
            mean[i, d] += (velocity[i, d] - mean[i, d]) / count


@driver
def move(begin, end, dt, velocity, position, moved):
    """moved[i] = position after `dt`."""
    for i in range(begin, end):
        for d in static_range(DIMENSIONS):
            moved[i, d] = position[i, d] + dt * velocity[i, d]


@driver
def mark_beyond(begin, end, position, ends, mark):
    """mark[i] = 1 for particles below `ends` (2 D,), low and high along each axis, or above them, else 0."""
    for i in range(begin, end):
        beyond = 0
        for d in static_range(DIMENSIONS):
            if position[i, d] < ends[2 * d] or position[i, d] > ends[2 * d + 1]:
                beyond = 1
        mark[i] = beyond


@driver
def pack_motion(begin, end, state, velocity, motion):
    """motion[i] = mean of old and new velocities, then the new one."""
    for i in range(begin, end):
        for d in static_range(DIMENSIONS):
            motion[i, d] = 0.5 * (state[i, VELOCITY + d] + velocity[i, d])
            motion[i, DIMENSIONS + d] = velocity[i, d]
