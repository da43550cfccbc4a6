"""The Noble-Abel gas p = (gamma - 1) rho e/(1 - b rho): points, and tubes from the input file to the end of a run."""

import pytest

from distfsi.errors import InputError
from distfsi.laws.fluid.noble_abel import NobleAbel
from distfsi.scene import load
from independent import Material, Riemann, State
from law_checks import check_law, check_tube

GAMMA, B = 1.25, 1e-3
PROPELLANT = Material(
    lambda rho, e: (GAMMA - 1.0) * rho * e / (1.0 - B * rho),
    lambda rho, p: p * (1.0 - B * rho) / ((GAMMA - 1.0) * rho),
    1.0 / B,
)
AIR = Material(lambda rho, e: 0.4 * rho * e, lambda rho, p: p / (0.4 * rho))

TUBE = """
[domain]
lower = 0
upper = 1
cells = 200
[time]
end = 2.5e-4
[fluid]
reconstruction = "van_leer"
[fluid.phases]
propellant = {eos = "noble_abel", gamma = 1.25, covolume = "0.001 m3/kg"}
[[fluid.regions]]
phase = "propellant"
density = 20
pressure = "1 MPa"
[[fluid.regions]]
phase = "propellant"
density = 400
pressure = "200 MPa"
shape = {kind = "box", lower = 0, upper = 0.5}
"""


def test_points():
    check_law(NobleAbel(GAMMA, B), PROPELLANT, [(1.0, 1e5), (400.0, 2e8), (850.0, 3e9)])


def test_a_tube(tmp_path):
    """Dense gas against thin gas: at its density b rho is 0.4."""
    (tmp_path / "tube.toml").write_text(TUBE)
    exact = Riemann(State(PROPELLANT, 400.0, 0.0, 2e8), State(PROPELLANT, 20.0, 0.0, 1e6))
    check_tube(tmp_path / "tube.toml", exact, 0.5, (0.003, 0.006, 0.002))


def test_a_tube_of_two_phases(tmp_path):
    """The propellant drives a shock into air; both relax to one pressure in the cells between them."""
    two = TUBE.replace("[[fluid.regions]]", 'air = {eos = "ideal_gas", gamma = 1.4}\n[[fluid.regions]]', 1)
    (tmp_path / "tube.toml").write_text(two.replace('phase = "propellant"', 'phase = "air"', 1))
    exact = Riemann(State(PROPELLANT, 400.0, 0.0, 2e8), State(AIR, 20.0, 0.0, 1e6))
    check_tube(tmp_path / "tube.toml", exact, 0.5, (0.003, 0.006, 0.002))


def test_too_dense_is_a_fault(tmp_path):
    for given in ('pressure = "1 MPa"', "energy = 1e6"):
        (tmp_path / "tube.toml").write_text(TUBE.replace('pressure = "1 MPa"', given))
        with pytest.raises(InputError, match="too high: 'propellant' has states below 1000 kg/m3 only"):
            load(tmp_path / "tube.toml", ["fluid.regions.0.density=1000"])
