"""The polynomial equation of state of a solid."""

import math

import numpy as np
import pytest

from distfsi.laws.law import EosMemory, Rest
from distfsi.laws.solid.eos.polynomial import Polynomial
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from material_point import Point

GLASS, DENSITY = Polynomial(45.4e9, -138e9, 290e9), 2530.0


@pytest.mark.parametrize("mu", [-0.05, 0.01, 0.08, 0.2])
def test_a_point_follows_the_curve(mu):
    point = Point(GLASS, Elastic(30.4e9), DENSITY)
    for _ in range(10):
        point.strain(1.0, -math.log(1.0 + mu) / 30.0 * np.eye(3))
    exact = 45.4e9 * mu + (0.0 if mu < 0.0 else -138e9 * mu**2 + 290e9 * mu**3)
    assert point.pressure[0] == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("mu", [-0.05, 0.01, 0.08, 0.2])
def test_the_bulk_modulus_is_the_slope(mu):
    rest, d = Rest(DENSITY, 45.4e9), 1e-5
    rho = DENSITY * (1.0 + mu)
    ahead, behind = (GLASS.respond(rho * (1.0 + s * d), 0.0, rest, EosMemory())[0] for s in (1.0, -1.0))
    assert GLASS.respond(rho, 0.0, rest, EosMemory())[1] == pytest.approx((ahead - behind) / (2.0 * d), rel=1e-8)


PLATE = """
domain = { lower = -5e-3, upper = 12e-3, cells = 170, x = ["symmetry", "outflow"] }
time = { end = 1 }
[solid.bodies.plate]
shape = { kind = "box", lower = -5e-3, upper = 5e-3 }
spacing = 5e-5
density = 2530
velocity = -200
eos = { kind = "polynomial", K1 = "45.4 GPa", K2 = "-138 GPa", K3 = "290 GPa" }
strength = { kind = "elastic", shear_modulus = "30.4 GPa" }
"""


def test_a_plate_that_hits_a_wall_keeps_its_energy_and_the_jump_conditions(tmp_path):
    (tmp_path / "plate.toml").write_text(PLATE)
    simulation = Simulation.of(load(tmp_path / "plate.toml"), Communicator(), 1)
    solid = simulation.solid
    before = solid.totals()["kinetic"]
    while simulation.time < 1e-6:
        simulation.step()
    c = solid.columns
    plateau = (c["position"][:, 0] > -4.5e-3) & (c["position"][:, 0] < -2e-3)
    stress = (c["pressure"] - c["deviator"][:, 0])[plateau].mean()
    strain = 1.0 - DENSITY / c["density"][plateau].mean()
    assert stress * strain == pytest.approx(DENSITY * 200.0**2, rel=5e-3)  # rho0 U u with U = u/strain
    assert solid.totals()["kinetic"] + solid.totals()["internal"] == pytest.approx(before, rel=1e-9)
