"""Loops of the total Lagrangian form where the material fails: cracks, the bonds that they cut, debris."""

from math import sqrt

from distfsi.device.markers import driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import COMPONENTS, DIMENSIONS
from distfsi.formulas.tensors import dot, times
from distfsi.solid.formulas.bonds import crack_seen, is_face, maximum_stretch_direction
from distfsi.solid.kernels.bonds import bond_weight
from distfsi.solid.kernels.material import has_failed
from distfsi.solid.kernels.matrices import difference, matrix_of, store_vector, vector_of
from distfsi.solid.kernels.records import (
    CRACK,
    DAMAGE,
    DETACHING,
    DISPLACEMENT,
    NEIGHBOURHOOD_DAMAGE,
    NEVER_BONDED,
    STRETCH,
    UNBONDED,
    Bodies,
    Bonds,
)

OPENED = 0.5  # spacings: an opening that neither end of a bond sees as its own stretch
FAR = 1e300  # m2: no crack is seen
SAME_FACE = 0.5  # cosine between the normals of particles at one face of a crack


# ---- marks -----------------------------------------------------------------------------------------------------------


@driver
def mark_damaged(begin, end, damage, mark):
    """mark[i] = 1 where a particle is damaged, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if damage[i] > 0.0 else 0


@driver
def mark_breaking(begin, end, bond_count, detaching, damage, mark):
    """mark[i] = 1 where a particle that has or had bonds has failed, detaches or is debris, else 0."""
    for i in range(begin, end):
        breaking = has_failed(damage, i) or detaching[i] > 0 or bond_count[i] == 0
        mark[i] = 1 if breaking and bond_count[i] != NEVER_BONDED else 0


@driver
def mark_cut(begin, end, lost, mark):
    """mark[i] = 1 where a particle has lost bonds, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if lost[i] > 0 else 0


@driver
def mark_unbonded(begin, end, payload, mark):
    """mark[i] = 1 for debris and particles of bodies without bonds, else 0."""
    for i in range(begin, end):
        mark[i] = 1 if payload[i, UNBONDED] > 0.0 else 0


@driver
def spread_damage(begin, end, bonds: Bonds, payload, neighbourhood_damage):
    """neighbourhood_damage[i] = largest damage of a particle and its partners so far; springs once let go are not
    pressed again."""
    for i in range(begin, end):
        largest = max(neighbourhood_damage[i], payload[i, DAMAGE])
        for n in range(bonds.count[i]):
            largest = max(largest, payload[bonds.partner[i, n], DAMAGE])
        neighbourhood_damage[i] = largest


# ---- cracks ----------------------------------------------------------------------------------------------------------


@helper
def crack_of(payload, i):
    """Vector from a particle to the plane of the crack beside it, 0 without."""
    return tuple(payload[i, CRACK + d] for d in static_range(DIMENSIONS))


@helper
def crack_opening(deformation, bonds: Bonds, reference, bond_state, spacing, i):
    """Vector to the crack of a particle that has failed: half a spacing along its direction of maximum stretch, to the
    side where its bonds are stretched more; 0 where it has bonds on one side only."""
    axis = maximum_stretch_direction(matrix_of(deformation, i))
    across = times(matrix_of(deformation, i), axis)
    ahead, behind, length2_ahead, length2_behind = 0.0, 0.0, 0.0, 0.0
    for n in range(bonds.count[i]):
        j = bonds.partner[i, n]
        X, u = difference(reference, 0, j, i), difference(bond_state, DISPLACEMENT, j, i)
        w, along = bond_weight(bonds, i, n), dot(X, axis)
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
def find_cracks(
    begin, end, bodies: Bodies, body, bonds: Bonds, reference, bond_state, deformation, damage, payload, crack
):
    """crack[i] = vector, in the reference state, from a damaged particle to the plane of the crack beside it.

    Its partners' cracks count first, the nearest of those that it sees; then, if it has failed, its own. The `payload`
    is that of the step before.
    """
    for i in range(begin, end):
        spacing = bodies.spacing[body[i]]
        found = vector_of(crack, i)
        if damage[i] > 0.0 and not is_face(found, spacing):
            # The nearest of its partners' cracks.
            nearest = dot(found, found) if dot(found, found) > 0.0 else FAR
            for n in range(bonds.count[i]):
                j = bonds.partner[i, n]
                X = difference(reference, 0, j, i)
                seen = crack_seen(X, crack_of(payload, j), spacing, 2.0 * bodies.smoothing[body[i]])
                if dot(seen, seen) > 0.0 and dot(seen, seen) < nearest:
                    found, nearest = seen, dot(seen, seen)
            # Its own.
            if damage[i] >= 1.0 and not is_face(found, spacing):
                own = crack_opening(deformation, bonds, reference, bond_state, spacing, i)
                found = own if dot(own, own) > 0.0 else found
            store_vector(crack, i, found)


@helper
def breaks(x, X, payload, spacing, i, j):
    """Whether the bond between i and j breaks; x and X: from i to j now and in the reference state.

    It does if it is stretched and crosses a crack, or its ends have failed otherwise; and if an end detaches. A bond
    beside damaged particles that is half a spacing longer than the stretch of either end makes it crosses a crack as
    well, one that has no face at its ends: it jumps from one row of particles to another, or its faces have become
    debris. The stretch of a failed end is the crack's and not the material's.
    """
    # Does it cross the plane of the crack of either end?
    mine, other = crack_of(payload, i), crack_of(payload, j)
    ahead, behind = dot(X, mine), -dot(X, other)
    mine2, other2 = dot(mine, mine), dot(other, other)
    faces = dot(mine, other) <= SAME_FACE * sqrt(mine2 * other2)
    beyond = (ahead > mine2 and mine2 > 0.0) or (behind > other2 and other2 > 0.0)
    crossed = beyond or (faces and min(ahead, behind) > 0.0)
    # Have both ends failed, and not on one face?
    failed = min(payload[i, DAMAGE], payload[j, DAMAGE]) >= 1.0 and faces
    stretched = dot(x, x) > dot(X, X)
    # Is it longer than the material is stretched?
    widest = max(payload[i, STRETCH], payload[j, STRETCH]) * sqrt(dot(X, X)) + OPENED * spacing
    damaged = min(payload[i, NEIGHBOURHOOD_DAMAGE], payload[j, NEIGHBOURHOOD_DAMAGE]) > 0.0
    opened = damaged and dot(x, x) > widest * widest
    detaching = payload[i, DETACHING] > 0.0 or payload[j, DETACHING] > 0.0
    return ((crossed or failed) and stretched) or opened or detaching


@driver
def cut_bonds(begin, end, position, reference, bodies: Bodies, body, payload, key, bonds: Bonds, rupture_length, lost):
    """Cut the bonds that break.

    lost[i] = how many bonds particle i has lost; the others keep their order. rupture_length[i] = length of the
    shortest that it has ever lost.
    """
    for i in range(begin, end):
        kept = 0
        for n in range(bonds.count[i]):
            j = bonds.partner[i, n]
            x, X = difference(position, 0, j, i), difference(reference, 0, j, i)
            if not breaks(x, X, payload, bodies.spacing[body[i]], i, j):
                # Those that are kept move up.
                if kept < n:
                    key[i, kept] = key[i, n]
                    bonds.partner[i, kept] = j
                    for d in range(DIMENSIONS + 1):
                        bonds.geometry[i, kept * (DIMENSIONS + 1) + d] = bonds.geometry[i, n * (DIMENSIONS + 1) + d]
                kept += 1
            else:
                rupture_length[i] = min(rupture_length[i], sqrt(dot(x, x)))
        for n in range(kept, bonds.count[i]):
            key[i, n] = -1
        lost[i] = max(bonds.count[i], 0) - kept
        if lost[i] > 0:
            bonds.count[i] = kept


# ---- without bonds ---------------------------------------------------------------------------------------------------


@driver
def carry_unbonded(begin, end, bond_count, pressure, deviator, carried_pressure, carried_deviator):
    """What particles act with that have no bonds: all that they carry where their body never had bonds, but debris with
    no tension and no shear."""
    for i in range(begin, end):
        whole = bond_count[i] == NEVER_BONDED
        carried_pressure[i] = pressure[i] if whole else max(pressure[i], 0.0)
        for c in static_range(COMPONENTS):
            carried_deviator[i, c] = deviator[i, c] if whole else 0.0


@driver
def keep_rates(begin, end, bond_count, gradient, rates):
    """rates[i] = velocity gradient of a particle whose body never had bonds; 0 for others: each approach is damped."""
    for i in range(begin, end):
        for k in static_range(DIMENSIONS * DIMENSIONS):
            rates[i, k] = gradient[i, k] if bond_count[i] == NEVER_BONDED else 0.0
