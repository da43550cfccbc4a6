"""How fast the axes turn in which a solid's stress is kept (the objective rate).

`gradient` is the velocity gradient by rows, gradient[a][b] = dv_a/dx_b [1/s]; spins are antisymmetric matrices [1/s].
Jaumann's axes turn with the vorticity: simple, but in simple shear the stress swings. Green and Naghdi's turn with the
rotation R of the polar decomposition F = V R: `stretch` is the tuple of V's COMPONENTS.
"""

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import COMPONENTS, DIMENSIONS
from distfsi.formulas.tensors import components, inverse, product, rows, times, trace


def vorticity(gradient):
    """Antisymmetric part of the velocity gradient."""
    return tuple(
        tuple(0.5 * (gradient[a][b] - gradient[b][a]) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


def half_rotation(spin, dt):
    """Antisymmetric matrix whose Cayley transform turns by the spin times `dt`: tan(x) by its series."""
    half = tuple(tuple(0.5 * dt * spin[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))
    tangent2 = 0.5 * sum(
        sum(half[a][b] * half[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS)
    )
    longer = 1.0 + tangent2 * (1.0 / 3.0 + tangent2 * (2.0 / 15.0))
    return tuple(tuple(longer * half[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))


def rotation(spin, dt):
    """Orthogonal matrix that turns by the spin times `dt` (Hughes & Winget 1980, of sixth order in the angle)."""
    half = half_rotation(spin, dt)
    square = product(half, half)
    factor = 2.0 / (1.0 - 0.5 * trace(square))
    return tuple(
        tuple((1.0 if a == b else 0.0) + factor * (half[a][b] + square[a][b]) for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )


def polar_spin(gradient, stretch):
    """Spin of R (Green & Naghdi; Dienes 1979): vorticity plus A with V A + A V = L V - V L^T - (W V + V W)."""
    W = vorticity(gradient)
    V = rows(stretch)
    strained = product(gradient, V)
    turned, turning = product(W, V), product(V, W)
    excess = tuple(
        tuple(strained[a][b] - strained[b][a] - turned[a][b] - turning[a][b] for b in static_range(DIMENSIONS))
        for a in static_range(DIMENSIONS)
    )
    if DIMENSIONS == 1:
        return W
    if DIMENSIONS == 2:
        more = excess[1][0] / trace(V)
        return ((0.0, W[0][1] - more), (W[1][0] + more, 0.0))
    if DIMENSIONS == 3:
        whole = trace(V)
        resistance = tuple(
            tuple((whole if a == b else 0.0) - V[a][b] for b in static_range(3)) for a in static_range(3)
        )
        x, y, z = times(inverse(resistance), (excess[2][1], excess[0][2], excess[1][0]))
        return (
            (0.0, W[0][1] - z, W[0][2] + y),
            (W[1][0] + z, 0.0, W[1][2] - x),
            (W[2][0] - y, W[2][1] + x, 0.0),
        )


def stretched(stretch, base, gradient, spin, dt):
    """`stretch` after `dt` of dV/dt = L V - V spin, with the rate at `base`."""
    V = rows(base)
    ahead, behind = product(gradient, V), product(V, spin)
    rate = tuple(tuple(ahead[a][b] - behind[a][b] for b in static_range(DIMENSIONS)) for a in static_range(DIMENSIONS))
    change = components(rate)
    return tuple(stretch[c] + dt * change[c] for c in static_range(COMPONENTS))


def polar_rotation(gradient, stretch, dt):
    """Spin of R at mid-step and the stretch after `dt` (midpoint rule)."""
    middle = stretched(stretch, stretch, gradient, polar_spin(gradient, stretch), 0.5 * dt)
    spin = polar_spin(gradient, middle)
    return (spin, stretched(stretch, middle, gradient, spin, dt))
