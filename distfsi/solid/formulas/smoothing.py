"""The Wendland C2 smoothing kernel of support 2h (paper, Eq. 2) and the smoothing length (Eq. 3)."""

from math import exp, pi, sqrt

from distfsi.formulas.symbols import DIMENSIONS


def smoothing_kernel(distance2, h):
    """W [1/m^d] at the squared distance `distance2` [m2], below (2h)^2."""
    inverse = 1.0 / h
    q = sqrt(distance2) * inverse
    s = 1.0 - 0.5 * q
    if DIMENSIONS == 1:
        return 0.625 * inverse * s * s * s * (1.0 + 1.5 * q)
    if DIMENSIONS == 2:
        return 1.75 / pi * inverse * inverse * s * s * s * s * (1.0 + 2.0 * q)
    if DIMENSIONS == 3:
        return 1.3125 / pi * inverse * inverse * inverse * s * s * s * s * (1.0 + 2.0 * q)


def smoothing_slope(distance2, h):
    """(dW/dr)/r [1/m^(d+2)], finite at r = 0: grad_i W = slope (x_i - x_j)."""
    inverse = 1.0 / h
    s = 1.0 - 0.5 * sqrt(distance2) * inverse
    inverse2 = inverse * inverse
    if DIMENSIONS == 1:
        return -1.875 * inverse2 * inverse * s * s
    if DIMENSIONS == 2:
        return -8.75 / pi * inverse2 * inverse2 * s * s * s
    if DIMENSIONS == 3:
        return -6.5625 / pi * inverse2 * inverse2 * inverse * s * s * s


def dilated(density, h, divergence, dt):
    """Density and smoothing length after `dt` of the velocity `divergence` (Eqs. 5a and 3, integrated: never negative).

    Eq. 5a is used as d(rho)/dt = -rho div v, so that a neighbour of another density counts by its volume.
    """
    dilation = dt * divergence
    return (density * exp(-dilation), h * exp(dilation * (1.0 / DIMENSIONS)))
