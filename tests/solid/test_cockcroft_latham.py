"""The failure model of Cockcroft and Latham, against exact answers and an independent integration."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.failure.cockcroft_latham import CockcroftLatham
from distfsi.laws.solid.scatter import Scatter
from distfsi.laws.solid.strength.linear_hardening import LinearHardening
from distfsi.laws.solid.strength.perfectly_plastic import PerfectlyPlastic
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.solid.materials import crack_width
from material_point import Point

STEEL, WIDTH = LinearEos(160e9), crack_width(1.3, 3)
Y, G = 400e6, 77e9
SHEAR = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def test_shear_breaks_where_its_tension_has_done_the_work():
    """In shear the largest principal stress is Y/sqrt(3)."""
    critical = 50e6
    point = Point(STEEL, PerfectlyPlastic(G, Y), failure=CockcroftLatham(critical, 0.0, None))
    while point.damage[0] == 0.0:
        strain = point.plastic_strain[0]
        assert point.ductile_damage[0] == pytest.approx(Y / math.sqrt(3.0) * strain / critical, rel=1e-9, abs=1e-12)
        point.strain(1e-8, 1e4 * SHEAR)
    assert point.plastic_strain[0] == pytest.approx(critical * math.sqrt(3.0) / Y, abs=2e-4)
    assert point.damage[0] == 1.0


def test_nothing_breaks_under_pressure():
    point = Point(STEEL, PerfectlyPlastic(G, Y), failure=CockcroftLatham(1e6, 0.0, None))
    for _ in range(1000):
        point.strain(1e-8, np.diag([-2e4, 0.0, 0.0]))
    assert point.plastic_strain[0] > 0.1
    assert (point.ductile_damage[0], point.damage[0]) == (0.0, 0.0)


def test_hardening_in_uniaxial_strain_follows_the_independent_integration():
    """The mean stress grows with the volume, the flow stress with the plastic strain: both are in the tension."""
    hardening, critical, K, rate = 2e9, 40e6, 160e9, 1e4
    point = Point(STEEL, LinearHardening(G, Y, hardening), failure=CockcroftLatham(critical, 0.0, None))

    def slopes(time, y):
        """Of von Mises stress, plastic strain and used share, in a stretch along x."""
        mises, strain, used = y
        flow = 2.0 * G * rate / (3.0 * G + hardening) if mises >= Y + hardening * strain else 0.0
        mean = K * (1.0 - math.exp(-rate * time))
        return [2.0 * G * rate - 3.0 * G * flow, flow, (mean + 2.0 / 3.0 * mises) * flow / critical]

    for _ in range(400):
        point.strain(1e-9, np.diag([rate, 0.0, 0.0]))
    exact = solve_ivp(slopes, (0.0, 4e-7), [0.0, 0.0, 0.0], rtol=1e-8, atol=[1e2, 1e-10, 1e-10], max_step=1e-10).y[
        :, -1
    ]
    assert 0.0 < exact[2] < 1.0
    assert point.plastic_strain[0] == pytest.approx(exact[1], rel=1e-3)
    assert point.ductile_damage[0] == pytest.approx(exact[2], rel=5e-3)


@pytest.mark.parametrize("spacing", [0.25e-3, 1e-3])
def test_a_crack_takes_its_energy_at_any_spacing(spacing):
    energy, dt, rate = 2e4, 2e-9, 1e4
    point = Point(STEEL, PerfectlyPlastic(G, Y), failure=CockcroftLatham(40e6, energy, None), spacing=spacing)
    work = 0.0
    while point.damage[0] < 1.0:
        before, opened = point.deviator[0, 3], point.ductile_damage[0] >= 1.0
        point.strain(dt, rate * 0.5 * SHEAR)
        work += opened * 0.5 * (before + point.deviator[0, 3]) * rate * dt
    assert work * WIDTH * spacing == pytest.approx(energy, rel=0.01)


def test_scatter_scales_the_critical_work():
    failure = CockcroftLatham(50e6, 0.0, Scatter(5.0, 1e-3, 3))
    points = Point(STEEL, PerfectlyPlastic(G, Y), failure=failure, count=20)
    for _ in range(200):
        points.strain(1e-8, 1e4 * SHEAR)
    assert np.allclose(
        points.ductile_damage * points.strength_scatter, points.ductile_damage[0] * points.strength_scatter[0]
    )


RING = """
domain = { lower = [-2, -2], upper = [2, 2], cells = [16, 16] }
time = { end = 1 }
[solid.bodies.ring]
shape = { kind = "tube", center = [0, 0], inner_radius = 0.6, outer_radius = 0.8 }
spacing = 0.05
density = 7830
radial_velocity = 300
eos = { kind = "linear", bulk_modulus = "160 GPa" }
strength = { kind = "perfectly_plastic", shear_modulus = "77 GPa", yield_stress = "400 MPa" }
failure = { kind = "cockcroft_latham", critical_work = "40 MPa", scatter = { modulus = 10, size = 0.05 } }
"""


def test_a_ring_that_flies_apart_breaks_into_pieces(tmp_path):
    (tmp_path / "ring.toml").write_text(RING)
    simulation = Simulation.of(load(tmp_path / "ring.toml"), Communicator(), 1)
    solid = simulation.solid
    while solid.columns["damage"].max() == 0.0:
        assert len(solid.pieces()["piece"]) == 1
        simulation.step()
    assert solid.columns["plastic_strain"].max() == pytest.approx(40e6 / (2.0 / math.sqrt(3.0) * Y), rel=0.3)
    for _ in range(60):
        simulation.step()
    assert (solid.pieces()["particles"] > 3).sum() > 1
