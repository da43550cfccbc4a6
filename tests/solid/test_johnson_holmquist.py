"""The strength model of Johnson and Holmquist for glass and ceramics, against an independent integration."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from distfsi.device.emit import plain
from distfsi.laws.solid.eos.polynomial import Polynomial
from distfsi.laws.solid.failure.principal_stress import PrincipalStress
from distfsi.laws.solid.strength.johnson_holmquist import JohnsonHolmquist
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from material_point import Point

# Float glass of Holmquist et al. 1995: G, A, B, C, M, N; elastic limit and its pressure, T, cap; D1, D2, bulking, rate.
GLASS = JohnsonHolmquist(
    *(30.4e9, 0.93, 0.088, 0.003, 0.35, 0.77), *(5.95e9, 2.92e9, 0.15e9, 0.5), *(0.053, 0.85, 1.0, 1.0)
)
EOS, DENSITY = Polynomial(45.4e9, -138e9, 290e9), 2530.0
UNIT = 1.5 * (5.95e9 - 2.92e9)  # strength at the Hugoniot elastic limit


def test_yield_stresses_by_hand():
    assert GLASS.yield_stress(2.92e9, 1.0, 0.0) == pytest.approx(0.93 * (1.0 + 0.15 / 2.92) ** 0.77 * UNIT)
    assert GLASS.yield_stress(2.92e9, 1.0, 1.0) == pytest.approx(0.088 * UNIT)
    assert GLASS.yield_stress(1e9, 1e4, 0.3) == pytest.approx(
        0.7 * GLASS.yield_stress(1e9, 1e4, 0.0) + 0.3 * GLASS.yield_stress(1e9, 1e4, 1.0)
    )
    faster = 1.0 + 0.003 * math.log(1e4)
    assert GLASS.yield_stress(1e9, 1e4, 0.0) == pytest.approx(faster * GLASS.yield_stress(1e9, 1.0, 0.0))
    assert replace(GLASS, B=9.0).yield_stress(2.92e9, 1.0, 1.0) == pytest.approx(0.5 * UNIT)
    assert GLASS.yield_stress(-0.15e9, 1.0, 0.0) == 0.0


def test_no_more_tension_than_is_left():
    limited = plain(JohnsonHolmquist.limited_tension, {"FAILS": False})
    values = [getattr(GLASS, field.name) for field in fields(GLASS)]
    for pressure, damage, left in ((-1e9, 0.0, -0.15e9), (-1e9, 0.5, -0.075e9), (-1e9, 1.0, 0.0), (1e9, 1.0, 1e9)):
        assert limited(*values, pressure, damage) == left


@pytest.mark.parametrize("bulking", [0.0, 1.0])
def test_uniaxial_compression_follows_the_independent_integration(bulking):
    """Beyond the elastic limit plastic flow damages the glass: by consistency, as rates, integrated by scipy."""
    glass = replace(GLASS, C=0.0, bulking=bulking, D1=0.2, D2=1.0)
    G, K1, K2, K3 = glass.shear_modulus, EOS.K1, EOS.K2, EOS.K3

    def sound(p):
        """Normalised strength of the intact material, and its slope with the pressure."""
        x = (p + 0.15e9) / 2.92e9
        return 0.93 * x**0.77, 0.93 * 0.77 * x**-0.23 / 2.92e9

    def crushed(p):
        x = max(p, 1.0) / 2.92e9
        return min(0.088 * x**0.35, 0.5), 0.088 * 0.35 * x**-0.65 / 2.92e9

    def rates(e, y):
        """Of von Mises stress, plastic strain, damage and bulking pressure with the logarithmic compression e."""
        q, _, D, bulk = y
        mu = math.exp(e) - 1.0
        p = K1 * mu + K2 * mu**2 + K3 * mu**3 + bulk
        dp = (K1 + 2.0 * K2 * mu + 3.0 * K3 * mu**2) * (1.0 + mu)
        (whole, dwhole), (broken, dbroken) = sound(p), crushed(p)
        limit = UNIT * (whole - D * (whole - broken))
        if q < limit * (1.0 - 1e-6):
            return [2.0 * G, 0.0, 0.0, 0.0]
        with_p, with_D = UNIT * ((1.0 - D) * dwhole + D * dbroken), -UNIT * (whole - broken)
        per_flow = 1.0 / (0.2 * (p + 0.15e9) / 2.92e9) if D < 1.0 else 0.0
        bulked = bulking * K1 * q * -with_D * per_flow / (3.0 * G) / (K1 * mu + bulk)
        flow = (2.0 * G - with_p * dp) / (3.0 * G + with_p * bulked + with_D * per_flow)
        return [2.0 * G - 3.0 * G * flow, flow, per_flow * flow, bulked * flow]

    point, end, steps = Point(EOS, glass, DENSITY), 0.16, 8000
    for _ in range(steps):
        point.strain(1e-9, np.diag([-end / steps / 1e-9, 0.0, 0.0]))
    tolerances = {"rtol": 1e-8, "atol": [1e3, 1e-9, 1e-9, 1e3], "max_step": 2e-5}
    q, strain, D, bulk = solve_ivp(rates, (0.0, end), [0.0, 0.0, 0.0, 0.0], "RK45", **tolerances).y[:, -1]
    assert 0.1 < D < 1.0
    assert point.mises[0] == pytest.approx(q, rel=5e-3)
    assert point.plastic_strain[0] == pytest.approx(strain, rel=5e-3)
    assert point.accumulated_damage[0] == pytest.approx(D, rel=5e-3)
    assert point.bulking_pressure[0] == pytest.approx(bulk, rel=5e-3, abs=1.0)


def test_bulking_keeps_what_pressure_can_hold_of_the_lost_energy():
    """All that the deviator loses in one step: (K1 mu + dp)^2 - (K1 mu)^2 = 2 K1 dU."""
    point = Point(EOS, replace(GLASS, C=0.0, D1=0.0), DENSITY)
    for _ in range(1000):
        point.strain(1e-9, np.diag([-0.12 / 1000 / 1e-9, 0.0, 0.0]))
        if point.accumulated_damage[0] > 0.0:
            break
    assert point.accumulated_damage[0] == 1.0
    mu = point.density[0] / DENSITY - 1.0
    intact, fractured = (GLASS.yield_stress(point.pressure[0], 1.0, D) for D in (0.0, 1.0))
    lost = (intact**2 - fractured**2) / (6.0 * 30.4e9)
    gained = (45.4e9 * mu + point.bulking_pressure[0]) ** 2 - (45.4e9 * mu) ** 2
    assert gained == pytest.approx(2.0 * 45.4e9 * lost, rel=1e-9)


def test_glass_cracks_in_tension():
    point, peak = Point(EOS, GLASS, DENSITY, PrincipalStress(0.15e9, 10.0, None)), 0.0
    while point.damage[0] < 1.0:
        point.strain(1.0, np.diag([2e-5, 0.0, 0.0]))
        peak = max(peak, point.normal_stress[0])
    assert peak == pytest.approx(0.15e9, rel=0.02)


PLATE = """
domain = { lower = -5e-3, upper = 12e-3, cells = 170, x = ["symmetry", "outflow"] }
time = { end = 1 }
[solid.bodies.plate]
shape = { kind = "box", lower = -5e-3, upper = 5e-3 }
spacing = 2.5e-5
density = 2530
velocity = -700
eos = { kind = "polynomial", K1 = "45.4 GPa", K2 = "-138 GPa", K3 = "290 GPa" }
[solid.bodies.plate.strength]
kind = "johnson_holmquist"
shear_modulus = "30.4 GPa"
A = 0.93
B = 0.088
C = 0.0
M = 0.35
N = 0.77
hugoniot_elastic_limit = "5.95 GPa"
limit_pressure = "2.92 GPa"
tensile_strength = "0.15 GPa"
fractured_cap = 0.5
D1 = 0.053
D2 = 0.85
bulking = 1
"""


def test_an_elastic_precursor_runs_ahead_of_the_damage(tmp_path):
    """A plate of glass that hits a wall: the stress ahead of plastic flow is that of the elastic limit."""
    (tmp_path / "plate.toml").write_text(PLATE)
    simulation = Simulation.of(load(tmp_path / "plate.toml"), Communicator(), 1)
    solid = simulation.solid
    before = solid.totals()["kinetic"]
    while simulation.time < 0.8e-6:
        simulation.step()
    c = solid.columns
    strains = np.linspace(0.0, 0.12, 2000)
    pressures = np.array([EOS.K1 * m + EOS.K2 * m**2 + EOS.K3 * m**3 for m in np.expm1(strains)])
    limits = np.array([GLASS.yield_stress(p, 1.0, 0.0) for p in pressures])
    first = np.argmax(2.0 * GLASS.shear_modulus * strains > limits)
    stress = c["pressure"] - c["deviator"][:, 0]
    elastic = c["plastic_strain"] == 0.0
    assert stress[elastic].max() == pytest.approx(pressures[first] + 2.0 / 3.0 * limits[first], rel=0.05)
    assert c["accumulated_damage"].max() > 0.5
    assert stress.max() > 1.2 * stress[elastic].max()
    assert solid.totals()["kinetic"] + solid.totals()["internal"] == pytest.approx(before, rel=1e-9)
