"""Loop of the material point: what a velocity gradient does to the stress, the temperature and the damage.

A form of the solid (updated or total Lagrangian) gives each particle's velocity gradient at mid-step; all else here
belongs to the material. solid/materials.py declares the tables and columns.
"""

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import COMPONENTS, CONCRETE, FAILS, POLAR_ROTATION
from distfsi.formulas.tensors import trace
from distfsi.solid.formulas.concrete import (
    compacted_strain,
    concrete_pressure,
    concrete_strength,
    concrete_wear,
    unloading_modulus,
)
from distfsi.solid.formulas.damage import crack_share, ductile_wear, elastic_energy, largest_principal, tensile_damage
from distfsi.solid.formulas.rotation import polar_rotation, vorticity
from distfsi.solid.formulas.smoothing import dilated
from distfsi.solid.formulas.solid_eos import bulk_modulus, solid_pressure, solid_sound_speed
from distfsi.solid.formulas.strength import (
    homologous_temperature,
    plastic_heating,
    plastic_increment,
    stretching,
    trial_deviator,
    von_mises,
    yield_stress,
)
from distfsi.solid.kernels.matrices import matrix_of, tensor_of

EOS_CONSTANTS, STRENGTH_CONSTANTS, FAILURE_CONSTANTS, CONCRETE_CONSTANTS = 9, 11, 9, 20  # columns of the tables
COMPRESSIVE_STRENGTH = 8  # of concrete


@helper
def spin_of(rates, stretch, i, dt):
    """Spin of the axes of stress; with polar rotation the stretch is advanced."""
    if POLAR_ROTATION:
        spin, after = polar_rotation(rates, tensor_of(stretch, i), dt)
        for c in static_range(COMPONENTS):
            stretch[i, c] = after[c]
        return spin
    return vorticity(rates)


@driver
def deform(
    begin, end, dt, gradient, body, eos, strength, failure, concrete, energy, density, h, deviator, plastic_strain,
    temperature, pressure, sound_speed, damage, wear, toughness, compression, stretch,
):  # fmt: skip
    """Advance density, smoothing length and all that a material remembers by `dt` of the velocity gradient.

    `eos`, `strength`, `failure` and `concrete` hold one row of constants per body. `deviator` and `pressure` are what
    the particle carries: the stress of the intact material times 1 - damage, pressure only in tension.
    """
    for i in range(begin, end):
        rates, own = matrix_of(gradient, i), body[i]
        density[i], h[i] = dilated(density[i], h[i], trace(rates), dt)
        law = tuple(eos[own, k] for k in static_range(EOS_CONSTANTS))
        metal = tuple(strength[own, k] for k in static_range(STRENGTH_CONSTANTS))
        spin = spin_of(rates, stretch, i, dt)
        before = intact_deviator(deviator, pressure, damage, concrete, own, i)
        stress = trial_deviator(before, rates, spin, metal[0], dt)
        p, scale, is_concrete = 0.0, 1.0, False
        if CONCRETE:
            is_concrete = concrete[own, COMPRESSIVE_STRENGTH] > 0.0
            if is_concrete:
                rate = 2.0 / 3.0 * von_mises(stretching(rates))
                p, scale = crush(
                    i, own, rate, stress, law, metal[0], concrete, density, plastic_strain, sound_speed, damage, wear,
                    compression,
                )  # fmt: skip
        if not is_concrete:
            p, scale = flow(
                i, own, dt, stress, law, metal, failure, energy, density, plastic_strain, temperature, sound_speed,
                damage, wear, toughness,
            )  # fmt: skip
        carry(i, own, p, scale, stress, law, metal[0], failure, concrete, deviator, pressure, damage, toughness)


@helper
def intact_deviator(deviator, pressure, damage, concrete, own, i):
    """Deviatoric stress of the intact material."""
    if FAILS:
        share = carried_share(pressure[i], damage[i], concrete, own)
        restored = 1.0 / share if share > 0.0 else 0.0
        return tuple(restored * deviator[i, c] for c in static_range(COMPONENTS))
    return tensor_of(deviator, i)


@helper
def carried_share(p, D, concrete, own):
    """What share of the intact material's deviator is carried; closed cracks in concrete carry it by friction."""
    if CONCRETE:
        return 1.0 if p >= 0.0 and concrete[own, COMPRESSIVE_STRENGTH] > 0.0 else 1.0 - D
    return 1.0 - D


@helper
def flow(
    i,
    own,
    dt,
    stress,
    law,
    metal,
    failure,
    energy,
    density,
    plastic_strain,
    temperature,
    sound_speed,
    damage,
    wear,
    toughness,
):
    """Metal: radial return and equation of state; pressure [Pa] and the factor that returns the trial `stress`."""
    trial = von_mises(stress)
    increment, level = 0.0, trial
    if trial > yield_stress(plastic_strain[i], 0.0, temperature[i], metal):
        increment = plastic_increment(trial, plastic_strain[i], temperature[i], dt, metal)
        level = trial - 3.0 * metal[0] * increment
        plastic_strain[i] += increment
        share = 1.0 - damage[i] if FAILS else 1.0
        temperature[i] += plastic_heating(increment, share * level, density[i], metal)
    p = solid_pressure(density[i], energy[i], law)
    bulk = bulk_modulus(density[i], energy[i], p, law)
    sound_speed[i] = solid_sound_speed(density[i], bulk, metal[0], law)
    if FAILS:
        fracture = tuple(failure[own, k] for k in static_range(FAILURE_CONSTANTS))
        heat = homologous_temperature(temperature[i], metal)
        if increment > 0.0 and wear[i] < 1.0:
            wear[i] = min(wear[i] + ductile_wear(increment, p, level, dt, heat, toughness[i], fracture), 1.0)
        if wear[i] >= 1.0:
            tension = min(p, 0.0)
            wear[i] = min(wear[i] + crack_share(increment * level, fracture), 2.0)
            stored = crack_share(0.5 * tension * tension / bulk, fracture)
            damage[i] = max(damage[i], min(wear[i] - 1.0 + stored, 1.0))
    return (p, level / trial if increment > 0.0 else 1.0)


@helper
def crush(
    i, own, rate, stress, law, shear_modulus, concrete, density, plastic_strain, sound_speed, damage, wear, compression
):
    """Concrete: compaction, pressure-dependent yield, wear; pressure and factor as `flow`. `rate` [1/s] of strain."""
    stone = tuple(concrete[own, k] for k in static_range(CONCRETE_CONSTANTS))
    mu = density[i] / law[0] - 1.0
    before = compacted_strain(compression[i], stone)
    compression[i] = max(compression[i], mu)
    p = concrete_pressure(mu, compression[i], wear[i], stone)
    bulk = (1.0 + mu) * unloading_modulus(compression[i], stone)
    sound_speed[i] = solid_sound_speed(density[i], bulk, shear_modulus, law)

    trial = von_mises(stress)
    cracked = damage[i] if p > 0.0 else 0.0  # in tension the carried share counts the crack already
    level = concrete_strength(p, rate, max(wear[i], cracked), stone)
    increment = max(trial - level, 0.0) / (3.0 * shear_modulus)
    plastic_strain[i] += increment
    closed = compacted_strain(compression[i], stone) - before
    wear[i] = min(wear[i] + concrete_wear(increment, closed, p, stone), 1.0)
    return (p, level / trial if increment > 0.0 else 1.0)


@helper
def carry(i, own, p, scale, stress, law, shear_modulus, failure, concrete, deviator, pressure, damage, toughness):
    """Store the stress that is carried, after cracks have grown under the largest principal stress."""
    share, open_share = 1.0, 1.0
    if FAILS:
        fracture = tuple(failure[own, k] for k in static_range(FAILURE_CONSTANTS))
        principal = scale * largest_principal(stress) - p
        mises, tension = scale * von_mises(stress), max(-p, 0.0)
        work = elastic_energy(mises, tension, shear_modulus, law[0] * law[1] * law[1])
        damage[i] = max(damage[i], tensile_damage(principal, work, toughness[i], fracture))
        open_share = 1.0 - damage[i]
        share = carried_share(p, damage[i], concrete, own)
    for c in static_range(COMPONENTS):
        deviator[i, c] = share * scale * stress[c]
    pressure[i] = p if p > 0.0 else open_share * p
