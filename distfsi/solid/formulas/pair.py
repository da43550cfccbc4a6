"""What particle j does to particle i: momentum, energy and velocity gradient (paper, Eqs. 5 and 6 corrected).

dx = x_i - x_j and dv = v_i - v_j are vectors, grad_i W = slope dx. The sums of Eq. 5 are not exact for linear fields
where neighbours are missing: a body that turns would feel a strain and stop turning. Each particle therefore has a
correction matrix for its gradients; the same matrix in the forces keeps momentum, angular momentum and energy.
"""

from math import sqrt

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import ARTIFICIAL_STRESS, DIMENSIONS, SMOOTHING_RATIO, VISCOSITY_ALPHA, VISCOSITY_BETA
from distfsi.formulas.tensors import dot, identity_plus, inverse, minimum_eigenvalue, product, rows, times
from distfsi.solid.formulas.smoothing import smoothing_kernel


def approach_speeds(dv, dx, seen, dilation, distance2, h):
    """-phi of Eq. 6 [m/s] if the particles approach each other, else 0; and the jump of velocity between them.

    `seen`: dx . (grad v) dx of either particle [m2/s], `dilation`: the sum of both div v [1/s]. What the two see alike
    is smooth, limited as van Leer's slopes are (after Frontiere, Raskin & Owen, J. Comput. Phys. 332, 2017); the rest
    is a jump. Where the flow changes volumes, as in shocks, they must be more alike, jumps apart count as well, and all
    by half as much again: else velocities swing behind weak shocks. Plastic flow keeps volumes; it is not damped so.
    """
    total = seen[0] + seen[1]
    per_total = 1.0 / max(abs(total), 1e-300)
    alike = max(4.0 * (seen[0] * per_total) * (seen[1] * per_total), 0.0)
    volumetric = min(abs(dilation) * distance2 * per_total, 1.0)
    limited = 0.5 * total * alike * (1.0 - volumetric * (1.0 - alike * alike * alike))
    whole = dot(dv, dx)
    smooth = max(min(limited, max(whole, 0.0)), min(whole, 0.0))
    per_length = h / (distance2 + 0.01 * h * h)
    jump = (smooth - whole) * per_length
    rough = (1.0 + 0.5 * volumetric) * (max(jump, 0.0) + volumetric * min(jump, 0.0))
    return (max(-whole * per_length, 0.0), rough)


def viscosity(approach, rough, sound_speed, density):
    """Monaghan's Pi [m5/(kg s2)] of an approach speed at the mean sound speed and density (Eq. 6).

    Its linear part damps what is `rough`.
    """
    return (VISCOSITY_ALPHA * sound_speed * rough + VISCOSITY_BETA * approach * approach) / density


def gradient_correction(moment):
    """Matrix that makes gradients exact for linear fields (Bonet & Lok 1999); `moment` is the raw gradient of x.

    It turns into the unit matrix, smoothly, where neighbours are missing all around or along one direction.
    """
    # The eigenvalue is 1 deep inside a body, about 1/2 at its surface; its bound is 0.1 or more even at corners.
    trust = min(max(20.0 * minimum_eigenvalue(moment) - 1.0, 0.0), 1.0)
    exact = inverse(moment)
    return tuple(
        tuple(
            (1.0 - trust if a == b else 0.0) + (trust * exact[a][b] if trust > 0.0 else 0.0)
            for b in static_range(DIMENSIONS)
        )
        for a in static_range(DIMENSIONS)
    )


def whole_stress(deviator, pressure):
    """S - p I [Pa], by rows."""
    S = rows(deviator)
    return tuple(
        tuple(S[a][b] - (pressure if a == b else 0.0) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


def repulsion(distance2, h, densities):
    """What times dx . tension dx is the artificial stress, as a part of Pi, against clumping [m4/kg2].

    eps (W(r)/W(spacing))^4 sigma/rho^2 of the tensile principal stresses sigma (Gray, Monaghan & Swift, Comput. Methods
    Appl. Mech. Eng. 190, 2001), of which the part along the line of the pair is taken: so angular momentum is kept.
    """
    spacing = h / SMOOTHING_RATIO
    closeness = smoothing_kernel(distance2, h) / smoothing_kernel(spacing * spacing, h)
    square = closeness * closeness
    return ARTIFICIAL_STRESS * square * square / (distance2 * densities)


def pair_acceleration(dx, slope, stresses, densities, Pi):
    """[(sigma_i + sigma_j)/(rho_i rho_j) - Pi] grad_i W [m/(s2 kg)] (Eq. 5b), odd in i and j to the bit.

    `stresses` is the sum of both particles' corrected stresses, `densities` the product.
    """
    traction = times(stresses, dx)
    return tuple(slope * (traction[d] / densities - Pi * dx[d]) for d in static_range(DIMENSIONS))


def pair_heating(dv, dx, slope, stress, densities, Pi):
    """What a neighbour adds to de/dt per mass [W/kg2] (Eq. 5c), from the particle's own corrected `stress`.

    With the mid-step velocities it balances the work of `pair_acceleration`.
    """
    return slope * (0.5 * Pi * dot(dv, dx) - dot(dv, times(stress, dx)) / densities)


def pair_gradient(dv, dx, slope, volume):
    """What a neighbour of `volume` [m^d] adds to the velocity gradient [1/s]."""
    weight = -volume * slope
    return tuple(tuple(weight * dv[a] * dx[b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


def mid_step(gradient, dt):
    """The velocity gradient [1/s] with respect to the positions half a step later, to which the velocities belong."""
    return product(gradient, inverse(identity_plus(0.5 * dt, gradient)))


def stable_time(h, sound_speed, approach, acceleration):
    """Longest steps [s] that signals and the acceleration allow: Monaghan's conditions with safety 0.3.

    `approach` is the largest approach speed [m/s] among the neighbours.
    """
    signal = sound_speed + 0.6 * (VISCOSITY_ALPHA * sound_speed + VISCOSITY_BETA * approach)
    return (0.3 * h / signal, 0.3 * sqrt(h / max(sqrt(dot(acceleration, acceleration)), 1e-300)))
