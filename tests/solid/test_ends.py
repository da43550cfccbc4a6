"""Ends of the domain: bodies leave through open ones, rub at walls, which measure what they do, and go round."""

import numpy as np
import pytest

from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.mesh.communicator import Communicator
from distfsi.output.history import read_history
from distfsi.scene.description import Ball, Box
from distfsi.scene.loader import load
from distfsi.simulation import Simulation
from mpi_solid import body, solid, step

FORMS = ("total_lagrangian", "updated_lagrangian")
SOFT_EOS, SOFT = LinearEos(833.3333), Elastic(384.6154)  # of density 1000: longitudinal waves at 1.16 m/s


def disc(center, velocity):
    return body(Ball(center, 0.2), 0.04, 1000.0, velocity, SOFT_EOS, SOFT)


def whole(part):
    """Momentum and energy, with what has left."""
    totals = part.totals()
    momentum, energy = totals["momentum"] - part.boundary_impulse(), totals["kinetic"] + totals["internal"]
    return np.array([*momentum, energy - part.gravity_work()])


@pytest.mark.parametrize("form", FORMS)
def test_a_body_that_leaves_is_computed_no_longer(form):
    """A disc whose bonds hold goes as a whole, one without them particle by particle; what is left is as if alone."""
    kept = disc((-0.5, 0.0), (0.0, 0.05))
    part = solid([disc((0.7, 0.1), (1.0, 0.3)), kept], (-1.0, -1.0), (1.0, 1.0), form=form)
    before, first, counts = whole(part), int((part.columns["body"] == 0).sum()), set()
    while part.count > first:
        step(part)
        counts.add(part.count)
    assert len(counts) == 2 or form == "updated_lagrangian"
    assert (part.columns["body"] == 1).all()
    assert part.boundary_impulse()[0] == pytest.approx(-before[0], rel=1e-12)
    assert np.abs(whole(part) - before).max() < 1e-12 * before[-1]
    assert np.isnan(part.body_totals(0)["center"]).all() and part.body_totals(0)["mass"] == 0.0
    assert part.columns["velocity"] == pytest.approx(np.tile([0.0, 0.05], (first, 1)), abs=1e-12)


def test_what_hangs_on_stays():
    """Half of a disc is beyond the end, out of reach, and the other half holds it."""
    part = solid([disc((0.75, 0.0), (1.0, 0.0))], (-1.0, -1.0), (1.0, 1.0), form="total_lagrangian")
    count, farthest = part.count, 0.0
    while farthest < 1.3:
        step(part)
        farthest = part.columns["position"][:, 0].max()
    assert farthest - 2.0 * 2.0 * 1.3 * 0.04 > 1.0
    assert part.count == count


# ---- walls -----------------------------------------------------------------------------------------------------------

BLOCK = """
domain = { lower = [0, 0], upper = [1, 1], cells = [20, 20], x = ["wall", "wall"], y = ["wall", "wall"] }
time.end = 0.2
sources.g = { kind = "gravity", acceleration = [0, -2] }
gauges.floor = { kind = "wall", side = "y_low" }
[solid.bodies.b]
shape = { kind = "box", lower = [0.4, 0], upper = [0.6, 0.2] }
velocity = [1, 0]
spacing = 0.025
density = 10
eos = { kind = "linear", bulk_modulus = 100 }
strength = { kind = "elastic", shear_modulus = 50 }
"""


def block_on_a_floor(tmp_path, *settings, text=BLOCK):
    path = tmp_path / "block.toml"
    path.write_text(text)
    return load(path, [f"output.directory={tmp_path / 'out'}", *settings])


@pytest.mark.parametrize(("friction", "speed"), [(0.0, 1.0), (0.3, 1.0), (0.3, 0.05)], ids=["free", "slides", "stops"])
def test_a_block_rubs_at_a_wall_as_coulomb_says(tmp_path, friction, speed):
    """The wall takes exactly what the block has lost, and friction heats it."""
    scene = block_on_a_floor(tmp_path, f"solid.wall_friction={friction}", f"solid.bodies.b.velocity=[{speed}, 0]")
    simulation = Simulation.of(scene, Communicator(), 1)
    solid, before = simulation.solid, simulation.solid.totals()
    while not simulation.done:
        simulation.step()
    after, impulse, mass = solid.totals(), solid.wall_impulse(), 0.04 * 10.0
    weight = np.array([0.0, -2.0 * mass * simulation.time])
    assert np.abs(after["momentum"] - before["momentum"] - weight + impulse[1, 0]).max() < 1e-14
    assert np.abs(impulse[0]).max() == np.abs(impulse[1, 1]).max() == 0.0
    grown = after["kinetic"] + after["internal"] - before["kinetic"] - solid.gravity_work()
    assert abs(grown) < 1e-12 * before["kinetic"]
    if speed < friction * 2.0 * simulation.time:
        assert abs(after["momentum"][0]) < 0.3 * speed * mass  # it swings above its foot
    else:
        assert impulse[1, 0, 0] == pytest.approx(-friction * impulse[1, 0, 1], rel=1e-9)


def test_a_gauge_and_the_history_tell_what_a_wall_bears(tmp_path):
    """Also where a run goes on from its half."""
    run(block_on_a_floor(tmp_path, "output.history_every=1"), Communicator(), 1)
    for half in ("time.maximum_steps=40", "time.maximum_steps=1000"):
        words = (f"output.directory={tmp_path / 'halves'}", "output.history_every=1", half)
        run(block_on_a_floor(tmp_path, *words), Communicator(), 1, "auto" if half.endswith("1000") else None)
    gauge, history = (read_history(tmp_path / f"out/{name}.csv") for name in ("gauges/floor", "history"))
    force, impulse = gauge["force_y [N/m]"], gauge["impulse_y [N s/m]"]
    assert impulse[1:] == pytest.approx(np.cumsum(force[1:] * np.diff(gauge["time [s]"])), rel=1e-9)
    assert -impulse[-1] == pytest.approx(2.0 * 0.4 * 0.2, rel=0.1)
    assert history["walls momentum_y [N s/m]"][-1] == impulse[-1]
    assert np.abs(history["drift momentum_y"]).max() < 1e-12
    for name in ("gauges/floor.csv", "history.csv"):
        assert (tmp_path / "halves" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()


def test_a_gauge_needs_a_wall(tmp_path):
    with pytest.raises(InputError, match="gauges.floor.side.*is an end of kind 'outflow'; expected a wall"):
        block_on_a_floor(tmp_path, 'domain.y=["outflow", "wall"]')


# ---- periodic ends ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
def test_bodies_meet_across_periodic_ends_as_in_the_middle(form):
    found = []
    for x, periodic in ((0.0, ()), (1.0, (0,))):
        discs = [disc((x - 0.24, 0.1), (0.3, 0.05)), disc((0.24 - x, 0.0), (-0.1, 0.0))]
        part = solid(discs, (-1.0, -1.0), (1.0, 1.0), form=form, periodic=periodic)
        before = whole(part)
        for _ in range(100):
            step(part)
        assert np.abs(whole(part) - before).max() < 1e-13 * before[-1]
        order = np.argsort(part.columns["id"])
        found.append((part.columns["position"][order] - [x, 0.0], part.columns["velocity"][order]))
    (here, own), (there, other) = found
    assert np.abs(own[:, 1]).max() > 0.1
    assert (np.mod(here[:, 0] - there[:, 0] + 1.0, 2.0) - 1.0) == pytest.approx(0.0, abs=1e-9)
    assert other == pytest.approx(own, abs=1e-8)


def test_a_body_goes_round_as_a_whole():
    """Once its middle is beyond the end; the way back is as long as the domain."""
    part, time = solid([disc((0.7, 0.1), (1.0, 0.0))], (-1.0, -1.0), (1.0, 1.0), (), periodic=(0,), form=FORMS[0]), 0.0
    centers = []
    while time < 0.6:
        time += step(part)[0]
        centers.append(part.body_totals(0)["center"][0])
    assert max(centers) == pytest.approx(1.0, abs=0.02)
    assert centers[-1] == pytest.approx(time - 1.3, abs=1e-12)
    assert part.columns["velocity"] == pytest.approx(np.tile([1.0, 0.0], (part.count, 1)), abs=1e-12)
    with pytest.raises(InputError, match="would meet what they have met"):
        solid([disc((0.0, 0.0), (0.0, 0.0))], (-0.2, -1.0), (0.2, 1.0), periodic=(0,)).prepare(0.3)


@pytest.mark.parametrize("form", FORMS)
def test_plates_without_end_bear_the_stress_of_uniaxial_waves(form):
    """density x c x closing speed / 2 with the longitudinal c, though Poisson's ratio is 0.3: nothing is free aside."""
    eos, strength, density, speed = LinearEos(833.3333), Elastic(384.6154), 1000.0, 0.01
    c, thickness = np.sqrt((833.3333 + 4.0 / 3.0 * 384.6154) / density), 1.0
    low = body(Box((-0.1, -thickness), (0.1, 0.0)), 0.025, density, (0.0, speed), eos, strength)
    high = body(Box((-0.1, 5e-5), (0.1, thickness)), 0.025, density, (0.0, 0.0), eos, strength)
    part, time = solid([low, high], (-0.1, -2.0), (0.1, 2.0), form=form, viscosity=(0.5, 1.0), periodic=(0,)), 0.0
    while time < 0.6 * thickness / c:
        time += step(part)[0]
    y, stress = part.columns["position"][:, 1], part.columns["pressure"] - part.columns["deviator"][:, 1]
    assert stress[(np.abs(y) > 0.1) & (np.abs(y) < 0.4)].mean() == pytest.approx(0.5 * density * c * speed, rel=0.01)
    assert np.abs(part.columns["velocity"][:, 0]).max() < 1e-12 * speed


# ---- rigid bodies ----------------------------------------------------------------------------------------------------

RIGID = """
[solid.rigid.r]
shape = { kind = "box", lower = [0.1, 0], upper = [0.3, 0.2] }
spacing = 0.05
density = 10
velocity = [2, 0]
"""


def test_a_rigid_block_rubs_at_a_wall_and_is_computed_beyond_an_open_end(tmp_path):
    """Beside a block that deforms, and leaves."""
    faster = ("solid.bodies.b.velocity=[3, 0]", "time.end=0.5")
    scene = ('domain.x=["outflow", "outflow"]', "solid.wall_friction=0.3", *faster)
    simulation = Simulation.of(block_on_a_floor(tmp_path, *scene, text=BLOCK + RIGID), Communicator(), 1)
    solid, before = simulation.solid, whole(simulation.solid)
    while not simulation.done:
        simulation.step()
    soft, rigid = (solid.body_totals(b) for b in (0, 1))
    assert soft["mass"] == 0.0 and rigid["mass"] == pytest.approx(0.4)
    assert rigid["center"][0] > 1.0
    assert np.abs(whole(solid) - before).max() < 1e-12 * before[-1]
    lost = 0.8 - rigid["momentum"][0]
    assert lost == pytest.approx(0.3 * (2.0 * 0.4 * 0.5 + rigid["momentum"][1]), rel=1e-9)


def test_periodic_ends_refuse_rigid_bodies(tmp_path):
    with pytest.raises(InputError, match="domain.x.*periodic; a scene with rigid parts needs ends of another kind"):
        block_on_a_floor(tmp_path, 'domain.x=["periodic", "periodic"]', text=BLOCK + RIGID)
