"""Loops over the particles of one material: what a velocity gradient does to stress, temperature and damage.

A form of the solid gives each particle's velocity gradient at mid-step; all else here belongs to the material. The laws
are chosen by the scene (solid/materials.py): `eos_response`, `strength_response` and `failure_response` are formulas of
laws in laws/solid/, whose numbers come from a table with a row for each body.
"""

from math import log

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    COMPONENTS,
    DIMENSIONS,
    EOS_COLUMNS,
    EOS_FIELDS,
    FAILS,
    FAILURE_COLUMNS,
    FAILURE_FIELDS,
    POLAR_ROTATION,
    SCATTERED,
    STRENGTH_COLUMNS,
    STRENGTH_FIELDS,
    carried_share,
    elastic_density,
    eos_response,
    failure_response,
    free_swelling,
    homologous_temperature,
    strength_response,
)
from distfsi.formulas.tensors import trace
from distfsi.laws.law import EosMemory, FailureMemory, StrengthMemory
from distfsi.solid.formulas.rotation import polar_rotation, vorticity
from distfsi.solid.formulas.smoothing import dilated
from distfsi.solid.formulas.stress import (
    crack_energy,
    largest_principal,
    longitudinal_speed,
    stretching,
    trial_deviator,
    von_mises,
)
from distfsi.solid.kernels.matrices import matrix_of, store_tensor, tensor_of
from distfsi.solid.kernels.records import NEVER_BONDED, LawTables, MaterialPoints, RestState, Volumes


@helper
def spin_of(rates, stretch, i, dt):
    """Spin of the axes of stress; with polar rotation the stretch is advanced."""
    if POLAR_ROTATION:
        spin, after = polar_rotation(rates, tensor_of(stretch, i), dt)
        store_tensor(stretch, i, after)
        return spin
    return vorticity(rates)


@helper
def intact_deviator(point: MaterialPoints, law, damage, i):
    """Deviatoric stress of the intact material."""
    if FAILS:
        share = carried_share(law, point.pressure[i], damage)
        restored = 1.0 / share if share > 0.0 else 0.0
        return tuple(restored * point.deviator[i, c] for c in static_range(COMPONENTS))
    return tensor_of(point.deviator, i)


@helper
def grown_damage(laws: LawTables, memory: FailureMemory, width, own, load, dt, i):
    """Damage after a load, which the failure model remembers with all else."""
    law = tuple(laws.failure[own, k] for k in static_range(FAILURE_FIELDS))
    known = tuple(memory[k][i] for k in static_range(FAILURE_COLUMNS))
    found = failure_response(law, load, dt, width, known)
    for k in static_range(FAILURE_COLUMNS):
        memory[k][i] = found[k]
    return found[0]


@driver
def deform(
    begin,
    end,
    chosen,
    dt,
    gradient,
    point: MaterialPoints,
    rest: RestState,
    laws: LawTables,
    eos_memory: EosMemory,
    strength_memory: StrengthMemory,
    failure_memory: FailureMemory,
):
    """Advance density, smoothing length and all that a material remembers by `dt` of the velocity gradient, for the
    particles `chosen`."""
    for r in range(begin, end):
        i = chosen[r]
        own = point.body[i]
        eos = tuple(laws.eos[own, k] for k in static_range(EOS_FIELDS))
        strength = tuple(laws.strength[own, k] for k in static_range(STRENGTH_FIELDS))
        rates, shear_modulus = matrix_of(gradient, i), rest.shear_modulus[own]
        damage = failure_memory[0][i] if FAILS else 0.0

        # Volume.
        density, h = dilated(point.density[i], point.h[i], trace(rates), dt)
        point.density[i] = density
        point.h[i] = h

        # Pressure of the intact material.
        at_rest = (rest.density[own], rest.bulk_modulus[own])
        known = tuple(eos_memory[k][i] for k in static_range(EOS_COLUMNS))
        held = tuple(strength_memory[k][i] for k in static_range(STRENGTH_COLUMNS))
        state = eos_response(eos, elastic_density(strength, density, held), point.energy[i], at_rest, known)
        for k in static_range(EOS_COLUMNS):
            eos_memory[k][i] = state[3 + k]
        point.sound_speed[i] = longitudinal_speed(density, state[1], shear_modulus, rest.minimum_modulus[own])

        # Its deviatoric stress, as if it were elastic.
        spin = spin_of(rates, point.stretch, i, dt)
        stress = trial_deviator(intact_deviator(point, strength, damage, i), rates, spin, shear_modulus, dt)
        elastic = von_mises(stress)

        # Plastic flow brings it back to what the material bears.
        rate = 2.0 / 3.0 * von_mises(stretching(rates))
        compression = density / at_rest[0] - 1.0
        trial = (elastic, state[0], density, compression, state[1], at_rest[1], rate, state[2], damage)
        flowed = strength_response(strength, trial, dt, held)
        for k in static_range(STRENGTH_COLUMNS):
            strength_memory[k][i] = flowed[3 + k]
        pressure, increment = flowed[1], flowed[2]
        scale = flowed[0] / elastic if increment > 0.0 else 1.0

        # Damage, and the stress that is carried.
        carried, open_share = 1.0, 1.0
        if FAILS:
            principal = scale * largest_principal(stress) - pressure
            energy = crack_energy(scale * elastic, pressure, shear_modulus, at_rest[1])
            kept = tuple(flowed[3 + k] for k in static_range(STRENGTH_COLUMNS))
            heat = homologous_temperature(strength, kept)
            factor = point.strength_scatter[i] if SCATTERED else 1.0
            load = (increment, flowed[0], pressure, principal, energy, state[1], heat, factor)
            damage = grown_damage(laws, failure_memory, rest.crack_width[own], own, load, dt, i)
            open_share = 1.0 - damage
            carried = carried_share(strength, pressure, damage)
        for c in static_range(COMPONENTS):
            point.deviator[i, c] = carried * scale * stress[c]
        point.pressure[i] = pressure if pressure > 0.0 else open_share * pressure


@helper
def has_failed(damage, i):
    """Whether the material of a particle has failed."""
    if FAILS:
        return damage[i] >= 1.0
    return False


@driver
def open_voids(begin, end, chosen, dt, body, eos, energy, volumes: Volumes, bond_count, damage, gradient):
    """Failed particles and debris among the `chosen` swell until they have no pressure: what their surroundings give
    way beyond that is void, and must close again first. `eos` (bodies, …): the numbers of their laws."""
    for r in range(begin, end):
        i = chosen[r]
        if bond_count[i] == 0 or (has_failed(damage, i) and bond_count[i] != NEVER_BONDED):
            law = tuple(eos[body[i], k] for k in static_range(EOS_FIELDS))
            divergence = trace(matrix_of(gradient, i))
            # All growth of the volume so far and in this step, of which the material takes what it can.
            swollen = log(volumes.mass[i] / (volumes.volume[i] * volumes.density[i]))
            whole = swollen + volumes.void[i] + dt * divergence
            solid = min(whole, free_swelling(law, energy[i]))
            volumes.void[i] = whole - solid
            # The gradient becomes that of the material.
            growth = ((solid - swollen) / dt - divergence) / DIMENSIONS
            for d in static_range(DIMENSIONS):
                gradient[i, d * DIMENSIONS + d] += growth
