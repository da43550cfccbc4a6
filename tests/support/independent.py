"""Waves of a fluid whose pressure is given as a plain function, by integration and by finding roots.

Nothing here knows the package: not its laws, not its formulas, not its exact solutions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

STEP = 1e-20  # of a complex step, which has no cancellation


@dataclass(frozen=True)
class Material:
    """p(rho, e) [Pa] as the literature writes it, for complex numbers too, and its inverse e(rho, p) [J/kg].

    maximum_density  where p has no bound [kg/m3]
    """

    pressure: Callable
    energy: Callable
    maximum_density: float = np.inf

    def sound_speed(self, rho: float, p: float) -> float:
        """Speed of sound [m/s]: c^2 = dp/drho + p/rho^2 dp/de."""
        e, de = self.energy(rho, p), max(abs(self.energy(rho, p)), 1.0) * STEP
        by_density = np.imag(self.pressure(complex(rho, rho * STEP), e)) / (rho * STEP)
        return float(np.sqrt(by_density + p / rho**2 * np.imag(self.pressure(rho, complex(e, de))) / de))

    def isentrope(self, rho: float, p: float, p_end: float, points: int = 2) -> np.ndarray:
        """Rows p, rho, and the integral of dp/(rho c), from a state to the pressure p_end."""

        def slopes(p, y):
            c = self.sound_speed(y[0], p)
            return [1.0 / c**2, 1.0 / (y[0] * c)]

        pressures = np.linspace(p, p_end, points)
        path = solve_ivp(slopes, (p, p_end), [rho, 0.0], "DOP853", pressures, rtol=1e-12, atol=1e-12 * rho)
        return np.array([pressures, *path.y])

    def behind_shock(self, rho: float, p: float, p_end: float) -> float:
        """Density behind a shock: e' - e = (p + p')/2 (1/rho - 1/rho')."""
        e = self.energy(rho, p)

        def excess(volume):
            return self.energy(1.0 / volume, p_end) - e - 0.5 * (p + p_end) * (1.0 / rho - volume)

        smallest = volume = 1.0 / rho
        while excess(smallest) * (p_end - p) > 0.0:
            smallest = 1.0 / self.maximum_density + 0.95 * (smallest - 1.0 / self.maximum_density)
        return 1.0 / brentq(excess, smallest, volume, xtol=1e-18, rtol=1e-14)


@dataclass(frozen=True)
class State:
    """A material that is at rest or moves [kg/m3, m/s, Pa]."""

    material: Material
    rho: float
    u: float
    p: float

    def slowed(self, p: float) -> float:
        """By how much the wave that brings the state to the pressure p slows what moves towards it [m/s]."""
        if p <= self.p:
            return self.material.isentrope(self.rho, self.p, p)[2, -1]
        rho = self.material.behind_shock(self.rho, self.p, p)
        return np.sqrt((p - self.p) * (1.0 / self.rho - 1.0 / rho))


@dataclass(frozen=True)
class Riemann:
    """Two states that have met at x = 0; the right one's wave is that of the left of the mirror image."""

    left: State
    right: State

    @cached_property
    def star(self) -> tuple[float, float]:
        """Pressure and velocity between the waves."""
        left, right = self.left, self.right

        def approach(logarithm):
            p = np.exp(logarithm)
            return left.u - left.slowed(p) - right.u - right.slowed(p)

        low, high = np.log(1e-3 * min(left.p, right.p)), np.log(1e3 * max(left.p, right.p))
        p = float(np.exp(brentq(approach, low, high, xtol=1e-14)))
        return p, left.u - left.slowed(p)

    def sample(self, speed: np.ndarray) -> np.ndarray:
        """Rows density, velocity, pressure where x/t is so much [m/s]."""
        p, u = self.star
        mirrored = self._side(self.right, p, -speed, -1.0)
        return np.where(speed < u, self._side(self.left, p, speed, 1.0), mirrored * np.array([[1.0], [-1.0], [1.0]]))

    @staticmethod
    def _side(state: State, p: float, speed: np.ndarray, sign: float) -> np.ndarray:
        """Behind, in and in front of the wave to the left of a state whose velocity counts times `sign`."""
        rho0, u0, p0 = state.rho, sign * state.u, state.p
        if p > p0:
            rho = state.material.behind_shock(rho0, p0, p)
            head = u0 - np.sqrt((p - p0) / (1.0 / rho0 - 1.0 / rho)) / rho0
            values = np.array([[rho0, u0, p0], [rho, u0 - state.slowed(p), p]])
            return values[(speed > head).astype(int)].T
        path = state.material.isentrope(rho0, p0, p, 500)
        c = [state.material.sound_speed(rho, pressure) for pressure, rho in path[:2].T]
        heads = u0 - path[2] - np.array(c)
        return np.array([np.interp(speed, heads, values) for values in (path[1], u0 - path[2], path[0])])
