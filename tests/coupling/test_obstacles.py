"""Obstacles: walls that stand, whose geometry is found once, and walls that move as told."""

import math
from copy import deepcopy

import numpy as np
import pytest

from distfsi.coupling.cut_cells.redistribution import Redistribution
from distfsi.device.cpu import Cpu
from distfsi.device.gpu import Gpu
from distfsi.device.host import HostRuntime
from distfsi.diagnostics.budget import Budget
from distfsi.errors import InputError
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.motion import Motion
from distfsi.simulation import Simulation

SCENE = """
[domain]
lower = [0.0, 0.0]
upper = [1.0, 1.0]
cells = [20, 20]
[time]
end = 1.0
cfl = 0.4
[fluid.phases.air]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "air"
density = 1.4
pressure = 1.0
[performance]
block_cells = [10, 10]
"""
CHARGE = """
[[fluid.regions]]
phase = "air"
density = 5.0
pressure = 10.0
shape = { kind = "ball", center = [0.2, 0.3], radius = 0.1 }
"""
BLOCK = """
[solid.obstacles.block]
spacing = 0.025
[solid.obstacles.block.shape]
kind = "rotate"
angle = "30 deg"
about = [0.6, 0.5]
shape = { kind = "box", lower = [0.45, 0.4], upper = [0.75, 0.6] }
"""
TURNING = """
[solid.obstacles.rotor]
spacing = 0.025
shape = { kind = "ball", center = [0.5, 0.5], radius = 0.2 }
[solid.obstacles.rotor.motion]
times = [0.0, 10.0]
displacements = [[0.0, 0.0], [DISTANCE, 0.0]]
angles = [0.0, TURN]
about = [0.5, 0.5]
"""


def rotor(distance, turn):
    return TURNING.replace("DISTANCE", str(distance)).replace("TURN", str(turn))


def simulation_of(tmp_path, text, *changes):
    (tmp_path / "scene.toml").write_text(text)
    return Simulation.of(load(tmp_path / "scene.toml", changes), Communicator(), 1)


def primitives(simulation):
    """Of all open cells."""
    fluid = simulation.fluid
    W = np.array(fluid.model.formula("primitives")(tuple(np.moveaxis(fluid.state, 1, 0))))
    return W[:, simulation.coupling.volume > 0.0]


def balance(simulation):
    fluid, solid, coupling = simulation.fluid, simulation.solid, simulation.coupling
    t = solid.totals()
    particles = [0.0, *t["momentum"] - solid.boundary_impulse(), t["kinetic"] + t["internal"] - solid.gravity_work()]
    created = sum(coupling.budget_by_cause().values())
    return fluid.totals(coupling.volume)[0] + fluid.left_domain() + np.array(particles) - created


def test_gas_at_rest_stays_at_rest_around_an_oblique_obstacle(tmp_path):
    simulation = simulation_of(tmp_path, SCENE + BLOCK)
    for _ in range(10):
        simulation.step()
    W = primitives(simulation)
    assert np.abs(W[3] - 1.0).max() < 1e-12 and np.abs(W[1:3]).max() < 1e-12


def test_a_wall_that_stands_is_found_once_and_no_bit_depends_on_it(tmp_path, monkeypatch):
    """A blast on a block; the same with its geometry found in each step."""
    states, cuts = [], []
    once = Redistribution.is_settled
    for found_once in (True, False):
        monkeypatch.setattr(Redistribution, "is_settled", once if found_once else lambda *_: False)
        simulation = simulation_of(tmp_path, SCENE + CHARGE + BLOCK)
        wall, count = simulation.coupling._wall_particles, 0
        cut = wall.cut

        def counted(*arguments, cut=cut):
            nonlocal count
            count += 1
            return cut(*arguments)

        monkeypatch.setattr(wall, "cut", counted)
        start = balance(simulation)
        for _ in range(20):
            simulation.step()
        assert np.abs(balance(simulation) - start).max() < 1e-12 * np.abs(start).max()
        given = simulation.solid.given.copy()
        states.append((simulation.fluid.state.copy(), given, simulation.coupling.volume.copy()))
        cuts.append(count)
    assert np.abs(states[0][1]).max() > 0.0
    for first, second in zip(*states, strict=True):
        assert np.array_equal(first, second)
    assert cuts[0] <= 2 and cuts[1] == 20


def test_an_obstacle_moves_as_told_and_all_books_close(tmp_path):
    text = SCENE + rotor(3.0, 2.0)
    simulation = simulation_of(tmp_path, text)
    start, points = balance(simulation), simulation.solid.columns["position"].copy()
    for _ in range(15):
        simulation.step()
    t = simulation.time
    motion = simulation.scene.solid.bodies[0].motion
    assert simulation.solid.columns["position"] == pytest.approx(motion.positions(points, t), abs=1e-14)
    assert np.abs(balance(simulation) - start).max() < 1e-12 * np.abs(start).max()
    assert simulation.solid.given.sum(axis=(0, 1))[0] < 0.0  # it is pushed back


def test_a_piston_feels_the_shock_before_it_and_the_fan_behind_it(tmp_path):
    """An obstacle that moves at half the speed of sound, against the exact pressures on both faces."""
    piston = """
[solid.obstacles.piston]
spacing = 0.005
shape = { kind = "box", lower = 0.3, upper = 0.4 }
motion = { times = [0.0, 10.0], displacements = [0.0, 5.0] }
"""
    changes = ("domain.lower=0", "domain.upper=1", "domain.cells=100", "performance.block_cells=100")
    simulation = simulation_of(tmp_path, SCENE + piston, *changes)
    forces = []
    while simulation.time < 0.2:
        simulation.step()
        if simulation.time > 0.1:
            forces.append(simulation.solid.given.sum() / simulation.dt)
    speed, gamma = 0.5, 1.4
    shock = 0.25 * (gamma + 1.0) * speed
    front = 1.0 + 1.4 * (shock + math.sqrt(shock**2 + 1.0)) * speed
    back = (1.0 - 0.5 * (gamma - 1.0) * speed) ** (2.0 * gamma / (gamma - 1.0))
    assert np.mean(forces) == pytest.approx(back - front, rel=1e-2)


@pytest.mark.full
@pytest.mark.parametrize("text", [CHARGE + BLOCK, rotor(3.0, 2.0)], ids=["stands", "moves"])
def test_a_gpu_has_the_bits_of_the_cpu(tmp_path, text):
    """Its text, compiled for the host."""
    (tmp_path / "scene.toml").write_text(SCENE + text)
    scene, found = load(tmp_path / "scene.toml"), []
    for device in (Cpu(1), Gpu(HostRuntime(), True)):
        simulation = Simulation.of(scene, Communicator(), device=device)
        for _ in range(5):
            simulation.step()
        found.append((simulation.fluid.state, simulation.solid.columns["position"], simulation.solid.given))
    for first, second in zip(*found, strict=True):
        assert np.array_equal(first, second)


def test_a_motion_is_the_table():
    motion = Motion(
        (0.0, 1.0, 3.0), ((0.0,) * 3, (1.0, 0.0, 0.0), (1.0, 4.0, 0.0)), (0.0, 0.0, 1.0), (0.0,) * 3, (0, 0, 2)
    )
    points = np.array([[1.0, 0.0, 5.0], [0.0, 0.0, 0.0]])
    assert motion.positions(points, 0.5)[1] == pytest.approx([0.5, 0.0, 0.0])
    turned = [math.cos(0.5) + 1.0, math.sin(0.5) + 2.0, 5.0]
    assert motion.positions(points, 2.0)[0] == pytest.approx(turned)
    step = 1e-6
    slope = (motion.positions(points, 2.0 + step) - motion.positions(points, 2.0 - step)) / (2.0 * step)
    assert motion.velocities(points, 2.0) == pytest.approx(slope, abs=1e-8)
    assert not motion.velocities(points, 3.0).any()
    assert motion.next_row(0.0) == 1.0 and motion.next_row(3.0) == math.inf


def test_a_restart_of_a_moving_obstacle_goes_on_to_the_same_bits(tmp_path):
    text = SCENE + rotor(3.0, 2.0)
    one, other = (simulation_of(tmp_path, text) for _ in range(2))
    for _ in range(4):
        one.step()
    snapshots = {name: deepcopy(part.snapshot()) for name, part in one.kept().items()}
    for name, part in other.kept().items():
        part.restore(snapshots[name])
    for _ in range(4):
        one.step()
        other.step()
    assert np.array_equal(one.fluid.state, other.fluid.state)
    first, second = (c["position"][np.argsort(c["id"])] for c in (one.solid.columns, other.solid.columns))
    assert np.array_equal(first, second)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BLOCK + '[coupling]\nscheme = "immersed_boundary"\n', "knows no obstacles"),
        ("[solid]\n", "solid.bodies .*is missing"),
        (rotor(1.0, 1.0).replace("[0.0, 10.0]", "[1.0, 10.0]"), "begin with 0"),
        (rotor(1.0, 1.0).replace("[0.0, 10.0]", "[0.0, 5.0, 10.0]"), "displacements has 2 rows, times 3"),
        (rotor(1.0, 1.0) + "axis = [0.0, 1.0]\n", "only in 3D there is an axis"),
    ],
)
def test_faults_of_obstacles_are_told(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        simulation_of(tmp_path, SCENE + text)


# ---- exact surfaces --------------------------------------------------------------------------------------------------

WEDGE = """
[domain]
lower = [-0.1, 0]
upper = [0.5, 0.45]
cells = [40, 30]
x = ["inflow", "outflow"]
y = ["wall", "outflow"]
[time]
end = 0.4
[fluid.phases.gas]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "gas"
density = 1.4
pressure = 1
velocity = [3, 0]
[fluid.inflow.x_low]
phase = "gas"
density = 1.4
pressure = 1
velocity = [3, 0]
"""
SURFACE = 'shape = { kind = "half_space", point = [0, 0], normal = [-0.25881905, 0.96592583] }\nspacing = 0.0075\n'
HELD = """density = 1000
eos = { kind = "linear", bulk_modulus = 1000 }
strength = "none"
fixed = { kind = "box", lower = [-1, -1], upper = [2, 2] }
"""


def wedge(tmp_path, body):
    (tmp_path / "wedge.toml").write_text(WEDGE + body)
    return Simulation.of(load(tmp_path / "wedge.toml"), Communicator(), 1)


def test_a_body_that_is_fixed_as_a_whole_has_the_surface_of_an_obstacle(tmp_path):
    """And none of both is blunt at its tip."""
    fractions = [
        wedge(tmp_path, text).coupling.wall.fractions[1].host()
        for text in (f"[solid.obstacles.wedge]\n{SURFACE}", f"[solid.bodies.wedge]\n{SURFACE}{HELD}")
    ]
    assert np.array_equal(*fractions)
    open_part = fractions[0][0, 0, 0, 2:-2, 2:-2].sum() * 0.015**2
    assert open_part == pytest.approx(0.6 * 0.45 - 0.5 * 0.5**2 * math.tan(math.radians(15.0)), rel=1e-4)


def test_a_wedge_at_mach_3_bears_the_pressure_behind_an_oblique_shock(tmp_path):
    """15 degrees: 2.8216 times the pressure before it (theta-beta-M). As its points tell, its surface is a staircase:
    18 % rms, and 40 % too much force, a part of it at the tip, which was as blunt as a thin body must be."""
    simulation = wedge(tmp_path, f"[solid.obstacles.wedge]\n{SURFACE}")
    budget = Budget(simulation.fluid, simulation.solid, simulation.coupling)
    start, mean, pressures, time = budget.row(simulation), np.zeros(2), 0.0, 0.0
    while not simulation.done:
        simulation.step()
        if simulation.time > 0.3:
            coupling, time = simulation.coupling, time + simulation.dt
            mean = mean + simulation.solid.given.sum(axis=(0, 1))
            pressures = pressures + coupling._forces.pressures(coupling.geometry)
    x, _ = cells_of_band(simulation)
    along = (pressures > 0.0) & (x > 0.1) & (x < 0.4)
    assert np.sqrt(np.mean((pressures[along] / time / 2.8216 - 1.0) ** 2)) < 0.01
    assert mean[0] / time == pytest.approx(2.8216 * 0.5 * math.tan(math.radians(15.0)), rel=0.01)
    row = budget.row(simulation)
    made = [value for name, value in row.items() if name.startswith("coupling ")]
    assert start["fluid energy [J/m]"] > 0.1 and max(map(abs, made)) < 1e-12


def cells_of_band(simulation):
    """x and y (n,) [m] of the middles of the band's cells, of one block."""
    grid, blocks = simulation.blocks.grid, simulation.blocks
    assert blocks.count == 1
    at = simulation.coupling.geometry.band.cells
    y, x = np.divmod(at, blocks.shape[2])
    return (np.stack([x, y]) - grid.ghost_layers + 0.5) * grid.spacing[0] + np.array(grid.lower[:2])[:, None]
