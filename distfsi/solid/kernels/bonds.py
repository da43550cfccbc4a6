"""Loops of the total Lagrangian form: strain, forces and energy of the bonds, and cutting them.

A particle's bonds are in the order of their partners' keys. `bond[i]` holds for each of them the vector g and the
weight w of solid/formulas/bonds.py, `partner[i]` the partner's row among a rank's own particles, ghosts and images.
`tension` (count, columns below) is what a force needs of a particle: stiffness, displacement, bond stress.
"""

from math import exp, log, sqrt

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import COMPONENTS, DIMENSIONS, FAILS
from distfsi.formulas.tensors import (
    contraction,
    determinant,
    dot,
    identity_plus,
    least_eigenvalue,
    product,
    scaled,
    times,
    trace,
)
from distfsi.solid.formulas.bonds import (
    LEAST_GROWTH,
    bond_stress,
    bulk_viscosity,
    crack_seen,
    is_face,
    largest_stretch,
    least_stretch,
    most_stretched,
    shocked_share,
    signal_time,
    unseen_share,
    whole_step,
    zero_energy_stiffness,
)
from distfsi.solid.formulas.pair import gradient_correction
from distfsi.solid.formulas.smoothing import smoothing_slope
from distfsi.solid.formulas.solid_eos import free_swelling
from distfsi.solid.kernels.material import EOS_CONSTANTS, matrix_of
from distfsi.solid.kernels.pairs import difference, no_matrix, plus, store_matrix

STIFFNESS, DISPLACEMENT = 0, 1  # columns of `tension`; behind them the bond stress
# Columns of `facts`: what ghosts are told besides.
VOLUME, BODY, DAMAGE, AROUND, LOOSE, EXPOSED, DEBRIS, PARTED, STRETCH, CRACK = range(10)
OPENED = 0.5  # spacings: an opening that neither end of a bond sees as its own stretch
LEAST_FITTED = 0.5  # of the volume that the material has: bonds on one side alone may make it any
FAR = 1e300  # m2: no crack is seen
SAME_FACE = 0.5  # cosine between the normals of particles at one face of a crack


@helper
def outer(a, b):
    """Matrix a b^T."""
    return tuple(tuple(a[m] * b[n] for n in static_range(DIMENSIONS)) for m in static_range(DIMENSIONS))


@helper
def times_bond(matrix, bond, i, n):
    """A matrix times the vector g of bond n of particle i."""
    return tuple(
        sum(matrix[a][b] * bond[i, n * (DIMENSIONS + 1) + b] for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


@helper
def bond_vector(bond, i, n):
    """The vector g of bond n of particle i."""
    return tuple(bond[i, n * (DIMENSIONS + 1) + d] for d in static_range(DIMENSIONS))


@helper
def bond_weight(bond, i, n):
    """The weight w of bond n of particle i."""
    return bond[i, n * (DIMENSIONS + 1) + DIMENSIONS]


# ---- the reference state --------------------------------------------------------------------------------------------


@driver
def find_partners(begin, end, key, bond_count, keys, rows, partner):
    """partner[i] = the rows of the bonds' keys, which ascend; `keys` ascend, `rows` are theirs. A row of -1: none."""
    for i in range(begin, end):
        low = 0
        for n in range(bond_count[i]):
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
def weigh(begin, end, reference, facts, size, body, bond_count, partner, bond):
    """bond[i] = vectors and weights of the bonds; `size` are the reference smoothing lengths of the bodies."""
    for i in range(begin, end):
        for n in range(bond_count[i]):
            j = partner[i, n]
            X = difference(reference, 0, j, i)
            w = -facts[j, VOLUME] * smoothing_slope(dot(X, X), size[body[i]])
            for d in static_range(DIMENSIONS):
                bond[i, n * (DIMENSIONS + 1) + d] = w * X[d]
            bond[i, n * (DIMENSIONS + 1) + DIMENSIONS] = w


@driver
def fit(begin, end, chosen, bond_count, partner, bond, reference, tension, correction, deformation, moments):
    """Row r: gradient correction and deformation gradient of particle chosen[r], from the bonds that it has.

    moments[r] = determinant and least eigenvalue of the moment of its bonds.
    """
    for r in range(begin, end):
        i = chosen[r]
        moment, total = no_matrix(), no_matrix()
        for n in range(bond_count[i]):
            j, g = partner[i, n], bond_vector(bond, i, n)
            moment = plus(moment, outer(difference(reference, 0, j, i), g))
            total = plus(total, outer(difference(tension, DISPLACEMENT, j, i), g))
        matrix = gradient_correction(moment)
        store_matrix(correction, r, matrix)
        store_matrix(deformation, r, identity_plus(1.0, product(total, matrix)))
        moments[r, 0] = determinant(moment)
        moments[r, 1] = least_eigenvalue(moment)


@driver
def keep_fit(
    begin, end, chosen, fitted, fitted_deformation, moments, least, exposed_below, mass, density, volume, void,
    correction, deformation, loose, exposed,
):  # fmt: skip
    """What fit() found of particle chosen[r], in row r, becomes its own, or it gets loose: too small a moment, or a
    fit that is crushed where the material is not."""
    for r in range(begin, end):
        i = chosen[r]
        growth = exp(void[i]) * mass[i] / (density[i] * volume[i])
        if moments[r, 1] > least and determinant(matrix_of(fitted_deformation, r)) > LEAST_FITTED * growth:
            for k in range(DIMENSIONS * DIMENSIONS):
                correction[i, k] = fitted[r, k]
                deformation[i, k] = fitted_deformation[r, k]
        else:
            loose[i] = 1
        if not (moments[r, 0] >= exposed_below):
            exposed[i] = 1


@helper
def crack_of(facts, i):
    """Vector from a particle to the plane of the crack beside it, 0 without."""
    return tuple(facts[i, CRACK + d] for d in static_range(DIMENSIONS))


@helper
def crack_opening(deformation, bond_count, partner, bond, reference, tension, spacing, i):
    """Vector to the crack of a particle that has failed: half a spacing along its most stretched direction, to the
    side where its bonds are stretched more; 0 where it has bonds on one side only."""
    axis = most_stretched(matrix_of(deformation, i))
    across = times(matrix_of(deformation, i), axis)
    ahead, behind, length2_ahead, length2_behind = 0.0, 0.0, 0.0, 0.0
    for n in range(bond_count[i]):
        j = partner[i, n]
        X, u = difference(reference, 0, j, i), difference(tension, DISPLACEMENT, j, i)
        w, along = bond_weight(bond, i, n), dot(X, axis)
        if along > 0.0:
            ahead += w * along * dot(u, across)
            length2_ahead += w * along * along
        else:
            behind += w * along * dot(u, across)
            length2_behind += w * along * along
    side = 0.5 * spacing if ahead * length2_behind > behind * length2_ahead else -0.5 * spacing
    side = side if min(length2_ahead, length2_behind) > 0.0 else 0.0
    return tuple(side * axis[d] for d in static_range(DIMENSIONS))


@driver
def crack(
    begin, end, spacing, size, body, bond_count, partner, bond, reference, tension, deformation, damage, facts, plane
):  # fmt: skip
    """plane[i] = vector, in the reference state, from a damaged particle to the plane of the crack beside it.

    Its partners' cracks count first, the nearest of those that it sees; then, if it has failed, its own. `facts` are
    those of the step before.
    """
    for i in range(begin, end):
        apart = spacing[body[i]]
        found = tuple(plane[i, d] for d in static_range(DIMENSIONS))
        if damage[i] > 0.0 and not is_face(found, apart):
            nearest = dot(found, found) if dot(found, found) > 0.0 else FAR
            for n in range(bond_count[i]):
                j = partner[i, n]
                X = difference(reference, 0, j, i)
                seen = crack_seen(X, crack_of(facts, j), apart, 2.0 * size[body[i]])
                if dot(seen, seen) > 0.0 and dot(seen, seen) < nearest:
                    found, nearest = seen, dot(seen, seen)
            if damage[i] >= 1.0 and not is_face(found, apart):
                own = crack_opening(deformation, bond_count, partner, bond, reference, tension, apart, i)
                found = own if dot(own, own) > 0.0 else found
            for d in static_range(DIMENSIONS):
                plane[i, d] = found[d]


@driver
def cut(begin, end, position, reference, spacing, body, facts, key, bond_count, partner, bond, parted, lost):
    """Cut the stretched bonds that cross a crack or whose ends have failed otherwise, and those of a loose particle.

    A bond beside damaged particles that is half a spacing longer than the stretch of either end makes it crosses a
    crack as well, one that has no face at its ends: it jumps from one row of particles to another, or its faces have
    become debris. The stretch of a failed end is the crack's and not the material's.

    lost[i] = how many bonds particle i has lost; the others keep their order. parted[i] = length of the shortest that
    it has ever lost.
    """
    for i in range(begin, end):
        kept = 0
        for n in range(bond_count[i]):
            j = partner[i, n]
            x, X = difference(position, 0, j, i), difference(reference, 0, j, i)
            mine, other = crack_of(facts, i), crack_of(facts, j)
            ahead, behind = dot(X, mine), -dot(X, other)
            mine2, other2 = dot(mine, mine), dot(other, other)
            faces = dot(mine, other) <= SAME_FACE * sqrt(mine2 * other2)
            beyond = (ahead > mine2 and mine2 > 0.0) or (behind > other2 and other2 > 0.0)
            crossed = beyond or (faces and min(ahead, behind) > 0.0)
            failed = min(facts[i, DAMAGE], facts[j, DAMAGE]) >= 1.0 and faces
            stretched = dot(x, x) > dot(X, X)
            widest = max(facts[i, STRETCH], facts[j, STRETCH]) * sqrt(dot(X, X)) + OPENED * spacing[body[i]]
            opened = min(facts[i, AROUND], facts[j, AROUND]) > 0.0 and dot(x, x) > widest * widest
            if not (((crossed or failed) and stretched) or opened or facts[i, LOOSE] > 0.0 or facts[j, LOOSE] > 0.0):
                if kept < n:
                    key[i, kept] = key[i, n]
                    partner[i, kept] = j
                    for d in range(DIMENSIONS + 1):
                        bond[i, kept * (DIMENSIONS + 1) + d] = bond[i, n * (DIMENSIONS + 1) + d]
                kept += 1
            else:
                parted[i] = min(parted[i], sqrt(dot(x, x)))
        for n in range(kept, bond_count[i]):
            key[i, n] = -1
        lost[i] = bond_count[i] - kept
        bond_count[i] = kept


# ---- what is told ---------------------------------------------------------------------------------------------------


@helper
def has_failed(damage, i):
    """Whether the material of a particle has failed."""
    if FAILS:
        return damage[i] >= 1.0
    return False


@helper
def own_stretch(deformation, damage, i):
    """Largest stretch of the material of a particle; what a failed one sees besides is the opening of cracks."""
    if FAILS:
        return largest_stretch(matrix_of(deformation, i)) if damage[i] < 1.0 else 1.0
    return 1.0


@driver
def mark_damaged(begin, end, damage, mark):
    """mark[i] = 1 where a particle is damaged, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if damage[i] > 0.0 else 0


@driver
def look_around(begin, end, bond_count, partner, facts, around):
    """around[i] = largest damage of a particle and its partners so far; springs once let go are not pressed again."""
    for i in range(begin, end):
        largest = max(around[i], facts[i, DAMAGE])
        for n in range(bond_count[i]):
            largest = max(largest, facts[partner[i, n], DAMAGE])
        around[i] = largest


@driver
def mark_parted(begin, end, bond_count, loose, damage, mark):
    """mark[i] = 1 where a particle has failed, is loose or debris, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if has_failed(damage, i) or loose[i] > 0 or bond_count[i] == 0 else 0


@driver
def mark_cut(begin, end, lost, mark):
    """mark[i] = 1 where a particle has lost bonds, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if lost[i] > 0 else 0


@driver
def mark_debris(begin, end, facts, mark):
    """mark[i] = 1 for debris, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if facts[i, DEBRIS] > 0.0 else 0


@driver
def tell(begin, end, volume, body, around, loose, exposed, bond_count, parted, deformation, crack, damage, facts):
    """facts[i] = what others must know of a particle, in the columns above."""
    for i in range(begin, end):
        facts[i, VOLUME] = volume[i]
        facts[i, BODY] = 1.0 * body[i]
        facts[i, DAMAGE] = damage[i] if FAILS else 0.0
        facts[i, AROUND] = around[i]
        facts[i, LOOSE] = 1.0 if loose[i] > 0 else 0.0
        facts[i, EXPOSED] = 1.0 if exposed[i] > 0 else 0.0
        facts[i, DEBRIS] = 1.0 if bond_count[i] == 0 else 0.0
        facts[i, PARTED] = parted[i]
        facts[i, STRETCH] = own_stretch(deformation, damage, i)
        for d in static_range(DIMENSIONS):
            facts[i, CRACK + d] = crack[i, d]


# ---- a step ---------------------------------------------------------------------------------------------------------


@driver
def stress_bonds(
    begin, end, body, strength, density, sound, strain, deviator, pressure, viscous, correction, deformation, position,
    reference, loose, around, tension,
):  # fmt: skip
    """tension[i] = stiffness, displacement and bond stress of particle i. Where bonds cross a crack, what is unseen is
    its opening; the bonds of a loose particle no longer determine its strain."""
    for i in range(begin, end):
        damage = around[i] if FAILS else 0.0
        shear_modulus, flow_stress = strength[body[i], 0], strength[body[i], 1]
        kappa = zero_energy_stiffness(density[i], sound[i], strain[i], damage, shear_modulus, flow_stress)
        S = tuple(deviator[i, c] for c in static_range(COMPONENTS))
        stress = bond_stress(S, pressure[i] + viscous[i], matrix_of(deformation, i), matrix_of(correction, i), kappa)
        tension[i, STIFFNESS] = 0.0 if loose[i] > 0 else kappa
        for a in static_range(DIMENSIONS):
            tension[i, DISPLACEMENT + a] = position[i, a] - reference[i, a]
            for b in static_range(DIMENSIONS):
                tension[i, 1 + DIMENSIONS + a * DIMENSIONS + b] = 0.0 if loose[i] > 0 else stress[a][b]


@helper
def stress_of(tension, i):
    """Bond stress of particle i."""
    return tuple(
        tuple(tension[i, 1 + DIMENSIONS + a * DIMENSIONS + b] for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


@driver
def pull(begin, end, bond_count, partner, bond, tension, volume, mass, acceleration):
    """Add to acceleration[i] that of the bonds."""
    for i in range(begin, end):
        own, kappa = stress_of(tension, i), tension[i, STIFFNESS]
        force = tuple(0.0 for _ in static_range(DIMENSIONS))
        for n in range(bond_count[i]):
            j = partner[i, n]
            stress = times_bond(plus(own, stress_of(tension, j)), bond, i, n)
            spring = (kappa + tension[j, STIFFNESS]) * bond_weight(bond, i, n)
            u = difference(tension, DISPLACEMENT, j, i)
            force = tuple(force[d] + (stress[d] + spring * u[d]) for d in static_range(DIMENSIONS))
        for d in static_range(DIMENSIONS):
            acceleration[i, d] += volume[i] / mass[i] * force[d]


@driver
def stretch(
    begin, end, dt, bond_count, partner, bond, tension, motion, volume, mass, correction, h, density, sound,
    around, deformation, energy, viscous, gradient, loose
):  # fmt: skip
    """Advance energy and deformation gradient by `dt`; gradient[i] = the velocity gradient of the step.

    A particle that would be crushed to a tenth or turned inside out keeps its deformation and becomes loose.

    `motion` (count, 2 D) holds the means of old and new velocities, with which kinetic and internal energy exchange
    exactly, and the new velocities, which strain the bonds.
    """
    for i in range(begin, end):
        if bond_count[i] > 0:
            moved, meant, sprung, relative2 = no_matrix(), no_matrix(), 0.0, 0.0
            for n in range(bond_count[i]):
                j, g, w = partner[i, n], bond_vector(bond, i, n), bond_weight(bond, i, n)
                dv, mean = difference(motion, DIMENSIONS, j, i), difference(motion, 0, j, i)
                moved, meant = plus(moved, outer(dv, g)), plus(meant, outer(mean, g))
                sprung += w * dot(difference(tension, DISPLACEMENT, j, i), mean)
                relative2 += w * dot(dv, dv)
            power = contraction(stress_of(tension, i), meant) + tension[i, STIFFNESS] * sprung
            energy[i] += dt * volume[i] / mass[i] * power
            before, fitted = matrix_of(deformation, i), product(moved, matrix_of(correction, i))
            after = plus(before, scaled(dt, fitted))
            if determinant(after) > LEAST_GROWTH * determinant(before):
                rates = whole_step(before, after, dt)
                store_matrix(deformation, i, after)
                store_matrix(gradient, i, rates)
                unseen, shocked = unseen_share(fitted, moved, relative2), shocked_share(trace(rates), h[i], sound[i])
                share = shocked if FAILS and around[i] > 0.0 else unseen
                viscous[i] = bulk_viscosity(trace(rates), density[i], h[i], sound[i], share)
            else:
                loose[i] = 1


@driver
def bound(begin, end, bond_count, size, body, sound, viscous, density, deformation, acceleration, limits):
    """limits[i] = the time steps that a bonded particle allows."""
    for i in range(begin, end):
        if bond_count[i] > 0:
            shortest = size[body[i]] * least_stretch(matrix_of(deformation, i))
            a = tuple(acceleration[i, d] for d in static_range(DIMENSIONS))
            limits[i, 0] = signal_time(shortest, sound[i], viscous[i], density[i])
            limits[i, 1] = 0.3 * sqrt(shortest / max(sqrt(dot(a, a)), 1e-300))


@driver
def open_voids(begin, end, dt, body, eos, energy, volume, mass, density, bond_count, damage, void, gradient):
    """Failed particles swell until they have no pressure: what their surroundings give way beyond that is void, and
    must close again first."""
    for i in range(begin, end):
        if has_failed(damage, i) or bond_count[i] == 0:
            law = tuple(eos[body[i], k] for k in static_range(EOS_CONSTANTS))
            divergence = trace(matrix_of(gradient, i))
            swollen = log(mass[i] / (volume[i] * density[i]))
            whole = swollen + void[i] + dt * divergence
            solid = min(whole, free_swelling(energy[i], law))
            void[i] = whole - solid
            growth = ((solid - swollen) / dt - divergence) / DIMENSIONS
            for d in static_range(DIMENSIONS):
                gradient[i, d * DIMENSIONS + d] += growth
