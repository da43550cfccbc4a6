"""What particle j does to particle i: momentum, energy and velocity gradient (paper, Eqs. 5 and 6 corrected).

dx = x_i - x_j and dv = v_i - v_j are vectors, grad_i W = slope dx.
"""

from math import sqrt

from distfsi.physics.subset import static_range
from distfsi.physics.symbols import DIMENSIONS, VISCOSITY_ALPHA, VISCOSITY_BETA
from distfsi.physics.tensors import dot, rows, times


def approach_speed(dv, dx, distance2, h):
    """-phi of Eq. 6 [m/s] if the particles approach each other, else 0."""
    return max(-h * dot(dv, dx) / (distance2 + 0.01 * h * h), 0.0)


def viscosity(approach, sound_speed, density):
    """Monaghan's Pi [m5/(kg s2)] of an approach speed at the mean sound speed and density (Eq. 6)."""
    return approach * (VISCOSITY_ALPHA * sound_speed + VISCOSITY_BETA * approach) / density


def pair_acceleration(dx, slope, deviators, pressures, densities, Pi):
    """[(sigma_i + sigma_j)/(rho_i rho_j) - Pi] grad_i W [m/(s2 kg)] (Eq. 5b), odd in i and j to the bit.

    `deviators` and `pressures` are sums, `densities` is the product of both particles' values.
    """
    traction = times(rows(deviators), dx)
    isotropic = pressures / densities + Pi
    return tuple(slope * (traction[d] / densities - isotropic * dx[d]) for d in static_range(DIMENSIONS))


def pair_heating(dv, dx, slope, deviator, pressures, densities, Pi):
    """What a neighbour adds to de/dt per mass [W/kg2] (Eq. 5c): with mid-step velocities it balances Eq. 5b's work."""
    isotropic = 0.5 * (pressures / densities + Pi)
    return slope * (isotropic * dot(dv, dx) - dot(dv, times(rows(deviator), dx)) / densities)


def pair_gradient(dv, dx, slope, volume):
    """What a neighbour of `volume` [m^d] adds to the velocity gradient [1/s]."""
    weight = -volume * slope
    return tuple(tuple(weight * dv[a] * dx[b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


def stable_time(h, sound_speed, approach, acceleration):
    """Longest steps [s] that signals and the acceleration allow: Monaghan's conditions with safety 0.3.

    `approach` is the largest approach speed [m/s] among the neighbours.
    """
    signal = sound_speed + 0.6 * (VISCOSITY_ALPHA * sound_speed + VISCOSITY_BETA * approach)
    return (0.3 * h / signal, 0.3 * sqrt(h / max(sqrt(dot(acceleration, acceleration)), 1e-300)))
