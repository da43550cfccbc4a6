"""Charges: their mass in the cells, what `check` and a run say of them, and constants that no material has."""

import math

import numpy as np
import pytest

from distfsi.diagnostics.budget import Budget
from distfsi.mesh.communicator import Communicator
from distfsi.resources.report import report
from distfsi.scene import load
from distfsi.scene.advice import advice
from distfsi.scene.placed_charges import LOSSES, charges, distances, losses
from distfsi.scene.signals import Layout
from distfsi.scene.warnings import warnings
from distfsi.simulation import Simulation
from launch import ROOT

SMALL = """
[domain]
lower = ["-0.6 m", "-0.6 m", "-0.6 m"]
upper = ["0.6 m", "0.6 m", "0.6 m"]
cells = [10, 10, 10]
x = ["wall", "wall"]
y = ["wall", "wall"]
z = ["wall", "wall"]
[time]
end = "20 us"
[fluid.phases.tnt]
eos = "jwl"
rho0 = 1630
A = "371.2 GPa"
B = "3.21 GPa"
R1 = 4.15
R2 = 0.95
omega = 0.3
[fluid.phases.air]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "air"
density = 1.225
pressure = "1 atm"
[[fluid.regions]]
phase = "tnt"
density = 1630
energy = "4.29 MJ/kg"
shape = { kind = "ball", center = [0.01, 0.02, 0.03], radius = "5 mm" }
[gauges.near]
kind = "point"
position = [0.31, 0.02, 0.03]
"""


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL + f'[output]\ndirectory = "{tmp_path}/out"\n')
    return path


def mass_of_products(scene):
    """Beyond the traces in the air [kg]."""
    fluid = Simulation.of(scene, Communicator(), 1).fluid
    U = fluid.cells(0)
    return float((U[0] - U[0].min()).sum() * math.prod(scene.domain.spacing))


@pytest.mark.parametrize("radius", ["5 mm", "24.47 mm", "60 mm", "130 mm"])
@pytest.mark.parametrize("cells", ["[10,10,10]", "[7,9,12]"])
def test_a_charge_of_any_size_has_its_mass(small, radius, cells):
    """Before, 0.2 % of one of 5 mm was there, and 93 % of one of 24.5 mm."""
    scene = load(small, [f"fluid.regions.1.shape.radius={radius}", f"domain.cells={cells}"])
    exact = 1630.0 * 4.0 / 3.0 * math.pi * (1e-3 * float(radius.split()[0])) ** 3
    (charge,) = charges(scene)
    assert charge.meant == pytest.approx(exact, rel=1e-13)
    assert charge.placed == pytest.approx(exact, rel=1e-9)
    assert mass_of_products(scene) == pytest.approx(exact, rel=2e-5)
    assert "fills no cell" not in " ".join(advice(scene, Layout(scene)))


def test_momentum_at_rest_is_no_error(small):
    """It is measured by a slow motion of all that is there, not by its own round-off."""
    simulation = Simulation.of(load(small), Communicator(), 1)
    budget = Budget(simulation.fluid, None, None)
    budget.row(simulation)
    while not simulation.done:
        simulation.step()
    row = budget.row(simulation)
    assert max(abs(value) for name, value in row.items() if name.startswith("drift")) < 1e-13
    assert "Conservation error" in budget.summary(simulation)


def test_what_is_told_of_a_charge(small):
    scene = load(small, ["fluid.regions.1.shape.radius='120 mm'", "domain.cells=[20,20,20]"])
    (charge,) = charges(scene)
    assert charge.cells == pytest.approx(2.0)
    assert charge.tnt == pytest.approx(charge.meant * 4.29 / 4.184)
    ((name, length),) = distances(scene, charge)
    assert name == "gauge 'near'"
    assert length == pytest.approx(0.3)
    text = report(scene)
    assert f"Z = {0.3 / charge.tnt ** (1 / 3):.3g} m/kg^(1/3)" in text
    assert "as placed, 2 cells per radius" in text
    (told,) = warnings(scene)
    assert told.startswith("charge 'tnt': 2 cells per radius")
    assert list(warnings(load(small, ["fluid.regions.1.shape.radius='480 mm'", "domain.cells=[20,20,20]"]))) == []


def test_what_hides_a_charge_is_told(small):
    box = "{kind='box', lower=[-0.6,-0.6,-0.6], upper=[0.0,0.6,0.6]}"
    eos, strength = "{kind='linear', bulk_modulus='160 GPa'}", "{kind='elastic', shear_modulus='80 GPa'}"
    body = f"solid={{bodies={{wall={{shape={box}, spacing=0.05, density=7800, eos={eos}, strength={strength}}}}}}}"
    scene = load(small, ["fluid.regions.1.shape.radius=0.1", body])
    (charge,) = charges(scene)
    assert charge.placed < 0.7 * charge.meant
    told = " ".join(warnings(scene))
    assert "the rest is hidden" in told
    assert "into body 'wall'" in told


def test_a_quarter_counts_as_a_whole():
    scene = load(ROOT / "inputs/concrete_slab.toml")
    (charge,) = charges(scene)
    assert charge.copies == 8
    whole = 1630.0 * 4.0 / 3.0 * math.pi * 0.0407**3
    assert charge.tnt == pytest.approx(whole * 4.29 / 4.184, rel=1e-3)


def test_losses_fall_with_the_number_of_cells():
    numbers = np.array(LOSSES)
    assert (np.diff(numbers[:, 1]) < 0.0).all()
    assert losses(4.0)[0] == pytest.approx(np.interp(np.log(4.0), np.log([3.0, 5.0]), numbers[2:4, 1]))
    assert losses(100.0) == tuple(numbers[-1, 1:])


@pytest.mark.parametrize(
    ("input", "setting", "words"),
    [
        ("concrete_slab", "fluid.regions.1.energy='7 GJ/kg'", "J/kg; explosives have"),
        ("concrete_slab", "fluid.regions.1.density=20", "known explosives have"),
        ("burst_tube", "solid.bodies.tube.failure.D3=2.12", "D3 = 2.12"),
        ("plate_impact", "solid.bodies.left.density=8.93", "known solids have"),
        ("panel", "solid.bodies.panel.eos.bulk_modulus='215.7e6 GPa'", "m/s fast"),
    ],
)
def test_constants_that_no_material_has_are_told(input, setting, words):
    scene = load(ROOT / f"inputs/{input}.toml", [setting])
    assert words in " ".join(warnings(scene))
    assert words not in " ".join(warnings(load(ROOT / f"inputs/{input}.toml")))
