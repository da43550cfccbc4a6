"""Strength of a solid: Jaumann rate, radial return, Johnson-Cook yield stress (paper, A.2-A.7).

The deviatoric stress is the tuple of its COMPONENTS (tensors.py); the normal stresses out of the plane share what makes
its trace vanish. `gradient` is the velocity gradient by rows, gradient[a][b] = dv_a/dx_b [1/s].
A material's `strength` is the tuple (shear_modulus, A, B, n, C, m, reference_rate, room_temperature, melt_temperature,
heat_capacity, taylor_quinney): no strength is shear_modulus = A = 0, elastic A = inf, perfectly plastic B = C = 0.
"""

from math import exp, log, pow, sqrt

from distfsi.physics.subset import static_range
from distfsi.physics.symbols import COMPONENTS, DIMENSIONS
from distfsi.physics.tensors import components, product, rows, trace, transposed


def half_rotation(gradient, dt):
    """Antisymmetric matrix whose Cayley transform turns by the spin times `dt`: tan(t/2) = t/2 (1 + t^2/12 + ...)."""
    half = 0.25 * dt
    spin = tuple(
        tuple(half * (gradient[a][b] - gradient[b][a]) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )
    tangent2 = 0.5 * sum(
        sum(spin[a][b] * spin[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS)
    )
    longer = 1.0 + tangent2 / 3.0
    return tuple(tuple(longer * spin[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


def rotation(gradient, dt):
    """Orthogonal matrix that turns by the spin times `dt` (Hughes-Winget, of fourth order in the angle)."""
    half = half_rotation(gradient, dt)
    square = product(half, half)
    factor = 2.0 / (1.0 - 0.5 * trace(square))
    return tuple(
        tuple((1.0 if a == b else 0.0) + factor * (half[a][b] + square[a][b]) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


def trial_deviator(deviator, gradient, shear_modulus, dt):
    """Elastic trial stress [Pa] after `dt` (A.3): turned with the material, then strained by Hooke's law."""
    turn = rotation(gradient, dt)
    turned = components(product(product(turn, rows(deviator)), transposed(turn)))
    mean = trace(gradient) / 3.0
    stretching = tuple(
        tuple(0.5 * (gradient[a][b] + gradient[b][a]) - (mean if a == b else 0.0) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )
    strain = components(stretching)
    return tuple(turned[c] + 2.0 * shear_modulus * dt * strain[c] for c in static_range(COMPONENTS))


def von_mises(deviator):
    """sqrt(3 J2) [Pa] with the stresses out of the plane (A.4)."""
    normal = sum(deviator[a] * deviator[a] for a in static_range(DIMENSIONS))
    shear = sum(deviator[c] * deviator[c] for c in static_range(DIMENSIONS, COMPONENTS))
    if DIMENSIONS < 3:
        along = sum(deviator[a] for a in static_range(DIMENSIONS))
        return sqrt(1.5 * (normal + along * along * (1.0 / (3 - DIMENSIONS))) + 3.0 * shear)
    return sqrt(1.5 * normal + 3.0 * shear)


def rate_factor(rate, strength):
    """1 + C ln(rate/reference), 1 below the reference rate (A.6); `rate` [1/s]."""
    return 1.0 + strength[4] * log(max(rate / strength[6], 1.0))


def softening(temperature, strength):
    """1 - T*^m with T* held within 0 and 1 (A.6, A.7); `temperature` [K]."""
    shear_modulus, A, B, n, C, m, reference_rate, room, melt, heat_capacity, taylor_quinney = strength
    return 1.0 - pow(min(max((temperature - room) / (melt - room), 0.0), 1.0), m)


def yield_stress(plastic_strain, rate, temperature, strength):
    """Johnson-Cook yield stress [Pa] (A.6)."""
    shear_modulus, A, B, n, C, m, reference_rate, room, melt, heat_capacity, taylor_quinney = strength
    return (A + B * pow(plastic_strain, n)) * rate_factor(rate, strength) * softening(temperature, strength)


def plastic_increment(trial, plastic_strain, temperature, dt, strength):
    """Increment x of equivalent plastic strain: trial - 3 G x = yield stress at strain + x, rate x/dt.

    Newton's method for log(x): there the residual is concave, so that it converges from above without a safeguard. The
    stress is within 1e-4 of the yield stress when a virgin particle first yields, far closer afterwards.
    """
    shear_modulus, A, B, n, C, m, reference_rate, room, melt, heat_capacity, taylor_quinney = strength
    soft = softening(temperature, strength)
    x = (trial - yield_stress(plastic_strain, 0.0, temperature, strength)) / (3.0 * shear_modulus)
    for _ in static_range(6):
        strain = plastic_strain + x
        hardening = B * pow(strain, n)
        faster = rate_factor(x / dt, strength)
        elastic = 3.0 * shear_modulus * x
        residual = trial - elastic - (A + hardening) * faster * soft
        rate_slope = (A + hardening) * C if x > reference_rate * dt else 0.0
        slope = elastic + soft * (n * hardening * x / strain * faster + rate_slope)
        x = x * exp(min(residual / slope, 0.0))
    return x


def plastic_heating(increment, stress, density, strength):
    """Temperature rise [K] of a plastic strain `increment` at the von Mises `stress`."""
    return strength[10] * stress * increment / (density * strength[9])
