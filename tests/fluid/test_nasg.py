"""The Noble-Abel stiffened gas: points, and tubes from the input file to the end of a run.

Water as in Le Metayer and Saurel (2016), Table III.
"""

import numpy as np
import pytest

from distfsi.device.emit import plain
from distfsi.device.source import Bound
from distfsi.laws.fluid.nasg import Nasg
from independent import Material, Riemann, State
from law_checks import check_law, check_tube

GAMMA, P_INF, B, Q = 1.19, 7.028e8, 6.61e-4, -1.177788e6
LIQUID = Nasg(GAMMA, P_INF, B, Q)
WATER = Material(
    lambda rho, e: (GAMMA - 1.0) * (e - Q) * rho / (1.0 - B * rho) - GAMMA * P_INF,
    lambda rho, p: (p + GAMMA * P_INF) * (1.0 - B * rho) / ((GAMMA - 1.0) * rho) + Q,
    1.0 / B,
)
AIR = Material(lambda rho, e: 0.4 * rho * e, lambda rho, p: p / (0.4 * rho))

TUBE = """
[domain]
lower = 0
upper = 1
cells = 200
[time]
end = 1.5e-4
[fluid]
reconstruction = "van_leer"
[fluid.phases]
water = {eos = "nasg", gamma = 1.19, p_inf = "702.8 MPa", covolume = "6.61e-4 m3/kg", q = "-1177788 J/kg"}
[[fluid.regions]]
phase = "water"
density = 950
pressure = "1 MPa"
[[fluid.regions]]
phase = "water"
density = 1050
pressure = "500 MPa"
shape = {kind = "box", lower = 0, upper = 0.5}
"""


def test_points():
    check_law(LIQUID, WATER, [(957.7, 1e5), (1100.0, 2e9), (1300.0, 2e10)])


def test_shifted_reference():
    """Energies counted from those at 950 kg/m3 without pressure give the same pressure."""
    bound = Bound.of(LIQUID, "shifted_reference")
    shifted = plain(bound.function, {**bound.constants, "REST_DENSITY": 950.0})
    for rho in (900.0, 950.0, 1200.0):
        e = WATER.energy(rho, 3e8)
        (reference, slope), (omega, _) = shifted(rho), LIQUID.grueneisen(rho)
        assert reference + omega * rho * (e - WATER.energy(950.0, 0.0)) == pytest.approx(3e8, rel=1e-9)
        assert slope == pytest.approx(np.imag(shifted(complex(rho, 1e-20 * rho))[0]) / (1e-20 * rho), rel=1e-12)
    assert shifted(950.0)[0] == 0.0


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_tube(tmp_path, precision):
    """Also in single precision, where energies themselves would leave no digits for the pressure."""
    (tmp_path / "tube.toml").write_text(TUBE.replace("[fluid]", f'[fluid]\nprecision = "{precision}"'))
    exact = Riemann(State(WATER, 1050.0, 0.0, 5e8), State(WATER, 950.0, 0.0, 1e6))
    check_tube(tmp_path / "tube.toml", exact, 0.5, (0.01, 0.01, 0.005))


def test_a_tube_of_two_phases(tmp_path):
    """Water drives a shock into dense air; both relax to one pressure in the cells between them."""
    two = TUBE.replace("[[fluid.regions]]", 'air = {eos = "ideal_gas", gamma = 1.4}\n[[fluid.regions]]', 1)
    two = two.replace('phase = "water"\ndensity = 950', 'phase = "air"\ndensity = 50', 1)
    (tmp_path / "tube.toml").write_text(two)
    exact = Riemann(State(WATER, 1050.0, 0.0, 5e8), State(AIR, 50.0, 0.0, 1e6))
    check_tube(tmp_path / "tube.toml", exact, 0.5, (0.006, 0.009, 0.005))
