"""Rigid bodies without a fluid: tops, supports, what they meet, restarts, faults."""

from copy import deepcopy

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from distfsi.errors import InputError
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.solid.rigid import RigidBody

SPACE = """
[domain]
lower = [0.0, 0.0, 0.0]
upper = [1.0, 1.0, 1.0]
cells = [8, 8, 8]
[time]
end = 100.0
[solid.rigid.top]
spacing = 0.1
density = 2.0
shape = { kind = "box", lower = [0.3, 0.3, 0.3], upper = [0.5, 0.6, 0.7] }
velocity = [1e-3, 0.0, 0.0]
spin = [0.1, 5.0, 0.2]
"""
PLANE = """
[domain]
lower = [0.0, 0.0]
upper = [1.0, 1.0]
cells = [8, 8]
[time]
end = 10.0
"""
BLOCK = """
[solid.rigid.block]
spacing = 0.05
density = 2.0
modulus = 100.0
shape = { kind = "box", lower = [0.2, 0.4], upper = [0.5, 0.6] }
"""


def simulation_of(tmp_path, text, *changes):
    (tmp_path / "scene.toml").write_text(text)
    return Simulation.of(load(tmp_path / "scene.toml", changes), Communicator(), 1)


def energy(simulation):
    totals = simulation.solid.totals()
    return totals["kinetic"] + totals["internal"] - simulation.solid.gravity_work()


def test_a_spinning_top_keeps_energy_and_angular_momentum():
    """About the middle axis, from which it turns over again and again; beside an integration of Euler's equations."""
    inertia, dt, steps = np.diag([1.0, 2.0, 3.5]), 0.02, 10000
    top = RigidBody(2.0, np.zeros(3), inertia, np.ones(6, dtype=bool), inertia)
    top.set_motion(np.array([1.0, 2.0, 3.0]), np.array([0.1, 5.0, 0.2]))
    momentum, kinetic = top.momentum.copy(), top.kinetic
    own = []
    for _ in range(steps):
        top.go(dt)
        own.append(top.axes.T @ top.momentum)
    assert top.kinetic == pytest.approx(kinetic, rel=1e-10)
    assert top.momentum == pytest.approx(momentum, rel=1e-10)
    assert np.ptp(own, axis=0)[1] > 20.0  # of 10 N m s, both ways
    fine = RigidBody(2.0, np.zeros(3), inertia, np.ones(6, dtype=bool), inertia)
    fine.set_motion(np.zeros(3), np.array([0.1, 5.0, 0.2]))
    for _ in range(500):
        fine.go(0.004)

    def euler(_, spin):
        return np.linalg.solve(inertia, np.cross(inertia @ spin, spin))

    exact = solve_ivp(euler, (0.0, 2.0), [0.1, 5.0, 0.2], rtol=1e-11, atol=1e-12).y[:, -1]
    assert fine.axes.T @ fine.spin == pytest.approx(exact, abs=2e-3)


def test_a_top_in_a_scene_is_the_body_of_its_points(tmp_path):
    """Mass, inertia and energy of a box; its points keep their distances."""
    simulation = simulation_of(tmp_path, SPACE)
    (top,) = simulation.solid._free.values()
    mass, sides2 = 2.0 * 0.2 * 0.3 * 0.4, np.array([0.2, 0.3, 0.4]) ** 2
    assert top.mass == pytest.approx(mass, rel=1e-14)
    assert top.inertia == pytest.approx(np.diag(mass / 12.0 * (sides2.sum() - sides2)), rel=1e-12, abs=1e-16)
    start, kinetic = simulation.solid.columns["position"].copy(), top.kinetic
    assert simulation.solid.totals()["kinetic"] == pytest.approx(kinetic, rel=1e-12)
    for _ in range(30):
        simulation.step()
    now = simulation.solid.columns["position"]
    assert simulation.solid.totals()["kinetic"] == pytest.approx(kinetic, rel=1e-12)
    lengths = [np.linalg.norm(x[:, None] - x, axis=2) for x in (start, now)]
    assert lengths[1] == pytest.approx(lengths[0], abs=1e-13) and np.abs(now - start).max() > 0.1
    assert simulation.solid.reported()["top angle_y [rad]"] == pytest.approx(5.0 * simulation.time, rel=0.05)


def test_a_body_on_springs_swings_and_a_bolt_fails_under_its_weight(tmp_path):
    """Off its center, so it turns, too: the energy is kept; the frequency of the swing along y is sqrt(k/m). A bolt of
    less strength than the weight lets go."""
    springs = """
[[solid.rigid.block.supports]]
at = [0.3, 0.5]
stiffness = [0.0, 3.0]
[[solid.rigid.block.supports]]
at = [0.4, 0.5]
stiffness = [0.0, 3.0]
"""
    simulation = simulation_of(tmp_path, PLANE + BLOCK + springs, "solid.rigid.block.velocity=[0.0, 0.1]")
    before, places, times = energy(simulation), [], []
    for _ in range(150):
        simulation.step()
        times.append(simulation.time)
        places.append(simulation.solid.reported()["block y [m]"] - 0.5)
    rate = np.sqrt(6.0 / (2.0 * 0.3 * 0.2))
    assert np.array(places) == pytest.approx(0.1 / rate * np.sin(rate * np.array(times)), abs=2e-2 * 0.1 / rate)
    assert energy(simulation) == pytest.approx(before, rel=1e-12)
    bolt = "[[solid.rigid.block.supports]]\nstiffness = [1e3, 1e3]\nstrength = "
    pulled = ("domain.gravity=[0.0, -1.0]",)
    for strength, falls in (("0.3", False), ("0.1", True)):
        simulation = simulation_of(tmp_path, PLANE + BLOCK + bolt + strength, *pulled)
        while simulation.time < 0.5:
            simulation.step()
        assert (simulation.solid.reported()["block y [m]"] < 0.45) == falls
        assert energy(simulation) == pytest.approx(0.0, abs=1e-14)


def test_a_block_falls_on_a_wall_and_bounces(tmp_path):
    """On its edge, so that it begins to turn; what it loses is the heat of its surface."""
    turned = '{ kind = "rotate", angle = "30 deg", about = [0.35, 0.5], shape = { kind = "box", '
    turned = BLOCK.replace('{ kind = "box", ', turned).replace("0.6] }", "0.6] } }")
    changes = ('domain.y=["wall", "outflow"]', "domain.gravity=[0.0, -1.0]")
    simulation = simulation_of(tmp_path, PLANE + turned, *changes)
    lowest = 1.0
    while simulation.time < 1.2:
        simulation.step()
        lowest = min(lowest, simulation.solid.columns["position"][:, 1].min())
    assert 0.0 < lowest < 0.03
    found = simulation.solid.reported()
    assert found["block y [m]"] > 0.1 and abs(found["block angle [rad]"]) > 0.1
    assert energy(simulation) == pytest.approx(0.0, abs=1e-13)
    assert simulation.solid.totals()["internal"] > 0.0


def test_two_blocks_meet(tmp_path):
    """Head on: they part with their momentum, and not faster than they came."""
    other = BLOCK.replace("block", "other").replace("[0.2, 0.4], upper = [0.5, 0.6]", "[0.6, 0.4], upper = [0.8, 0.6]")
    simulation = simulation_of(tmp_path, PLANE + BLOCK + other, "solid.rigid.block.velocity=[0.5, 0.0]")
    before, momentum = energy(simulation), simulation.solid.totals()["momentum"]
    while simulation.time < 0.5:
        simulation.step()
    found = simulation.solid.reported()
    assert energy(simulation) == pytest.approx(before, rel=1e-12)
    assert simulation.solid.totals()["momentum"] == pytest.approx(momentum, rel=1e-12, abs=1e-15)
    apart = found["other velocity_x [m/s]"] - found["block velocity_x [m/s]"]
    assert 0.1 < apart <= 0.5 + 1e-9 and found["block angle [rad]"] == pytest.approx(0.0, abs=1e-10)


def test_half_a_body_at_a_symmetry_plane_is_the_whole_one(tmp_path):
    """Gravity along the plane moves it; across it moves and turns not at all."""
    simulation = simulation_of(
        tmp_path,
        PLANE + BLOCK.replace("[0.2, 0.4]", "[0.0, 0.4]"),
        'domain.x=["symmetry", "outflow"]',
        "domain.gravity=[1.0, -1.0]",
        "time.end=0.1",
        "solid.rigid.block.spin=3.0",
    )
    while not simulation.done:
        simulation.step()
    found = simulation.solid.reported()
    assert found["block velocity_y [m/s]"] == pytest.approx(-0.1) and found["block velocity_x [m/s]"] == 0.0
    assert found["block angle [rad]"] == 0.0


def test_a_restart_goes_on_to_the_same_bits(tmp_path):
    bolt = "[[solid.rigid.top.supports]]\nstiffness = [9.0, 9.0, 9.0]\nstrength = 0.01"
    one, other = (simulation_of(tmp_path, SPACE + bolt) for _ in range(2))
    for _ in range(10):
        one.step()
    snapshots = {name: deepcopy(part.snapshot()) for name, part in one.kept().items()}
    for name, part in other.kept().items():
        part.restore(snapshots[name])
    for _ in range(10):
        one.step()
        other.step()
    for name in ("position", "velocity"):
        first, second = (c[name][np.argsort(c["id"])] for c in (one.solid.columns, other.solid.columns))
        assert np.array_equal(first, second)
    assert one.solid.reported() == other.solid.reported()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (("solid.rigid.block.mass=1.0",), "`density` or `mass`, one of them"),
        (("solid.rigid.block.spin=[1.0, 2.0]",), "has 2 entries, needs 1 in 2D"),
        (("solid.rigid.block.inertia=0.0",), "must be positive"),
        (("solid.rigid.block.supports=[{at = [0.0, 0.0]}]",), "expected a stiffness or a damping"),
        (('solid.tied=[["block", "block"]]',), "is rigid: ties are bonds"),
    ],
)
def test_faults_are_told(tmp_path, changes, words):
    with pytest.raises(InputError, match=words):
        simulation_of(tmp_path, PLANE + BLOCK, *changes)


def test_a_body_that_may_meet_something_tells_how_stiff_it_is(tmp_path):
    text = PLANE + BLOCK.replace("modulus = 100.0\n", "")
    simulation_of(tmp_path, text)
    with pytest.raises(InputError, match="modulus .* is missing"):
        simulation_of(tmp_path, text, 'domain.y=["wall", "wall"]')
