"""Equations of state as a scene needs them before a run: p = p_cold(rho) + G rho (e - e_cold(rho)) for all of them."""

from __future__ import annotations

from math import exp

from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.laws.law import FluidEos


def grueneisen(eos: FluidEos) -> float:
    """G = (dp/de)_rho / rho."""
    return eos.omega if isinstance(eos, Jwl) else eos.gamma - 1.0


def cold_curve(eos: FluidEos, density: float) -> tuple[float, float, float]:
    """Pressure [Pa], energy [J/kg] and dp/drho [m2/s2] of the reference curve, on which the sound speed vanishes
    but for the curve's own slope."""
    match eos:
        case IdealGas():
            return 0.0, 0.0, 0.0
        case StiffenedGas(_, p_inf):
            return -p_inf, p_inf / density, 0.0
        case Jwl(rho0, A, B, R1, R2, _):
            v = rho0 / density
            a, b = A * exp(-R1 * v), B * exp(-R2 * v)
            return a + b, a / (rho0 * R1) + b / (rho0 * R2), (R1 * a + R2 * b) * v / density


def pressure(eos: FluidEos, density: float, energy: float) -> float:
    """Pressure [Pa] from density [kg/m3] and specific internal energy [J/kg]."""
    p_cold, e_cold, _ = cold_curve(eos, density)
    return p_cold + grueneisen(eos) * density * (energy - e_cold)


def energy(eos: FluidEos, density: float, pressure: float) -> float:
    """Specific internal energy [J/kg] from density [kg/m3] and pressure [Pa]."""
    p_cold, e_cold, _ = cold_curve(eos, density)
    return e_cold + (pressure - p_cold) / (grueneisen(eos) * density)


def sound_speed_squared(eos: FluidEos, density: float, pressure: float) -> float:
    """c2 = dp_cold/drho + (G + 1)(p - p_cold)/rho [m2/s2], since de_cold = p_cold/rho2 drho."""
    p_cold, _, slope = cold_curve(eos, density)
    return slope + (grueneisen(eos) + 1.0) * (pressure - p_cold) / density
