"""What forms when two fluid states meet: the exact Riemann problem for any of the input's equations of state.

Shocks by the Rankine-Hugoniot conditions, rarefactions along isentropes.
"""

from __future__ import annotations

from math import exp, log, sqrt
from typing import NamedTuple

from scipy.optimize import brentq

from distfsi.laws.law import FluidEos
from distfsi.scene.thermodynamics import energy, pressure, sound_speed_squared

ISENTROPE_STEPS = 100
HIGHEST = 100.0  # times the higher of two pressures, where the pressure between them is sought
LOWEST = 1e-6  # times the lower
DENSEST = 1e3  # times the density ahead of a shock, where that behind it is sought


class Side(NamedTuple):
    """One state of a Riemann problem; `velocity` [m/s] points towards the other one."""

    eos: FluidEos
    density: float
    pressure: float
    velocity: float

    @property
    def sound(self) -> float:
        """Speed of sound [m/s]."""
        return _sound_speed(self.eos, self.density, self.pressure)


class Wave(NamedTuple):
    """A state that forms: velocity and speed of sound [m/s], pressure [Pa]."""

    velocity: float
    sound: float
    pressure: float


def meet(left: Side, right: Side) -> list[Wave]:
    """The two states and those that form between them, from left to right; velocities point to the right.

    Between states of tension, and such that leave a vacuum between them, nothing is told.
    """
    outer = Wave(left.velocity, left.sound, left.pressure), Wave(-right.velocity, right.sound, right.pressure)
    low, high = LOWEST * min(left.pressure, right.pressure), HIGHEST * max(left.pressure, right.pressure)
    if low <= 0.0:
        return list(outer)

    def approach(logarithm: float) -> float:
        return sum(side.velocity - behind(side, exp(logarithm))[1] for side in (left, right))

    if approach(log(low)) <= 0.0 or approach(log(high)) >= 0.0:
        return list(outer)
    p = exp(brentq(approach, log(low), log(high), xtol=1e-6))
    inner = [behind(side, p) for side in (left, right)]
    velocity = left.velocity - inner[0][1]
    between = [
        Wave(velocity, _sound_speed(side.eos, rho, p), p) for side, (rho, _) in zip((left, right), inner, strict=True)
    ]
    return [outer[0], *between, outer[1]]


def behind(side: Side, p: float) -> tuple[float, float]:
    """Density [kg/m3] behind the wave that brings a side to the pressure `p`, and by how much it slows it [m/s]."""
    return _shock(side, p) if p > side.pressure else _rarefaction(side, p)


def _shock(side: Side, p: float) -> tuple[float, float]:
    eos, rho0, p0, _ = side
    e0 = energy(eos, rho0, p0)

    def excess(rho: float) -> float:
        return pressure(eos, rho, e0 + 0.5 * (p + p0) * (1.0 / rho0 - 1.0 / rho)) - p

    rho, densest = rho0, min(DENSEST * rho0, (1.0 - 1e-12) * eos.maximum_density)
    while excess(rho) < 0.0 and rho < densest:
        rho = min(1.1 * rho, densest)
    if excess(rho) >= 0.0:
        rho = brentq(excess, rho0, rho, xtol=1e-9 * rho0)
    return rho, sqrt((p - p0) * (1.0 / rho0 - 1.0 / rho))


def _rarefaction(side: Side, p: float) -> tuple[float, float]:
    """Along d rho = dp/c2 and du = dp/(rho c), by the midpoint rule in equal ratios of the pressure."""
    rho, here, change = side.density, side.pressure, 0.0
    ratio = (p / here) ** (1.0 / ISENTROPE_STEPS)
    for _ in range(ISENTROPE_STEPS):
        there = here * ratio
        middle = sqrt(here * there)
        half = rho + (middle - here) / _sound_speed(side.eos, rho, here) ** 2
        c = _sound_speed(side.eos, half, middle)
        change += (there - here) / (half * c)
        rho, here = rho + (there - here) / c**2, there
    return rho, change


def _sound_speed(eos: FluidEos, density: float, p: float) -> float:
    """Speed of sound [m/s]; where there is none, next to nothing."""
    return sqrt(max(sound_speed_squared(eos, density, p), 1e-30))
