"""Equations of state as a scene needs them before a run, from the laws' own formulas; the sound of solids. What no law
covers is NaN."""

from __future__ import annotations

from math import nan, sqrt

from distfsi.laws.law import FluidEos
from distfsi.scene.description import Body


def pressure(eos: FluidEos, density: float, energy: float) -> float:
    """Pressure [Pa] from density [kg/m3] and specific internal energy [J/kg]."""
    if density >= eos.maximum_density:
        return nan
    (omega, _), (p_cold, e_cold) = eos.grueneisen(density), eos.cold_curve(density)
    return p_cold + omega * density * (energy - e_cold)


def energy(eos: FluidEos, density: float, pressure: float) -> float:
    """Specific internal energy [J/kg] from density [kg/m3] and pressure [Pa]."""
    if density >= eos.maximum_density:
        return nan
    (omega, _), (p_cold, e_cold) = eos.grueneisen(density), eos.cold_curve(density)
    return e_cold + (pressure - p_cold) / (omega * density)


def sound_speed_squared(eos: FluidEos, density: float, pressure: float) -> float:
    """Slope of the pressure with the density [m2/s2] along the isentrope (fluid/formulas/stiffness.py)."""
    if density >= eos.maximum_density:
        return nan
    (omega, omega_slope), (reference, slope) = eos.grueneisen(density), eos.reference(density)
    weight = 1.0 + density * omega_slope / omega
    return slope + (weight * (pressure - reference) + omega * pressure) / density


def solid_sound(body: Body) -> float:
    """Longitudinal sound speed [m/s] of a body at rest."""
    bulk = body.eos.rest_bulk_modulus(body.density)
    return sqrt((bulk + 4.0 / 3.0 * body.strength.shear_modulus) / body.density)
