"""A body force on the fluid: what it gives is booked, and fluid that is at rest under it stays so."""

import numpy as np
import pytest

from distfsi.device.cpu import Cpu
from distfsi.device.gpu import Gpu
from distfsi.device.host import HostRuntime
from distfsi.diagnostics.budget import Budget
from distfsi.errors import InputError
from distfsi.laws.fluid.nasg import Nasg
from distfsi.laws.sources.gravity import Gravity
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.description import Ball, FluidState, HalfSpace, Performance, Region
from distfsi.simulation import Simulation
from fluids import AIR, TNT, WATER
from launch import ROOT
from tubes import advance, fields, scene_of, start

WALLS = ("wall", "wall")
G = 9.81
DENSE = Nasg(gamma=1.19, p_inf=7.028e8, covolume=6.61e-4, q=-1.177788e6)


def column(eos, states, cells, height, end, steps=None, ends=WALLS, **more):
    """A column of layers of fluid along the last axis, from below up; states: (upper end, state)."""
    axis, unit = len(cells) - 1, height / cells[-1]
    upper = (*(unit * n for n in cells[:-1]), height)
    lower = (0.0,) * len(cells)
    force = (0.0,) * axis + (-G * more.pop("force", 1.0),)
    still = [Region(states[-1][1], None)]
    for top, state in states[-2::-1]:
        still.append(Region(state, HalfSpace((0.0,) * axis + (top,), (0.0,) * axis + (1.0,))))
    scene = scene_of(
        eos, tuple(still), lower, upper, cells, end, ((WALLS,) * axis) + (ends,), sources=(Gravity(force),), **more
    )
    return scene


def still(density, pressure, dimensions, phase=0):
    return FluidState(phase, density, pressure, (0.0,) * dimensions)


# ---- the budget ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", [(50,), (8, 20), (4, 4, 10)], ids=["1D", "2D", "3D"])
@pytest.mark.parametrize(("eos", "density"), [(WATER, 1000.0), (AIR, 1.2)], ids=["water", "air"])
def test_a_column_that_falls_between_walls_closes(cells, eos, density):
    height = 1.0
    scene = column((eos,), [(height, still(density, 1e5, len(cells)))], cells, height, 1e-3)
    simulation = start(scene)
    budget = Budget(simulation.fluid, None, None)
    budget.row(simulation)
    row = budget.row(advance(simulation))
    for name, value in row.items():
        if name.startswith("drift"):
            assert abs(value) < 1e-12, name
    axis = "xyz"[len(cells) - 1]
    per = ("/m2", "/m", "")[len(cells) - 1]
    mass = row[f"fluid mass_1 [kg{per}]"]
    assert row[f"body force momentum_{axis} [N s{per}]"] == pytest.approx(-G * mass * simulation.time, rel=1e-12)
    assert np.abs(fields(simulation)["velocity"]).max() > 0.0


def test_the_budget_of_a_scene_without_a_force_has_no_column_for_it():
    scene = scene_of((AIR,), (Region(still(1.2, 1e5, 1), None),), (0.0,), (1.0,), (8,), 1e-3, (WALLS,))
    simulation = start(scene)
    assert simulation.fluid.force is None
    assert not [name for name in Budget(simulation.fluid, None, None).columns if "force" in name]


def test_a_round_column_closes(tmp_path):
    """About the axis of radial coordinates: cells count with their volumes."""
    path = tmp_path / "round.toml"
    path.write_text(
        """
[domain]
symmetry = "axisymmetric"
lower = [0, 0]
upper = ["0.4 m", "1 m"]
cells = [8, 20]
x = ["axis", "wall"]
y = ["wall", "wall"]
gravity = [0, -9.81]
[time]
end = "1 ms"
[fluid.phases.water]
eos = "stiffened_gas"
gamma = 4.4
p_inf = "600 MPa"
[[fluid.regions]]
phase = "water"
density = 1000
pressure = "1 bar"
"""
    )
    simulation = start(load(path))
    budget = Budget(simulation.fluid, None, None)
    budget.row(simulation)
    row = budget.row(advance(simulation))
    assert max(abs(value) for name, value in row.items() if name.startswith("drift")) < 1e-12
    mass = np.pi * 0.4**2 * 1000.0
    assert row["fluid mass_1 [kg]"] == pytest.approx(mass, rel=1e-12)
    assert row["body force momentum_z [N s]"] == pytest.approx(-G * mass * simulation.time, rel=1e-10)


# ---- at rest ---------------------------------------------------------------------------------------------------------


CASES = {
    "air": ((AIR,), 1.2, {}),
    "water": ((WATER,), 1000.0, {}),
    "nasg": ((DENSE,), 957.74, {}),
    "products": ((TNT,), 1.5, {}),
    "air van Leer": ((AIR,), 1.2, {"reconstruction": "van_leer"}),
    "air weno5": ((AIR,), 1.2, {"reconstruction": "weno5"}),
    "air adaptive": ((AIR,), 1.2, {"riemann": "adaptive"}),
}


@pytest.mark.parametrize("name", CASES)
def test_a_column_stays_at_rest(name):
    """50 m of air or 10 of water, with gravity ten times the earth's so that much of the pressure is weight."""
    eos, density, method = CASES[name]
    height = 50.0 if density < 100.0 else 10.0
    level = still(density, 1e5, 1)
    scene = column(eos, [(height, level)], (40,), height, 1.0, hydrostatic_level=height, force=10.0, **method)
    simulation = start(scene)
    before = fields(simulation)
    assert before["pressure"].max() > 1.05e5
    for _ in range(100):
        simulation.step()
    after = fields(simulation)
    sound = 300.0
    assert np.abs(after["velocity"]).max() < 1e-11 * sound
    assert np.abs(after["pressure"] / before["pressure"] - 1.0).max() < 1e-10


@pytest.mark.parametrize("cells", [(6, 20), (3, 4, 16)], ids=["2D", "3D"])
@pytest.mark.parametrize("ends", [WALLS, ("wall", "outflow")], ids=["walls", "open"])
def test_water_under_air_stays_at_rest(cells, ends):
    D = len(cells)
    layers = [(6.3, still(1000.0, 1e5, D, 0)), (10.0, still(1.2, 1e5, D, 1))]
    blocks = Performance((5,) * D, (4,) * D)
    scene = column((WATER, AIR), layers, cells, 10.0, 1.0, ends=ends, hydrostatic_level=6.3, performance=blocks)
    simulation = start(scene)
    before = fields(simulation)
    assert before["pressure"].max() == pytest.approx(1e5 + G * 1000.0 * 6.0, rel=0.02)
    for _ in range(50):
        simulation.step()
    assert np.abs(fields(simulation)["velocity"]).max() < 1e-8
    assert np.abs(fields(simulation)["pressure"] / before["pressure"] - 1.0).max() < 1e-9


@pytest.mark.parametrize(
    ("cells", "steps", "method"),
    [
        ((40,), 300, {}),
        pytest.param((40,), 10_000, {}, marks=pytest.mark.full),
        pytest.param((40,), 300, {"model": "five_equation"}, marks=pytest.mark.full),
        pytest.param((6, 20), 100, {}, marks=pytest.mark.full),
    ],
    ids=str,
)
def test_a_stack_of_three_materials_stays_at_rest(cells, steps, method):
    """Products, water and air; the level lies in the second interface, so that all three have the pressure there."""
    D = len(cells)
    layers = [(0.25, still(1.6, 1e5, D, 0)), (0.6, still(1000.0, 1e5, D, 1)), (1.0, still(1.2, 1e5, D, 2))]
    scene = column(
        (TNT, WATER, AIR), layers, cells, 1.0, 1.0, hydrostatic_level=0.6, reconstruction="van_leer", **method
    )
    simulation = start(scene)
    before = fields(simulation)
    assert before["pressure"].max() == pytest.approx(1e5 + G * 1000.0 * 0.35, rel=1e-3)
    for _ in range(steps):
        simulation.step()
    after = fields(simulation)
    assert np.abs(after["velocity"]).max() < 1e-9
    assert np.abs(after["pressure"] / before["pressure"] - 1.0).max() < 1e-10


def test_the_pressure_is_that_of_the_isentrope():
    """p^(1 - 1/gamma) falls linearly: (gamma - 1)/gamma rho0/p0^(1/gamma) g per height."""
    errors = []
    for n in (50, 100):
        scene = column((AIR,), [(1000.0, still(1.2, 1e5, 1))], (n,), 1000.0, 1.0, hydrostatic_level=0.0)
        p = fields(start(scene))["pressure"].ravel()
        z = 1000.0 * (np.arange(n) + 0.5) / n
        exponent = 0.4 / 1.4
        exact = (1e5**exponent - exponent * 1.2 / 1e5 ** (1.0 / 1.4) * G * z) ** (1.0 / exponent)
        errors.append(np.abs(p - exact).max())
    assert errors[0] < 1.0
    assert errors[1] < 0.3 * errors[0]


def test_a_charge_in_layers_keeps_its_own_pressure():
    layers = [(6.0, still(1000.0, 1e5, 2, 0)), (10.0, still(1.2, 1e5, 2, 1))]
    scene = column((WATER, AIR), layers, (20, 20), 10.0, 1.0, hydrostatic_level=6.0)
    charge = Region(still(1000.0, 1e9, 2, 0), Ball((5.0, 2.0), 1.0))
    scene.fluid.__dict__["regions"] = (*scene.fluid.regions, charge)
    p = fields(start(scene))["pressure"].reshape(20, 20)
    assert p.max() == pytest.approx(1e9, rel=1e-12)
    assert p[0, 0] == pytest.approx(1e5 + G * 1000.0 * 5.75, rel=1e-3)


def test_what_cannot_be_at_rest_is_told():
    scene = column((AIR,), [(1e5, still(1.2, 1e5, 1))], (20,), 1e5, 1.0, hydrostatic_level=0.0)
    with pytest.raises(InputError, match="at rest"):
        start(scene)
    sod = ROOT / "inputs/sod.toml"
    for settings, words in (
        (["fluid.hydrostatic_level=0.5"], "needs gravity"),
        (["fluid.hydrostatic_level=1.5", "domain.gravity=-9.81"], "outside the domain"),
        (["fluid.hydrostatic_level=0.5", "domain.gravity=-9.81", 'domain.x=["periodic", "periodic"]'], "periodic"),
        (["fluid.hydrostatic_level=0.5", "domain.gravity=-9.81", "fluid.regions.0.velocity=1"], "moves"),
    ):
        with pytest.raises(InputError, match=words):
            load(sod, settings)


# ---- devices ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_gpu_makes_the_same_bits(precision):
    D = 2
    layers = [(6.3, still(1000.0, 1e5, D, 0)), (10.0, still(1.2, 1e5, D, 1))]
    blocks = Performance((8,) * D, (4,) * D)
    scene = column(
        (WATER, AIR), layers, (8, 16), 10.0, 1.0, hydrostatic_level=5.0, performance=blocks, precision=precision
    )
    found = []
    for device in (Cpu(1), Gpu(HostRuntime())):
        simulation = Simulation.of(scene, Communicator(), device=device)
        for _ in range(4):
            simulation.step()
        found.append((simulation.fluid.state.copy(), simulation.fluid.force.totals()))
    assert np.array_equal(found[0][0], found[1][0])
    assert np.array_equal(found[0][1], found[1][1])
