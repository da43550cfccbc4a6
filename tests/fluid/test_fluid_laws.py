"""Equations of state of fluids: each law's formulas against its pressure as the literature writes it."""

from dataclasses import dataclass

import numpy as np
import pytest

from distfsi.laws.law import FluidEos
from distfsi.laws.registry import laws_of
from fluids import AIR, TNT, WATER
from independent import Material, Riemann, State
from law_checks import check_law, check_relaxation


def test_ideal_gas():
    gas = Material(lambda rho, e: 0.4 * rho * e, lambda rho, p: p / (0.4 * rho))
    check_law(AIR, gas, [(1.2, 1e5), (150.0, 3e8)])


def test_stiffened_gas():
    water = Material(lambda rho, e: 3.4 * rho * e - 4.4 * 6e8, lambda rho, p: (p + 4.4 * 6e8) / (3.4 * rho))
    check_law(WATER, water, [(1000.0, 1e5), (1100.0, 2e9)])


def test_jwl():
    def reference(rho):
        v = 1630.0 / rho
        a, b = TNT.A * np.exp(-4.15 * v), TNT.B * np.exp(-0.95 * v)
        return a * (1.0 - 0.3 / (4.15 * v)) + b * (1.0 - 0.3 / (0.95 * v))

    products = Material(
        lambda rho, e: reference(rho) + 0.3 * rho * e, lambda rho, p: (p - reference(rho)) / (0.3 * rho)
    )
    check_law(TNT, products, [(1630.0, 8.4e9), (400.0, 3e8), (2.0, 2e5)])


@dataclass(frozen=True)
class Porous(FluidEos):
    """No law of the package: omega = 0.4 + rho/1000 and a reference that is no constant, p = rho^2 + omega rho e."""

    def reference(self, rho):
        return (rho * rho, 2.0 * rho)

    def grueneisen(self, rho):
        return (0.4 + 1e-3 * rho, 1e-3)

    def cold_curve(self, rho):
        return (0.0, 0.0)


def test_relaxation_of_any_law():
    """Where the path is no hyperbola and omega is no constant."""
    porous = Material(
        lambda rho, e: rho**2 + (0.4 + 1e-3 * rho) * rho * e, lambda rho, p: (p - rho**2) / ((0.4 + 1e-3 * rho) * rho)
    )
    for state in ((500.0, 1e6), (50.0, 1e5), (1500.0, 1e8)):
        check_relaxation(Porous(), porous, *state)


def test_independent_waves():
    """Sod's tube (Toro, Table 4.2)."""
    air = Material(lambda rho, e: 0.4 * rho * e, lambda rho, p: p / (0.4 * rho))
    tube = Riemann(State(air, 1.0, 0.0, 1.0), State(air, 0.125, 0.0, 0.1))
    assert tube.star == pytest.approx((0.30313, 0.92745), abs=5e-6)
    rho, _, _ = tube.sample(np.array([0.5, 1.5]))
    assert rho == pytest.approx((0.42632, 0.26557), abs=5e-6)


def test_laws_are_found_by_their_files():
    words = [law.__module__.rpartition(".")[2] for law in laws_of(FluidEos)]
    assert {"ideal_gas", "stiffened_gas", "jwl"} <= set(words)
    assert len(set(words)) == len(words)
