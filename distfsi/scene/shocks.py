"""Shocks and detonations that an equation of state allows: its Hugoniot and its Chapman-Jouguet state."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt
from types import SimpleNamespace
from typing import Any

from distfsi.laws.law import FluidEos, Rest, SolidEos

GOLDEN = (sqrt(5.0) - 1.0) / 2.0
SEARCHES = 90  # golden sections: the interval shrinks to round-off


@dataclass(frozen=True)
class Shocked:
    """Behind a shock, or a detonation, that runs into material at rest: density [kg/m3], pressure [Pa], speed of the
    front [m/s] and of the material [m/s]."""

    density: float
    pressure: float
    front: float
    velocity: float


def fluid_hugoniot(eos: FluidEos, density: float, energy: float, pressure: float, behind: float) -> float:
    """Pressure [Pa] at a density `behind` a shock into material of this density, specific energy [J/kg] and pressure.

    e - e0 = (p + p0)(v0 - v)/2 with p = G(rho) + omega(rho) rho e is linear in p.
    """
    (reference, _), (omega, _) = eos.reference(behind), eos.grueneisen(behind)
    half = 0.5 * (1.0 / density - 1.0 / behind)
    share = omega * behind
    return (reference + share * (energy + pressure * half)) / (1.0 - share * half)


def solid_hugoniot(eos: SolidEos, density: float, behind: float) -> float:
    """Pressure [Pa] at a density `behind` a shock into a solid at rest. Laws are linear in the energy."""
    memory: Any = SimpleNamespace(**{column.name: column.initial for column in eos.columns})
    rest = Rest(density, eos.rest_bulk_modulus(density))
    cold, warm = (eos.respond(behind, energy, rest, memory)[0] for energy in (0.0, 1.0))
    return float(cold / (1.0 - (warm - cold) * 0.5 * (1.0 / density - 1.0 / behind)))


def shocked(density: float, pressure: float, behind: float, pressure_behind: float) -> Shocked:
    """The speeds that mass and momentum ask for."""
    strain = 1.0 - density / behind
    front = sqrt((pressure_behind - pressure) / (density * strain))
    return Shocked(behind, pressure_behind, front, front * strain)


def chapman_jouguet(eos: FluidEos, density: float, energy: float) -> Shocked:
    """The slowest detonation of an explosive of this density [kg/m3] that releases this energy [J/kg] into products of
    this equation of state.

    Its speed is the least of all on the Hugoniot of the products, p0 taken for 0. Golden sections find it.
    """

    def squared_speed(compression: float) -> float:
        behind = density * compression
        pressure = fluid_hugoniot(eos, density, energy, 0.0, behind)
        return pressure / (density * (1.0 - 1.0 / compression)) if pressure > 0.0 else inf

    low, high = 1.001, 2.5
    for _ in range(SEARCHES):
        first, second = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        if squared_speed(first) < squared_speed(second):
            high = second
        else:
            low = first
    behind = density * 0.5 * (low + high)
    return shocked(density, 0.0, behind, fluid_hugoniot(eos, density, energy, 0.0, behind))
