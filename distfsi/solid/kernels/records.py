"""What kernels of the solid take as one argument: records of arrays, and the columns of packed arrays.

A rank's own particles come first, then its ghosts, then the images at symmetry planes: arrays "of all" have a row for
each of them, the others a row for each own particle.
"""

from typing import Any, NamedTuple

# Columns of the packed state of all particles: what neighbours must know of a particle.
MASS, DENSITY, SMOOTHING, SOUND_SPEED, VELOCITY = range(5)

# Columns of the packed state of bonds: what the forces of bonds need of a particle; behind them its bond stress.
STIFFNESS, DISPLACEMENT = 0, 1

# Columns of the payload: what ghosts get besides in the total Lagrangian form.
VOLUME, BODY, DAMAGE, NEIGHBOURHOOD_DAMAGE, DETACHING, EXPOSED, UNBONDED, RUPTURE_LENGTH, STRETCH, CRACK = range(10)

# In the place of the number of bonds: the particle's body has the updated Lagrangian form, or is rigid.
NEVER_BONDED, RIGID = -1, -2


class Particles(NamedTuple):
    """All particles: position (count, D) [m] and packed state (count, VELOCITY + D)."""

    position: Any
    state: Any


class Neighbours(NamedTuple):
    """A table (n, width) of the neighbours of each particle, and how many it has (n,)."""

    table: Any
    count: Any


class Interaction(NamedTuple):
    """Pairs of particles after their forces are known, in the updated Lagrangian form.

    neighbours  of the own particles
    viscous     (n, width) Monaghan's Pi of each pair
    stress      (count, ...) corrected stress and, for artificial stress, tension behind it, of all particles
    correction  (n, D D) of the gradients
    """

    neighbours: Neighbours
    viscous: Any
    stress: Any
    correction: Any


class Bodies(NamedTuple):
    """Of each body (bodies,): spacing [m] and smoothing length [m] in the reference state."""

    spacing: Any
    smoothing: Any


class Bonds(NamedTuple):
    """The bonds of the own particles, in the order of their partners' keys.

    count     (n,) how many a particle has
    partner   (n, width) row of each partner
    geometry  (n, width (D + 1)) vector g and weight w of each bond (solid/formulas/bonds.py)
    """

    count: Any
    partner: Any
    geometry: Any


class Fit(NamedTuple):
    """What the bonds tell of a particle: gradient correction and deformation gradient (n, D D), by rows."""

    correction: Any
    deformation: Any


class Cohesion(NamedTuple):
    """How well the own particles hold together (n,): see the columns of solid/total_lagrangian.py."""

    bond_count: Any
    detaching: Any
    exposed: Any
    neighbourhood_damage: Any
    rupture_length: Any
    crack: Any


class Volumes(NamedTuple):
    """Mass [kg], density [kg/m3], reference volume [m^D] and logarithm of the growth by voids of the own particles."""

    mass: Any
    density: Any
    volume: Any
    void: Any


class BondedMaterial(NamedTuple):
    """What the forces of bonds need of the material of the own particles."""

    body: Any
    density: Any
    sound_speed: Any
    plastic_strain: Any
    deviator: Any
    pressure: Any
    viscous_pressure: Any


class BondedPoint(NamedTuple):
    """What the strain of bonds needs of the own particles (n,)."""

    volume: Any
    mass: Any
    h: Any
    density: Any
    sound_speed: Any
    neighbourhood_damage: Any


class StrainResult(NamedTuple):
    """What the strain of bonds changes of the own particles."""

    energy: Any
    viscous_pressure: Any
    gradient: Any
    detaching: Any


class MaterialPoints(NamedTuple):
    """The own particles, as their material sees them (n,): what all materials remember.

    deviator, pressure  [Pa] that are carried, damage included
    stretch             left stretch tensor of the polar decomposition, where axes of stress turn with its rotation
    strength_scatter    factor of the strength of each particle, where it scatters
    """

    body: Any
    energy: Any
    density: Any
    h: Any
    deviator: Any
    pressure: Any
    sound_speed: Any
    stretch: Any
    strength_scatter: Any


class RestState(NamedTuple):
    """Of each body (bodies,), at rest.

    density           [kg/m3]
    bulk_modulus      [Pa]
    minimum_modulus   [Pa] of the bulk, which expanded hot material keeps
    shear_modulus     [Pa]
    flow_stress       [Pa] von Mises stress at which plastic flow begins
    crack_width       [m] in which particles beside a crack take its energy
    """

    density: Any
    bulk_modulus: Any
    minimum_modulus: Any
    shear_modulus: Any
    flow_stress: Any
    crack_width: Any


class LawTables(NamedTuple):
    """The numbers of the laws of each body (bodies, ...)."""

    eos: Any
    strength: Any
    failure: Any


class Contacts(NamedTuple):
    """All particles, as contact of a body with itself sees them.

    position        (count, D) [m]
    state           (count, VELOCITY + D) packed
    reference       (count, D) [m] positions in the reference state
    size            (count,) [m] side of a cube of the particle's volume
    rupture_length  (count,) [m] of the shortest bond that a particle has lost
    """

    position: Any
    state: Any
    reference: Any
    size: Any
    rupture_length: Any


class SurfaceTables(NamedTuple):
    """How the surfaces of two bodies touch, for each pair (bodies, bodies): what a particle at the surface of the first
    sees of the second at the moment of touch (solid/contact.py).

    fill       volume fraction of the second body, smoothed
    steepness  its slope over a spacing of the first
    strain     of the gap between the outermost particles of both, per growth of the fill by itself
    """

    fill: Any
    steepness: Any
    strain: Any


class SearchMemory(NamedTuple):
    """The particles that were looked at in the last search for contacts: who (m,), where (m, D) [m], how large (m,)."""

    identity: Any
    position: Any
    size: Any
