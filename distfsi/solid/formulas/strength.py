"""Strength of a solid: Hooke's law, radial return, Johnson-Cook yield stress (paper, A.2-A.7).

The deviatoric stress is the tuple of its COMPONENTS (tensors.py); the normal stresses out of the plane share what makes
its trace vanish. `gradient` is the velocity gradient by rows, gradient[a][b] = dv_a/dx_b [1/s].
A material's `strength` is the tuple (shear_modulus, A, B, n, C, m, reference_rate, room_temperature, melt_temperature,
heat_capacity, taylor_quinney): no strength is shear_modulus = A = 0, elastic A = inf, perfectly plastic B = C = 0,
linear hardening n = 1, C = 0.
"""

from math import exp, log, pow, sqrt

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import COMPONENTS, DIMENSIONS
from distfsi.formulas.tensors import components, product, rows, trace, transposed
from distfsi.solid.formulas.rotation import rotation


def stretching(gradient):
    """Deviator of the rate of strain [1/s], by components."""
    mean = trace(gradient) / 3.0
    return components(
        tuple(
            tuple(0.5 * (gradient[a][b] + gradient[b][a]) - (mean if a == b else 0.0) for b in static_range(DIMENSIONS))
            for a in static_range(DIMENSIONS)
        )
    )


def trial_deviator(deviator, gradient, spin, shear_modulus, dt):
    """Elastic trial stress [Pa] after `dt` (A.3): half of the strain (Hooke's law) comes before the stress is turned
    with the `spin` of its axes, half after."""
    strain = stretching(gradient)
    half = tuple(shear_modulus * dt * strain[c] for c in static_range(COMPONENTS))
    turn = rotation(spin, dt)
    strained = tuple(deviator[c] + half[c] for c in static_range(COMPONENTS))
    turned = components(product(product(turn, rows(strained)), transposed(turn)))
    return tuple(turned[c] + half[c] for c in static_range(COMPONENTS))


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


def homologous_temperature(temperature, strength):
    """T* (A.7), 0 at room temperature and 1 when molten, held in between; `temperature` [K]."""
    return min(max((temperature - strength[7]) / (strength[8] - strength[7]), 0.0), 1.0)


def softening(temperature, strength):
    """1 - T*^m (A.6)."""
    return 1.0 - pow(homologous_temperature(temperature, strength), strength[5])


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
