"""A cylindrical explosion by an independent radial computation, to compare computations in the plane with.

Lagrangian Godunov's method (Godunov 1959; Despres and Mazeran, Arch. Ration. Mech. Anal. 178, 2005, for the geometry):
cells are rings that move with the material, so the interface between gas and water stays sharp, and the waves between
rings are exact Riemann problems of stiffened gases. Nothing is shared with the solver.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.study.exact import PureState

Array = NDArray[np.float64]

NEWTON_STEPS = 6
CFL = 0.4


@dataclass(frozen=True)
class Rings:
    """State of the rings: radii of their edges (n + 1) [m]; density, velocity, pressure (n,) in SI units."""

    edges: Array
    density: Array
    velocity: Array
    pressure: Array

    def sample(self, radius: Array) -> tuple[Array, Array, Array]:
        """Density, radial velocity and pressure of the rings at radii [m] of any shape."""
        ring = np.clip(np.searchsorted(self.edges, radius) - 1, 0, len(self.density) - 1)
        return self.density[ring], self.velocity[ring], self.pressure[ring]


def cylindrical_explosion(
    gas: PureState,
    water: PureState,
    eos_gas: StiffenedGas,
    eos_water: StiffenedGas,
    radius: float,
    outer: float,
    time: float,
    spacing: float,
) -> Rings:
    """The rings at `time` [s] after a cylinder of gas of a `radius` lets go in water that reaches to `outer` [m].

    spacing: width of the rings at the start [m]. An ideal gas is a stiffened gas with p_inf = 0.
    """
    inside = max(1, round(radius / spacing))
    outside = max(1, round((outer - radius) / spacing))
    r = np.concatenate([np.linspace(0.0, radius, inside + 1), np.linspace(radius, outer, outside + 1)[1:]])
    gamma, p_inf, rho, p = (
        np.repeat([a, b], [inside, outside]).astype(float)
        for a, b in (
            (eos_gas.gamma, eos_water.gamma),
            (eos_gas.p_inf, eos_water.p_inf),
            (gas.density, water.density),
            (gas.pressure, water.pressure),
        )
    )
    u, mass, elapsed = np.zeros_like(rho), rho * 0.5 * np.diff(r**2), 0.0
    energy = (p + gamma * p_inf) / ((gamma - 1.0) * rho)
    while elapsed < time:
        c = np.sqrt(gamma * (p + p_inf) / rho)
        dt = min(CFL * float((np.diff(r) / c).min()), time - elapsed)
        p_face, u_face = _faces(gamma, p_inf, rho, u, p, c)
        moved = r + dt * u_face
        middle = 0.5 * (r + moved)  # so that the area swept is r u dt
        u = u - dt * 0.5 * (middle[1:] + middle[:-1]) * np.diff(p_face) / mass
        energy = energy - dt * np.diff(middle * p_face * u_face) / mass
        r, elapsed = moved, elapsed + dt
        rho = mass / (0.5 * np.diff(r**2))
        p = (gamma - 1.0) * rho * (energy - 0.5 * u**2) - gamma * p_inf
    return Rings(r, rho, u, p)


def _faces(gamma: Array, p_inf: Array, rho: Array, u: Array, p: Array, c: Array) -> tuple[Array, Array]:
    """Pressure and velocity on the edges of the rings: at rest on the axis and outside, else exact."""
    left, right = slice(None, -1), slice(1, None)
    lowest = np.maximum(-p_inf[left], -p_inf[right])
    z_left, z_right = (rho * c)[left], (rho * c)[right]
    star = (z_right * p[left] + z_left * p[right] + z_left * z_right * (u[left] - u[right])) / (z_left + z_right)
    floor = lowest + 1e-3 * (np.minimum(p[left], p[right]) - lowest)
    star = np.maximum(star, floor)
    for _ in range(NEWTON_STEPS):
        jump_left, slope_left = _velocity_jump(star, gamma[left], p_inf[left], rho[left], p[left], c[left])
        jump_right, slope_right = _velocity_jump(star, gamma[right], p_inf[right], rho[right], p[right], c[right])
        star = np.maximum(star - (jump_left + jump_right + u[right] - u[left]) / (slope_left + slope_right), floor)
    jump_left, _ = _velocity_jump(star, gamma[left], p_inf[left], rho[left], p[left], c[left])
    jump_right, _ = _velocity_jump(star, gamma[right], p_inf[right], rho[right], p[right], c[right])
    velocity = 0.5 * (u[left] - jump_left + u[right] + jump_right)
    return np.concatenate([p[:1], star, p[-1:]]), np.concatenate([[0.0], velocity, [0.0]])


def _velocity_jump(star: Array, gamma: Array, p_inf: Array, rho: Array, p: Array, c: Array) -> tuple[Array, Array]:
    """Loss of velocity across a wave that changes the pressure to `star`, and its slope (Toro, chapter 4)."""
    A, B = 2.0 / ((gamma + 1.0) * rho), (gamma - 1.0) / (gamma + 1.0) * (p + p_inf)
    root = np.sqrt(A / (star + p_inf + B))
    shock = (star - p) * root, root * (1.0 - 0.5 * (star - p) / (star + p_inf + B))
    ratio, power = (star + p_inf) / (p + p_inf), 0.5 * (gamma - 1.0) / gamma
    fan = 2.0 * c / (gamma - 1.0) * (ratio**power - 1.0), ratio ** (power - 1.0) * c / (gamma * (p + p_inf))
    jump, slope = (np.where(star > p, a, b) for a, b in zip(shock, fan, strict=True))
    return jump, slope
