"""The strength model of Zerilli and Armstrong, against an independent integration."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.zerilli_armstrong import ZerilliArmstrong
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from launch import ROOT
from material_point import Point

# Armco iron and OFHC copper of Zerilli & Armstrong 1987.
IRON = ZerilliArmstrong(80e9, 65e6, 1033e6, 0.0, 0.00698, 0.000415, 266e6, 0.289, 1e-3, 293.0, 452.0, 0.9)
COPPER = ZerilliArmstrong(45e9, 65e6, 0.0, 890e6, 0.0028, 0.000115, 0.0, 1.0, 1e-3, 293.0, 385.0, 0.9)
SHEAR = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def test_yield_stresses_by_hand():
    iron = 65e6 + 1033e6 * math.exp((-0.00698 + 0.000415 * math.log(1e3)) * 400.0) + 266e6 * 0.2**0.289
    assert IRON.yield_stress(0.2, 1e3, 400.0) == pytest.approx(iron, rel=1e-14)
    copper = 65e6 + 890e6 * math.sqrt(0.2) * math.exp((-0.0028 + 0.000115 * math.log(1e3)) * 400.0)
    assert COPPER.yield_stress(0.2, 1e3, 400.0) == pytest.approx(copper, rel=1e-14)
    assert IRON.yield_stress(0.2, 1e-9, 400.0) == IRON.yield_stress(0.2, 1e-3, 400.0)


@pytest.mark.parametrize("metal", [IRON, COPPER], ids=["body-centred", "face-centred"])
def test_the_slope_is_that_of_the_yield_stress(metal):
    strain, increment, dt, temperature, d = 0.03, 2e-3, 1e-6, 350.0, 1e-6
    ahead, behind = (metal.flow(strain, increment * math.exp(s * d), dt, temperature)[0] for s in (1.0, -1.0))
    assert metal.flow(strain, increment, dt, temperature)[1] == pytest.approx((ahead - behind) / (2.0 * d), rel=1e-7)


@pytest.mark.parametrize(("metal", "density"), [(IRON, 7870.0), (COPPER, 8960.0)], ids=["body-centred", "face-centred"])
def test_a_cycle_of_shear_follows_the_independent_integration(metal, density):
    """Forth and back at 1e4/s: the stress says how fast the metal flows, its work heats it."""
    point, rate, dt = Point(LinearEos(140e9), metal, density), 1e4, 4e-9

    def rates(time, y, sign):
        """Of shear stress, plastic strain and temperature."""
        tau, strain, temperature = y
        thermal = math.sqrt(3.0) * abs(tau) - metal.C0 - metal.C5 * max(strain, 0.0) ** metal.n
        activated = thermal / (metal.C1 + metal.C2 * math.sqrt(max(strain, 1e-12)))
        log_rate = (math.log(max(activated, 1e-300)) / temperature + metal.C3) / metal.C4
        flow = math.exp(min(log_rate, 40.0)) if log_rate > math.log(metal.minimum_rate) else 0.0
        heating = metal.taylor_quinney * math.sqrt(3.0) * abs(tau) * flow / (density * metal.heat_capacity)
        back = math.copysign(math.sqrt(3.0) * flow, tau)
        return [metal.shear_modulus * (sign * rate - back), flow, heating]

    y = [0.0, 0.0, 293.0]
    for sign, duration in ((1.0, 8e-6), (-1.0, 12e-6)):
        for _ in range(round(duration / dt)):
            point.strain(dt, sign * rate * 0.5 * SHEAR)
        tolerances = {"rtol": 1e-9, "atol": [1.0, 1e-12, 1e-9], "max_step": 1e-8}
        y = solve_ivp(rates, (0.0, duration), y, "LSODA", args=(sign,), **tolerances).y[:, -1]
        assert point.plastic_strain[0] > 0.02
        assert point.deviator[0, 3] == pytest.approx(y[0], rel=1e-3)
        assert point.plastic_strain[0] == pytest.approx(y[1], rel=1e-3)
        assert point.temperature[0] - 293.0 == pytest.approx(y[2] - 293.0, rel=2e-3)


def test_a_taylor_bar_of_iron():
    """A coarse bar: the foot flows, is heated by that, and energy is kept."""
    law = (
        "{kind='zerilli_armstrong', shear_modulus='80 GPa', C0='65 MPa', C1='1033 MPa', C3=0.00698, C4=0.000415, "
        "C5='266 MPa', n=0.289, heat_capacity=452}"
    )
    scene = load(
        ROOT / "inputs/taylor_bar.toml", (f"solid.bodies.bar.strength={law}", "solid.bodies.bar.spacing=1.6 mm")
    )
    simulation = Simulation.of(scene, Communicator(), 1)
    before = simulation.solid.totals()
    for _ in range(30):
        simulation.step()
    after, columns = simulation.solid.totals(), simulation.solid.columns
    assert after["kinetic"] + after["internal"] == pytest.approx(before["kinetic"] + before["internal"], rel=1e-9)
    flowed = columns["plastic_strain"] > 0.0
    assert 0.05 < flowed.mean() < 0.9  # from the foot on
    assert np.array_equal(columns["temperature"] > 293.15, flowed)
