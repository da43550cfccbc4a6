"""Charges by name, mass and place: exactly their mass whatever the cells, in any block, down to parts of a cell."""

import csv
from math import pi

import pytest

from distfsi.errors import InputError
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.description import Ball, Box, Cylinder, PointDetonator
from distfsi.simulation import Simulation
from launch import run_ranks

AIR = """
[domain]
lower = [0, 0, 0]
upper = ["0.4 m", "0.3 m", "0.2 m"]
cells = [16, 12, 8]
x = ["symmetry", "outflow"]
y = ["wall", "outflow"]
z = ["symmetry", "outflow"]
[time]
end = "30 us"
[fluid.phases.air]
material = "air"
[[fluid.regions]]
phase = "air"
[performance]
block_cells = [8, 8, 8]
"""
CHARGE = """
[[charges]]
material = "C-4"
mass = "1 kg"
center = ["0.2 m", "0.15 m", "0.1 m"]
"""


@pytest.fixture
def scene(tmp_path):
    """The scene of a text with overrides."""

    def read(text, *overrides):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return load(path, [f'output.directory="{tmp_path}/out"', *overrides])

    return read


def mass_in(scene):
    """Mass [kg] of the explosive at the start, but for traces in the air."""
    simulation = Simulation.of(scene, Communicator(), 1)
    masses = simulation.fluid.totals()[0][:2]
    cells = simulation.fluid.blocks.grid.cells
    return masses[1], simulation, cells


@pytest.mark.parametrize(
    ("keys", "mass"),
    [
        ("", "1 kg"),
        ("", "10 g"),
        ("", "0.3 g"),  # a hundredth of a cell
        ('shape = "cylinder"\naxis = [1, 0, 0]\nlength_over_diameter = 2', "1 kg"),
        ('shape = "box"\nproportions = [1, 2, 0.5]', "0.5 kg"),
    ],
)
def test_a_charge_has_its_mass_whatever_the_cells(scene, keys, mass):
    for cells in ([16, 12, 8], [10, 9, 5]):
        found = scene(AIR + CHARGE + keys, f'charges.0.mass="{mass}"', f"domain.cells={cells}")
        held, simulation, _ = mass_in(found)
        wanted = {"1 kg": 1.0, "10 g": 0.01, "0.3 g": 3e-4, "0.5 kg": 0.5}[mass]
        trace = simulation.fluid.held_energies()[0] / simulation.fluid.model.constants["HELD_ENERGY"][0]
        assert trace == pytest.approx(wanted, rel=2e-6)  # of which 1e-6 of a pure cell is air
        assert held == pytest.approx(wanted, rel=1e-4, abs=1e-7)


def test_a_corner_of_a_charge_is_its_part_and_a_hemisphere_a_whole(scene):
    eighth = scene(AIR + CHARGE, "charges.0.center=[0, 0.15, 0]")
    assert mass_in(eighth)[0] == pytest.approx(0.25, rel=1e-4)
    half = scene(AIR + CHARGE, "charges.0.center=[0.2, 0, 0.1]", "charges.0.shape=hemisphere")
    assert mass_in(half)[0] == pytest.approx(1.0, rel=1e-4)


def test_a_charge_makes_phase_region_and_detonator(scene):
    found = scene(AIR + CHARGE + 'detonator = [0.2, 0.15, 0.12]\ndelay = "1 us"')
    assert [phase.name for phase in found.fluid.phases] == ["air", "c4"]
    assert isinstance(found.fluid.regions[1].shape, Ball)
    assert found.fluid.regions[1].shape.radius == pytest.approx((3.0 / 1601.0 / (4.0 * pi)) ** (1.0 / 3.0))
    assert found.fluid.detonation.detonators == (PointDetonator((0.2, 0.15, 0.12), 1e-6),)
    (note,) = found.notes
    assert "1 kg of C4, a sphere of radius 53.03 mm" in note
    assert "TNT equivalent 1.37 kg by pressure, 1.19 kg by impulse, 1.309 kg by energy of detonation" in note


def test_shapes_of_charges(scene):
    cylinder = scene(AIR + CHARGE + 'shape = "cylinder"\nlength_over_diameter = 3').fluid.regions[1].shape
    assert isinstance(cylinder, Cylinder)
    assert cylinder.end[2] - cylinder.start[2] == pytest.approx(6.0 * cylinder.radius)
    box = scene(AIR + CHARGE + 'shape = "box"\nproportions = [2, 1, 1]').fluid.regions[1].shape
    assert isinstance(box, Box)
    edges = [b - a for a, b in zip(box.lower, box.upper, strict=True)]
    assert edges[0] == pytest.approx(2.0 * edges[1]) and edges[0] * edges[1] * edges[2] == pytest.approx(1.0 / 1601.0)


def test_two_charges_of_one_explosive_and_one_that_burns_at_once(scene):
    second = CHARGE.replace("0.2 m", "0.3 m").replace("1 kg", "0.2 kg")
    found = scene(AIR + CHARGE + second)
    assert len(found.fluid.phases) == 2 and len(found.fluid.detonation.detonators) == 2
    at_once = scene(AIR + CHARGE + 'burn = "instant"')
    assert at_once.fluid.detonation is None
    assert at_once.fluid.regions[1].state.pressure == pytest.approx(1.02e10, rel=0.2)


@pytest.mark.parametrize("mass", ["1 kg", "1 g"])
def test_a_charge_burns_and_keeps_its_energy(scene, mass):
    """Also one that is a part of a cell: its energy stays its own, and is not shared with the cell's air."""
    simulation = Simulation.of(scene(AIR + CHARGE, f'charges.0.mass="{mass}"'), Communicator(), 1)
    fluid = simulation.fluid
    before, held = fluid.totals()[0], fluid.held_energies()[0]
    while not simulation.done:
        simulation.step()
    after = fluid.totals()[0] + fluid.left_domain()
    assert after[[0, 1, -1]] == pytest.approx(before[[0, 1, -1]], rel=1e-12)
    assert fluid.held_energies()[0] < 1e-9 * held


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (CHARGE.replace("C-4", "TNN"), "did you mean 'TNT'"),
        (CHARGE.replace("C-4", "air"), "names no such material"),
        (CHARGE.replace('mass = "1 kg"\n', ""), "charges.0.mass"),
        (CHARGE.replace("1 kg", "1 m"), "needs kg"),
    ],
)
def test_wrong_charges(scene, text, fault):
    with pytest.raises(InputError) as caught:
        scene(AIR + text)
    assert any(fault in line for line in caught.value.faults), caught.value.faults


ROUND = """
[domain]
symmetry = "spherical"
lower = 0
upper = "0.5 m"
cells = 40
x = ["axis", "outflow"]
[time]
end = "60 us"
[fluid.phases.air]
material = "air"
[[fluid.regions]]
phase = "air"
[[charges]]
material = "TNT"
mass = "0.2 kg"
center = 0
"""


def in_rings(text):
    """The same scene in axisymmetric coordinates."""
    text = text.replace("spherical", "axisymmetric").replace("lower = 0", "lower = [0, -0.2]")
    text = text.replace('upper = "0.5 m"\ncells = 40', "upper = [0.3, 0.2]\ncells = [24, 32]")
    return text.replace("center = 0", "center = [0, 0]")


CYLINDER = 'shape = "cylinder"\nlength_over_diameter = '
NOT_SAFE = "explosive that shares a cell with air, two cells across: of its cold states a wrong one is taken"


@pytest.mark.parametrize(
    "text",
    [
        ROUND,
        in_rings(ROUND),
        in_rings(ROUND) + CYLINDER + "1",
        pytest.param(in_rings(ROUND) + CYLINDER + "2", marks=pytest.mark.xfail(strict=True, reason=NOT_SAFE)),
    ],
    ids=["shells", "rings", "cylinder", "slender cylinder"],
)
def test_a_charge_in_radial_coordinates(scene, text):
    """The same mass in shells and in rings, burnt with all its energy."""
    simulation = Simulation.of(scene(text), Communicator(), 1)
    fluid = simulation.fluid
    before, held = fluid.totals()[0], fluid.held_energies()[0]
    assert held / fluid.model.constants["HELD_ENERGY"][0] == pytest.approx(0.2, rel=2e-6)
    while not simulation.done:
        simulation.step()
    after = fluid.totals()[0] + fluid.left_domain()
    assert after[[0, 1, -1]] == pytest.approx(before[[0, 1, -1]], rel=1e-12)
    assert fluid.held_energies()[0] < 1e-9 * held


EXPLOSIVE = """
[fluid.phases.tnt]
material = "TNT"
[fluid.detonation]
phase = "tnt"
[[fluid.detonation.detonators]]
kind = "point"
position = [0, 0]
"""
AFTERBURN = """
[fluid.afterburn]
phase = "tnt"
law = { kind = "miller", energy = 1e7, rate = 1e4 }
"""


def test_a_burning_charge_is_mapped_with_its_shares(scene, tmp_path):
    """From shells to rings while it burns: nothing is lost of what the shares hold back."""
    (tmp_path / "shells.toml").write_text(ROUND + AFTERBURN)
    words = [tmp_path / "shells.toml", "--set", f'output.directory="{tmp_path}/shells"', "--set", "time.end=3e-6"]
    run_ranks(1, ["-m", "distfsi", *words], 120.0)
    with open(tmp_path / "shells" / "history.csv") as file:
        *_, last = csv.DictReader(file)
    rings = in_rings(ROUND) + f'[fluid.map]\nrun = "{tmp_path}/shells"\n'
    with pytest.raises(InputError, match="holds its charge already"):
        scene(rings)
    rings = rings[: rings.index("[[charges]]")] + rings[rings.index("[fluid.map]") :] + EXPLOSIVE
    mapped = Simulation.of(scene(rings + AFTERBURN), Communicator(), 1).fluid.held_energies()
    held = [float(last[f"held by {share} [J]"]) for share in ("unburnt", "afterburn")]
    assert mapped == pytest.approx(held, rel=1e-9) and 1e5 < held[0] < 3.2e6  # it is on fire
    with pytest.raises(InputError, match="fluid.afterburn.law: absent; was"):
        Simulation.of(scene(rings), Communicator(), 1)


def test_a_mass_needs_three_dimensions(scene):
    flat = AIR.replace('"0.2 m"]', "]").replace('["0.4 m", "0.3 m", ]', '["0.4 m", "0.3 m"]').replace("0, 0, 0", "0, 0")
    flat = (
        flat.replace("[16, 12, 8]", "[16, 12]")
        .replace("[8, 8, 8]", "[8, 8]")
        .replace('z = ["symmetry", "outflow"]\n', "")
    )
    with pytest.raises(InputError, match="a mass needs three dimensions"):
        scene(flat + CHARGE.replace(', "0.1 m"]', "]"))
