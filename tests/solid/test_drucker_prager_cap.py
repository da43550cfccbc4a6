"""The strength model of Drucker and Prager with a cap, against exact answers and an independent integration."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from distfsi.laws.law import Trial
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.failure.principal_stress import PrincipalStress
from distfsi.laws.solid.strength.drucker_prager_cap import DruckerPragerCap
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from material_point import Point

K, G, DENSITY = 200e6, 120e6, 1700.0
SOIL = DruckerPragerCap(G, 50e3, 0.9, 20e3, 2.0, 400e3, 2e-7, 0.15)
EOS = LinearEos(K)
SHEAR = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def squeezed(point, strain, steps, sideways=0.0):
    """Compress by a logarithmic strain along x, and by a share of it `sideways`."""
    for _ in range(steps):
        point.strain(1.0, -strain / steps * np.diag([1.0, sideways, sideways]))
    return point


def test_hydrostatic_pressure_follows_the_hardening():
    point = squeezed(Point(EOS, SOIL, DENSITY), 0.02, 200, sideways=1.0)
    e = point.compacted_strain[0]
    assert 0.01 < e < 0.06
    assert point.pressure[0] == pytest.approx(400e3 - math.log(1.0 - e / 0.15) / 2e-7, rel=1e-9)
    assert math.log(point.density[0] / DENSITY) == pytest.approx(e + math.log1p(point.pressure[0] / K), rel=1e-4)


def test_compacted_soil_unloads_elastically_and_stays_denser():
    point = squeezed(Point(EOS, SOIL, DENSITY), 0.02, 200, sideways=1.0)
    compacted, peak = point.compacted_strain[0], point.pressure[0]
    elastic = math.log1p(peak / K)
    squeezed(point, -elastic / 3.0, 50, sideways=1.0)
    assert point.compacted_strain[0] == compacted
    assert point.density[0] == pytest.approx(DENSITY * math.exp(compacted), rel=1e-4)
    assert abs(point.pressure[0]) < 1e-2 * peak


def test_shear_ends_on_the_line_of_the_pressure():
    point = squeezed(Point(EOS, SOIL, DENSITY), 1e-4, 10, sideways=1.0)
    pressure = point.pressure[0]
    assert 0.0 < pressure < SOIL.cap_start(0.0)
    for _ in range(200):
        point.strain(1.0, 1e-5 * SHEAR)
    assert point.pressure[0] == pytest.approx(pressure, rel=1e-12)
    assert point.mises[0] == pytest.approx(50e3 + 0.9 * pressure, rel=1e-12)
    assert point.plastic_strain[0] > 0.0


def test_no_more_tension_than_the_strength_or_what_cracks_let():
    for failure, limit in ((None, 20e3), (PrincipalStress(15e3, 0.0, None), 15e3)):
        point, peak = Point(EOS, SOIL, DENSITY, failure), 0.0
        for _ in range(200):
            point.strain(1.0, 1e-6 * np.eye(3))
            peak = max(peak, -point.pressure[0])
        assert peak == pytest.approx(limit, rel=0.05)


@pytest.mark.parametrize("before", [0.0, 0.01, 0.14])
@pytest.mark.parametrize("pressure", [0.2e6, 1e6, 10e6])
@pytest.mark.parametrize("stress", [0.0, 0.5e6, 20e6])
def test_the_return_ends_on_the_cap_or_inside(before, pressure, stress):
    trial = Trial(stress, pressure + SOIL.cap_start(before), DENSITY, 0.0, K, K, 1.0, 0.0, 0.0)
    if not SOIL.is_beyond_cap(trial, before):
        return
    x = SOIL.compaction(trial, before)
    scale = SOIL.excess(trial, before, 0.0)[0]
    assert x > 0.0
    assert abs(SOIL.excess(trial, before, x)[0]) < 1e-6 * scale


def test_the_slope_of_the_excess():
    trial, x, d = Trial(2e6, 3e6, DENSITY, 0.0, K, K, 1.0, 0.0, 0.0), 5e-3, 1e-7
    ahead, behind = (SOIL.excess(trial, 0.01, x + s * d)[0] for s in (1.0, -1.0))
    assert SOIL.excess(trial, 0.01, x)[1] == pytest.approx((ahead - behind) / (2.0 * d), rel=1e-6)


@pytest.mark.parametrize("friction", [0.9, 3.0], ids=["by line and cap", "by the cap alone"])
def test_uniaxial_compression_follows_the_independent_integration(friction):
    """Elastic, then along the line if it is met, then on the cap: by consistency, as rates, integrated by scipy."""
    soil = replace(SOIL, friction=friction)
    R, d = soil.eccentricity, soil.cohesion

    def cap(e):
        """p_a, the extent of the cap, and their slopes with the compaction."""
        top, slope = 400e3 - math.log(1.0 - e / 0.15) / 2e-7, 1.0 / (2e-7 * (0.15 - e))
        start, moved = (top - R * d) / (1.0 + R * friction), slope / (1.0 + R * friction)
        return start, top - start, moved, slope - moved

    def rates(strain, y):
        """Of von Mises stress, plastic strain and compaction with the logarithmic compression."""
        q, _, e = y
        p, modulus = K * math.expm1(strain - e), K * math.exp(strain - e)
        start, extent, moved, wider = cap(e)
        s = p - start
        if s > 0.0 and s * s + R * R * q * q > extent * extent * (1.0 - 1e-9):
            above = s * modulus + 2.0 * G * R * R * q
            below = modulus * s * s + 3.0 * G * R**4 * q * q + moved * s * s + extent * wider * s
            flow = above / below
            return [2.0 * G - 3.0 * G * flow * R * R * q, flow * R * R * q, flow * s]
        if s <= 0.0 and q > (d + friction * p) * (1.0 - 1e-9):
            return [friction * modulus, (2.0 * G - friction * modulus) / (3.0 * G), 0.0]
        return [2.0 * G, 0.0, 0.0]

    point = squeezed(Point(EOS, soil, DENSITY), 0.05, 4000)
    tolerances = {"rtol": 1e-9, "atol": [1e-1, 1e-11, 1e-11], "max_step": 2e-6}
    q, strain, e = solve_ivp(rates, (0.0, 0.05), [0.0, 0.0, 0.0], "RK23", **tolerances).y[:, -1]
    assert 0.01 < e < 0.05
    assert point.compacted_strain[0] == pytest.approx(e, rel=2e-3)
    assert point.plastic_strain[0] == pytest.approx(strain, rel=2e-3)
    assert point.mises[0] == pytest.approx(q, rel=2e-3)
    assert point.pressure[0] == pytest.approx(K * math.expm1(0.05 - e), rel=5e-3)


BLOCK = """
domain = { lower = 0, upper = 1.5, cells = 15, x = ["symmetry", "outflow"] }
time = { end = 1 }
[solid.bodies.soil]
shape = { kind = "box", lower = 0, upper = 1 }
spacing = 0.01
density = 1700
velocity = -20
eos = { kind = "linear", bulk_modulus = "200 MPa" }
[solid.bodies.soil.strength]
kind = "drucker_prager_cap"
shear_modulus = "120 MPa"
cohesion = "50 kPa"
friction = 0.9
eccentricity = 2
cap_pressure = "400 kPa"
hardening = 2e-7
maximum_compaction = 0.15
"""


def test_a_block_of_soil_that_hits_a_wall_is_compacted(tmp_path):
    """Behind the wave the stress is that of a point compressed as far, and most of the compression is for good."""
    (tmp_path / "soil.toml").write_text(BLOCK)
    simulation = Simulation.of(load(tmp_path / "soil.toml"), Communicator(), 1)
    solid = simulation.solid
    before = solid.totals()["kinetic"]
    while simulation.time < 4e-3:
        simulation.step()
    c = solid.columns
    behind = (c["position"][:, 0] > 0.1) & (c["position"][:, 0] < 0.3)
    strain = np.log(c["density"][behind] / DENSITY).mean()
    stress = (c["pressure"] - c["deviator"][:, 0])[behind].mean()
    assert stress == pytest.approx(-squeezed(Point(EOS, SOIL, DENSITY), strain, 2000).normal_stress[0], rel=0.05)
    assert 0.7 * strain < c["compacted_strain"][behind].mean() < strain
    assert solid.totals()["kinetic"] + solid.totals()["internal"] == pytest.approx(before, rel=1e-9)
