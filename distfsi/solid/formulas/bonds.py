"""Total Lagrangian form: strain and forces on the bonds between neighbours of the reference state.

X is the position of a particle in the reference state, u its displacement. The bond from i to j has the weight
w = -V_j (dW/dr)/r and the vector g = w (X_j - X_i); gradients are corrected by B = (sum of (X_j - X_i) g)^-1, so that
they are exact for linear fields. F = 1 + (sum of (u_j - u_i) g) B is then the least-squares fit to the deformed bonds,
and what the fit leaves over, r = (x_j - x_i) - F (X_j - X_i), gives zero when summed with the vectors g. An energy
kappa/2 sum of w r^2 per volume thus resists all that F does not see, and its forces need no derivative of F (after
Silling, Comput. Methods Appl. Mech. Eng. 322, 2017): they keep momentum and angular momentum, and no linear deformation
feels them.
"""

from math import log, sqrt

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, VISCOSITY_ALPHA, VISCOSITY_BETA, ZERO_ENERGY
from distfsi.formulas.tensors import (
    contraction,
    determinant,
    dot,
    identity_plus,
    inverse,
    product,
    rows,
    scaled,
    trace,
    transposed,
)

SOFTENING = 15.0  # of the zero-energy stiffness with plastic strain; 3 follows the secant modulus
SHORTEST = 1e-300  # s: steps of no length strain nothing
MINIMUM_GROWTH = 0.1  # of the volume in a step that can be taken
ROUGH = 5.0  # over the share of the velocities that is unseen, above which viscosity has its linear part in full
SHOCKED = 30.0  # jumps of velocity to the sound speed, above which it does at cracks and contacts


def whole_step(before, after, dt):
    """The velocity gradient [1/s] that takes the deformation gradient from `before` to `after` in `dt`.

    It is Hughes and Winget's, of the state half-way, but for two things: its spin times `dt` is the angle of the turn,
    and its trace times `dt` the logarithm of the ratio of volumes. A rigid turn by any angle has no strain.
    """
    change = tuple(
        tuple(after[a][b] - before[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS)
    )
    middle = tuple(
        tuple(0.5 * (after[a][b] + before[a][b]) for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS)
    )
    step = product(change, inverse(middle))
    turn = tuple(tuple(step[a][b] - step[b][a] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))
    tangent2 = 0.03125 * sum(
        sum(turn[a][b] * turn[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS)
    )  # of half the angle
    shorter = 1.0 - tangent2 * (1.0 / 3.0 - 0.2 * tangent2)
    growth = log(determinant(after) / determinant(before))
    missing = (growth - trace(step)) * (2.0 / DIMENSIONS)
    rate = 0.5 / max(dt, SHORTEST)
    return tuple(
        tuple(
            rate * (step[a][b] + step[b][a] + shorter * turn[a][b] + (missing if a == b else 0.0))
            for b in static_range(DIMENSIONS)
        )
        for a in static_range(DIMENSIONS)
    )


def unseen_share(rates, moved, relative2):
    """How much of its linear viscosity a particle has, 0 to 1: by the share of its partners' motion that is not linear.

    `relative2` is the sum of w (v_j - v_i)^2 and `moved` that of (v_j - v_i) g, for which `rates` is the fit of least
    squares; of the former the fit accounts for rates : moved.
    """
    return min(ROUGH * max(1.0 - contraction(rates, moved) / max(relative2, SHORTEST), 0.0), 1.0)


def shocked_share(divergence, size, sound_speed):
    """The same by the jump of velocity: at cracks and contacts motion is not linear without a shock."""
    return min(SHOCKED * max(-size * divergence, 0.0) / sound_speed, 1.0)


def bulk_viscosity(divergence, density, size, sound_speed, share):
    """Viscous pressure [Pa], quadratic in the jump of velocity over a particle's `size` [m] in a compression.

    A `share` is left of the linear part, which is that of an acoustic Riemann solver, also in expansions: waves and
    shocks of any strength are damped where they are not resolved; bending, plastic flow and smooth compression are not.
    """
    jump = -size * divergence
    approach = max(jump, 0.0)
    return density * (0.5 * VISCOSITY_ALPHA * share * sound_speed * jump + VISCOSITY_BETA * approach * approach)


def zero_energy_stiffness(density, sound_speed, plastic_strain, damage, shear_modulus, flow_stress):
    """kappa [Pa] in shear moduli; 4/3 of them cancel the leading error that the smoothing of F makes in shear waves.

    Once the particle has flowed, kappa falls faster than the secant modulus, so that it does not hold up the flow. So
    it does with the largest `damage` of the particle and its partners: what F does not see there is a crack that opens,
    and a stiffness that fell as the stress does would add a constant share to the crack's energy. A material without
    shear has a twentieth of its longitudinal modulus instead of its shear modulus.
    """
    softer = 1.0 + SOFTENING * shear_modulus * plastic_strain / max(flow_stress, 1e-300)
    whole = 1.0 - damage
    return ZERO_ENERGY * whole * whole * max(shear_modulus, 0.05 * density * sound_speed * sound_speed) / softer


def bond_stress(deviator, pressure, deformation, correction, stiffness):
    """J (S - p 1) F^-T B - kappa (F - 1) [Pa], by rows: what turns the vectors g into forces per volume."""
    S = rows(deviator)
    stress = tuple(
        tuple(S[a][b] - (pressure if a == b else 0.0) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )
    volume = determinant(deformation)
    piola = product(product(stress, transposed(inverse(deformation))), correction)
    return tuple(
        tuple(
            volume * piola[a][b] - stiffness * (deformation[a][b] - (1.0 if a == b else 0.0))
            for b in static_range(DIMENSIONS)
        )
        for a in static_range(DIMENSIONS)
    )


def minimum_stretch(deformation):
    """Lower bound of the principal stretches, exact in one and two dimensions."""
    return 1.0 / maximum_stretch(transposed(inverse(deformation)))


def maximum_stretch(deformation):
    """Upper bound of the principal stretches, tight when the others are equal (Wolkowicz & Styan 1980)."""
    squared = product(transposed(deformation), deformation)
    mean = trace(squared) * (1.0 / DIMENSIONS)
    spread = max(trace(product(squared, squared)) * (1.0 / DIMENSIONS) - mean * mean, 0.0)
    return sqrt(mean + sqrt(spread * (DIMENSIONS - 1.0)))


def signal_time(shortest, sound_speed, viscous_pressure, density):
    """Longest step [s] that signals allow, with safety 0.3; `shortest` [m]: h along the most compressed direction."""
    signal = sound_speed + abs(viscous_pressure) / (density * sound_speed)
    return 0.3 * shortest / signal


def maximum_stretch_direction(deformation):
    """Unit vector along the largest principal stretch, in the reference state: a column of a high power of a matrix
    that has the axes of the strain and no negative eigenvalue."""
    squared = product(transposed(deformation), deformation)
    strain = tuple(
        tuple(squared[a][b] - (1.0 if a == b else 0.0) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )
    size = sqrt(trace(product(strain, strain))) + SHORTEST
    power = identity_plus(1.0 / size, strain)
    for _ in static_range(6):
        power = product(power, power)
        power = scaled(1.0 / trace(power), power)
    column, largest = power[0], power[0][0]
    for a in static_range(1, DIMENSIONS):
        column = tuple(power[a][d] if power[a][a] > largest else column[d] for d in static_range(DIMENSIONS))
        largest = max(largest, power[a][a])
    length = sqrt(dot(column, column))
    return tuple(column[d] / length for d in static_range(DIMENSIONS))


def is_face(crack, spacing):
    """Whether the plane of a `crack` (vector to it; 0: none) lies right beside a particle."""
    distance2 = dot(crack, crack)
    return distance2 > 0.0 and distance2 < spacing * spacing


def crack_seen(X, crack, spacing, reach):
    """Vector to the plane of a partner's `crack` (vector from there; 0: none); X: to the partner. 0: not seen.

    Those see it that are next to the partner across the plane or away from it: half a spacing beyond the crack of a
    face, which makes the other face; or behind it, if bonds of this `reach` get past the other face from there.
    """
    distance = sqrt(dot(crack, crack))
    along = dot(X, crack) / max(distance, SHORTEST)
    aside2 = dot(X, X) - along * along
    near = 0.5 * spacing < abs(along) and abs(along) < 1.5 * spacing and aside2 < 0.75 * spacing * spacing
    other_face = near and along < 0.0 and distance < spacing
    behind = near and along > 0.0 and distance + along + 1.5 * spacing < reach
    seen = -0.5 * spacing if other_face else (distance + along if behind else 0.0)
    share = seen / max(distance, SHORTEST)
    return tuple(share * crack[d] for d in static_range(DIMENSIONS))
