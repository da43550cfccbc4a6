"""Loops of the total Lagrangian form: bonds in the reference state, and what they do in a step.

The payload and the packed state of bonds have the columns of records.py.
"""

from math import exp, sqrt

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, FAILS, YIELDS
from distfsi.formulas.tensors import (
    contraction,
    determinant,
    dot,
    identity_plus,
    minimum_eigenvalue,
    product,
    scaled,
    trace,
)
from distfsi.solid.formulas.bonds import (
    MINIMUM_GROWTH,
    bond_stress,
    bulk_viscosity,
    maximum_stretch,
    minimum_stretch,
    shocked_share,
    signal_time,
    unseen_share,
    whole_step,
    zero_energy_stiffness,
)
from distfsi.solid.formulas.pair import gradient_correction
from distfsi.solid.formulas.smoothing import smoothing_slope
from distfsi.solid.kernels.matrices import (
    difference,
    matrix_of,
    matrix_sum,
    outer_product,
    store_matrix,
    tensor_of,
    vector_of,
    zero_matrix,
    zero_vector,
)
from distfsi.solid.kernels.records import (
    BODY,
    CRACK,
    DAMAGE,
    DETACHING,
    DISPLACEMENT,
    EXPOSED,
    NEIGHBOURHOOD_DAMAGE,
    RIGID,
    RUPTURE_LENGTH,
    STIFFNESS,
    STRETCH,
    UNBONDED,
    VOLUME,
    Bodies,
    BondedMaterial,
    BondedPoint,
    Bonds,
    Cohesion,
    Fit,
    RestState,
    StrainResult,
    Volumes,
)

EXPOSED_BELOW = 0.75  # determinant of the moment of a particle's bonds, 1 inside a body
DETACHING_BELOW = 0.1  # smallest eigenvalue of the moment, below which the gradient's correction fades
FLAT = 2.0  # shortest principal stretches to which viscosity sees a particle: with more it swings from step to step
CRUSHED = 0.055  # shortest principal stretch, below which a particle detaches
MINIMUM_FITTED = 0.5  # of the volume that the material has: bonds on one side alone may make it any


# ---- a bond ----------------------------------------------------------------------------------------------------------


@helper
def bond_vector(bonds: Bonds, i, n):
    """The vector g of bond n of particle i."""
    return tuple(bonds.geometry[i, n * (DIMENSIONS + 1) + d] for d in static_range(DIMENSIONS))


@helper
def bond_weight(bonds: Bonds, i, n):
    """The weight w of bond n of particle i."""
    return bonds.geometry[i, n * (DIMENSIONS + 1) + DIMENSIONS]


@helper
def times_bond(matrix, bonds: Bonds, i, n):
    """A matrix times the vector g of bond n of particle i."""
    return tuple(
        sum(matrix[a][b] * bonds.geometry[i, n * (DIMENSIONS + 1) + b] for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


@helper
def bond_stress_of(bond_state, i):
    """Bond stress of particle i."""
    return tuple(
        tuple(bond_state[i, 1 + DIMENSIONS + a * DIMENSIONS + b] for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


# ---- the reference state --------------------------------------------------------------------------------------------


@driver
def find_partners(begin, end, key, bond_count, keys, rows, partner):
    """partner[i] = the rows of the bonds' keys, which ascend; `keys` ascend, `rows` are theirs. A row of -1: none."""
    for i in range(begin, end):
        low = 0
        for n in range(bond_count[i]):
            # Ever longer strides forward from the partner before, then bisection of the last one.
            stride = 1
            while low + stride < len(keys) and keys[low + stride] <= key[i, n]:
                low += stride
                stride *= 2
            high = min(low + stride, len(keys))
            while high - low > 1:
                middle = (low + high) // 2
                if keys[middle] <= key[i, n]:
                    low = middle
                else:
                    high = middle
            partner[i, n] = rows[low] if keys[low] == key[i, n] else -1


@driver
def weigh_bonds(begin, end, reference, payload, smoothing, bonds: Bonds):
    """Vectors and weights of the bonds, with the mean smoothing length (count,) of both ends."""
    for i in range(begin, end):
        for n in range(bonds.count[i]):
            j = bonds.partner[i, n]
            X = difference(reference, 0, j, i)
            w = -payload[j, VOLUME] * smoothing_slope(dot(X, X), 0.5 * (smoothing[i] + smoothing[j]))
            for d in static_range(DIMENSIONS):
                bonds.geometry[i, n * (DIMENSIONS + 1) + d] = w * X[d]
            bonds.geometry[i, n * (DIMENSIONS + 1) + DIMENSIONS] = w


@driver
def fit_bonds(begin, end, chosen, bonds: Bonds, reference, bond_state, fit: Fit, moments):
    """Row r: gradient correction and deformation gradient of particle chosen[r], from the bonds that it has.

    moments[r] = determinant and smallest eigenvalue of the moment of its bonds.
    """
    for r in range(begin, end):
        i = chosen[r]
        moment, total = zero_matrix(), zero_matrix()
        for n in range(bonds.count[i]):
            j, g = bonds.partner[i, n], bond_vector(bonds, i, n)
            moment = matrix_sum(moment, outer_product(difference(reference, 0, j, i), g))
            total = matrix_sum(total, outer_product(difference(bond_state, DISPLACEMENT, j, i), g))
        matrix = gradient_correction(moment)
        store_matrix(fit.correction, r, matrix)
        store_matrix(fit.deformation, r, identity_plus(1.0, product(total, matrix)))
        moments[r, 0] = determinant(moment)
        moments[r, 1] = minimum_eigenvalue(moment)


@driver
def accept_fit(begin, end, chosen, found: Fit, moments, volumes: Volumes, fit: Fit, detaching, exposed):
    """What fit_bonds() found of particle chosen[r], in row r, becomes its own, or it detaches: too small a moment, or a
    fit that is crushed where the material is not."""
    for r in range(begin, end):
        i = chosen[r]
        growth = exp(volumes.void[i]) * volumes.mass[i] / (volumes.density[i] * volumes.volume[i])
        fitted = determinant(matrix_of(found.deformation, r))
        if moments[r, 1] > DETACHING_BELOW and fitted > MINIMUM_FITTED * growth:
            for k in range(DIMENSIONS * DIMENSIONS):
                fit.correction[i, k] = found.correction[r, k]
                fit.deformation[i, k] = found.deformation[r, k]
        else:
            detaching[i] = 1
        if not (moments[r, 0] >= EXPOSED_BELOW):
            exposed[i] = 1


# ---- what others must know ------------------------------------------------------------------------------------------


@helper
def own_stretch(deformation, damage, i):
    """Largest stretch of the material of a particle; what a failed one sees besides is the opening of cracks."""
    if FAILS:
        return maximum_stretch(matrix_of(deformation, i)) if damage[i] < 1.0 else 1.0
    return 1.0


@driver
def pack_payload(begin, end, volume, body, cohesion: Cohesion, deformation, damage, payload):
    """payload[i] = what ghosts of a particle must know besides the state."""
    for i in range(begin, end):
        payload[i, VOLUME] = volume[i]
        payload[i, BODY] = 1.0 * body[i]
        payload[i, DAMAGE] = damage[i] if FAILS else 0.0
        payload[i, NEIGHBOURHOOD_DAMAGE] = cohesion.neighbourhood_damage[i]
        payload[i, DETACHING] = 1.0 if cohesion.detaching[i] > 0 else 0.0
        payload[i, EXPOSED] = 1.0 if cohesion.exposed[i] > 0 else 0.0
        unbonded = cohesion.bond_count[i] <= 0 and cohesion.bond_count[i] != RIGID
        payload[i, UNBONDED] = 1.0 if unbonded else 0.0
        payload[i, RUPTURE_LENGTH] = cohesion.rupture_length[i]
        payload[i, STRETCH] = own_stretch(deformation, damage, i)
        for d in static_range(DIMENSIONS):
            payload[i, CRACK + d] = cohesion.crack[i, d]


@driver
def pack_bond_state(
    begin, end, rest: RestState, material: BondedMaterial, fit: Fit, position, reference, cohesion: Cohesion, bond_state
):
    """bond_state[i] = stiffness, displacement and bond stress of particle i. Where bonds cross a crack, what is unseen
    is its opening; the bonds of a particle that detaches no longer determine its strain."""
    for i in range(begin, end):
        # Stiffness against what the deformation gradient does not see.
        damage = cohesion.neighbourhood_damage[i] if FAILS else 0.0
        strain = material.plastic_strain[i] if YIELDS else 0.0
        body = material.body[i]
        shear_modulus, flow_stress = rest.shear_modulus[body], rest.flow_stress[body]
        density, sound_speed, detaching = material.density[i], material.sound_speed[i], cohesion.detaching[i] > 0
        kappa = zero_energy_stiffness(density, sound_speed, strain, damage, shear_modulus, flow_stress)
        # Stress in the reference state, corrected.
        pressure = material.pressure[i] + material.viscous_pressure[i]
        deformation, correction = matrix_of(fit.deformation, i), matrix_of(fit.correction, i)
        stress = bond_stress(tensor_of(material.deviator, i), pressure, deformation, correction, kappa)
        bond_state[i, STIFFNESS] = 0.0 if detaching else kappa
        for a in static_range(DIMENSIONS):
            bond_state[i, DISPLACEMENT + a] = position[i, a] - reference[i, a]
            for b in static_range(DIMENSIONS):
                bond_state[i, 1 + DIMENSIONS + a * DIMENSIONS + b] = 0.0 if detaching else stress[a][b]


# ---- a step ---------------------------------------------------------------------------------------------------------


@driver
def accelerate_bonds(begin, end, bonds: Bonds, bond_state, volume, mass, acceleration):
    """Add to acceleration[i] that of the bonds."""
    for i in range(begin, end):
        own, kappa = bond_stress_of(bond_state, i), bond_state[i, STIFFNESS]
        force = zero_vector()
        for n in range(bonds.count[i]):
            j = bonds.partner[i, n]
            stress = times_bond(matrix_sum(own, bond_stress_of(bond_state, j)), bonds, i, n)
            spring = (kappa + bond_state[j, STIFFNESS]) * bond_weight(bonds, i, n)
            u = difference(bond_state, DISPLACEMENT, j, i)
            force = tuple(force[d] + (stress[d] + spring * u[d]) for d in static_range(DIMENSIONS))
        for d in static_range(DIMENSIONS):
            acceleration[i, d] += volume[i] / mass[i] * force[d]


@driver
def strain_bonds(begin, end, dt, bonds: Bonds, bond_state, motion, point: BondedPoint, fit: Fit, result: StrainResult):
    """Advance energy and deformation gradient by `dt`; result.gradient[i] = the velocity gradient of the step.

    A particle that would be crushed to a tenth or turned inside out keeps its deformation and detaches.

    `motion` (count, 2 D) holds the means of old and new velocities, with which kinetic and internal energy exchange
    exactly, and the new velocities, which strain the bonds.
    """
    for i in range(begin, end):
        if bonds.count[i] > 0:
            # Sums over the bonds: relative motion, and the motion that springs resist.
            moved, meant, sprung, relative2 = zero_matrix(), zero_matrix(), 0.0, 0.0
            for n in range(bonds.count[i]):
                j, g, w = bonds.partner[i, n], bond_vector(bonds, i, n), bond_weight(bonds, i, n)
                dv, mean = difference(motion, DIMENSIONS, j, i), difference(motion, 0, j, i)
                moved, meant = matrix_sum(moved, outer_product(dv, g)), matrix_sum(meant, outer_product(mean, g))
                sprung += w * dot(difference(bond_state, DISPLACEMENT, j, i), mean)
                relative2 += w * dot(dv, dv)
            # Energy: the work of the bonds' forces.
            power = contraction(bond_stress_of(bond_state, i), meant) + bond_state[i, STIFFNESS] * sprung
            result.energy[i] += dt * point.volume[i] / point.mass[i] * power
            # Deformation, if it can be.
            before, fitted = matrix_of(fit.deformation, i), product(moved, matrix_of(fit.correction, i))
            after = matrix_sum(before, scaled(dt, fitted))
            if determinant(after) > MINIMUM_GROWTH * determinant(before):
                rates = whole_step(before, after, dt)
                store_matrix(fit.deformation, i, after)
                store_matrix(result.gradient, i, rates)
                # Viscosity of the next step.
                density, sound_speed = point.density[i], point.sound_speed[i]
                size = point.h[i] * min(FLAT * minimum_stretch(after), 1.0)
                unseen, shocked = unseen_share(fitted, moved, relative2), shocked_share(trace(rates), size, sound_speed)
                share = shocked if FAILS and point.neighbourhood_damage[i] > 0.0 else unseen
                result.viscous_pressure[i] = bulk_viscosity(trace(rates), density, size, sound_speed, share)
            else:
                result.detaching[i] = 1


@driver
def limit_bonds(
    begin, end, bond_count, bodies: Bodies, material: BondedMaterial, deformation, acceleration, detaching, limits
):
    """limits[i] = the time steps that a bonded particle allows. One that is crushed flat detaches: its bonds tell no
    more of the material, and would hold up all others."""
    for i in range(begin, end):
        if bond_count[i] > 0:
            stretch = minimum_stretch(matrix_of(deformation, i))
            if stretch < CRUSHED:
                detaching[i] = 1
            shortest = bodies.smoothing[material.body[i]] * stretch
            a = vector_of(acceleration, i)
            sound_speed, viscous_pressure = material.sound_speed[i], material.viscous_pressure[i]
            limits[i, 0] = signal_time(shortest, sound_speed, viscous_pressure, material.density[i])
            limits[i, 1] = 0.3 * sqrt(shortest / max(sqrt(dot(a, a)), 1e-300))
