"""Loop of the material point: what a velocity gradient does to the stress, the pressure and the temperature."""

from distfsi.device.markers import driver, helper
from distfsi.physics.smoothing import dilated
from distfsi.physics.solid_eos import bulk_modulus, solid_pressure, solid_sound_speed
from distfsi.physics.strength import plastic_heating, plastic_increment, trial_deviator, von_mises, yield_stress
from distfsi.physics.subset import static_range
from distfsi.physics.symbols import COMPONENTS, DIMENSIONS
from distfsi.physics.tensors import trace

EOS_CONSTANTS, STRENGTH_CONSTANTS = 9, 11  # columns of the material tables


@helper
def matrix_of(A, i):
    """Matrix whose rows lie one after the other in A[i]."""
    return tuple(tuple(A[i, a * DIMENSIONS + b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


@driver
def deform(
    begin, end, dt, gradient, body, eos, strength, energy, density, h, deviator, strain, temperature, pressure, sound
):
    """Advance density, smoothing length, stress, plastic strain and temperature by `dt` of the velocity gradient.

    `eos` and `strength` hold one row of constants per body.
    """
    for i in range(begin, end):
        rates = matrix_of(gradient, i)
        law = tuple(eos[body[i], k] for k in static_range(EOS_CONSTANTS))
        metal = tuple(strength[body[i], k] for k in static_range(STRENGTH_CONSTANTS))
        density[i], h[i] = dilated(density[i], h[i], trace(rates), dt)

        stress = trial_deviator(tuple(deviator[i, c] for c in static_range(COMPONENTS)), rates, metal[0], dt)
        trial = von_mises(stress)
        scale = 1.0
        if trial > yield_stress(strain[i], 0.0, temperature[i], metal):
            increment = plastic_increment(trial, strain[i], temperature[i], dt, metal)
            flow = trial - 3.0 * metal[0] * increment
            scale = flow / trial
            strain[i] += increment
            temperature[i] += plastic_heating(increment, flow, density[i], metal)
        for c in static_range(COMPONENTS):
            deviator[i, c] = scale * stress[c]

        pressure[i] = solid_pressure(density[i], energy[i], law)
        bulk = bulk_modulus(density[i], energy[i], pressure[i], law)
        sound[i] = solid_sound_speed(density[i], bulk, metal[0], law)
