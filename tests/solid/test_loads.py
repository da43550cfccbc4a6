"""Blasts by the curves on bodies without a fluid: faces, angles of incidence, the whole impulse."""

import math

import numpy as np
import pytest

from distfsi.air_blast import SURFACE, air_blast
from distfsi.diagnostics.budget import Budget
from distfsi.errors import InputError
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.loads import facets_of_bodies, loaded_particles
from distfsi.simulation import Simulation
from launch import run_ranks
from side_by_side import SideBySide

SOFT = """
spacing = 0.1
density = 1000
eos = { kind = "linear", bulk_modulus = 2.5e6 }
strength = "none"
"""
BLOCK = (
    """
[domain]
lower = [-1, -1, -1]
upper = [1, 1, 1]
cells = [4, 4, 4]
[time]
end = "8 ms"
[performance]
block_cells = [4, 4, 4]
[solid]
form = "total_lagrangian"
[solid.bodies.block]
shape = { kind = "box", lower = [-0.2, -0.2, 0], upper = [0.2, 0.2, 0.2] }
"""
    + SOFT
    + """
[loads.charge]
mass = "5 kg"
center = [0, 0, -2]
"""
)
STRIP = (
    """
[domain]
lower = [-1, 0]
upper = [1, 1]
cells = [4, 4]
y = ["symmetry", "outflow"]
[time]
end = "20 ms"
[solid]
form = "total_lagrangian"
[solid.bodies.strip]
shape = { kind = "box", lower = [0, 0], upper = [0.2, 0.4] }
"""
    + SOFT
    + """
[loads.charge]
mass = "20 kg"
center = [-3, 0]
burst = "surface"
start = "1 ms"
"""
)


@pytest.fixture
def scene(tmp_path):
    """The scene of a text with overrides."""

    def read(text, *overrides):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return load(path, [f'output.directory="{tmp_path}/out"', *overrides])

    return read


def start(scene):
    return Simulation.of(scene, Communicator(), 1)


# ---- faces -----------------------------------------------------------------------------------------------------------


def test_faces_of_a_block(scene):
    """Its whole surface, with its normals; not where the domain ends, nor where another body stands."""
    given = scene(BLOCK)
    (facets,) = facets_of_bodies(given.solid, given.domain)
    assert facets.area.sum() == pytest.approx(2 * 0.16 + 4 * 0.08, rel=1e-12)
    np.testing.assert_allclose(facets.normal, facets.outward, atol=1e-9)
    assert np.abs(facets.area @ facets.outward).max() < 1e-12
    neighbour = BLOCK.replace("[loads", '[solid.bodies.other]\nshape = { kind = "box", lower = [-0.2, -0.2, 0.2], upper'
                              " = [0.2, 0.2, 0.4] }\n" + SOFT + "[loads")  # fmt: skip
    given = scene(neighbour)
    for facets in facets_of_bodies(given.solid, given.domain):
        assert facets.area.sum() == pytest.approx(0.16 + 4 * 0.08, rel=1e-12)
    given = scene(STRIP)
    (facets,) = facets_of_bodies(given.solid, given.domain)
    assert facets.area.sum() == pytest.approx(2 * 0.4 + 0.2, rel=1e-12)  # no face in the symmetry plane


def test_a_far_blast_on_a_ball(scene):
    """Of a plane wave a ball bears a^2 pi/2 of the reflected pressure and a^2 pi (1/6 - 1) of the incident one."""
    ball = 'shape = { kind = "ball", center = [0, 0, 0], radius = 0.8 }'
    text = BLOCK.replace('shape = { kind = "box", lower = [-0.2, -0.2, 0], upper = [0.2, 0.2, 0.2] }', ball)
    given = scene(text, "loads.charge.center=[0, 0, -50]", "solid.bodies.block.spacing=0.05")
    found = loaded_particles(given, given.loads[0])
    area = math.pi * 0.8**2
    assert found.reflected.sum(axis=0)[2] == pytest.approx(area / 2.0, rel=0.03)
    assert found.incident.sum(axis=0)[2] == pytest.approx(-area * 5.0 / 6.0, rel=0.03)
    assert np.abs(found.reflected.sum(axis=0)[:2]).max() < 1e-9


# ---- the impulse -----------------------------------------------------------------------------------------------------


def impulse_of(given, burst):
    """Sum over the faces of the block's or strip's particles, from the curves alone."""
    (facets,) = facets_of_bodies(given.solid, given.domain)
    (charge,) = given.loads
    total = np.zeros(given.domain.dimensions)
    nearest = {}
    for n, center in zip(facets.particle, facets.center, strict=True):
        nearest[n] = min(nearest.get(n, math.inf), math.dist(center, charge.center))
    for n, outward, area, center in zip(facets.particle, facets.outward, facets.area, facets.center, strict=True):
        blast = air_blast(charge.mass, nearest[n], burst) if burst else air_blast(charge.mass, nearest[n])
        way = np.array(charge.center) - center
        cosine = max(way @ outward / np.linalg.norm(way), 0.0)
        impulse = blast.reflected_impulse * cosine**2 + blast.incident_impulse * (1.0 + cosine**2 - 2.0 * cosine)
        total -= impulse * area * outward
    return total


@pytest.mark.parametrize(("text", "burst"), [(BLOCK, None), (STRIP, SURFACE)])
def test_a_free_body_takes_the_impulse_of_the_curves(scene, text, burst):
    """In whatever steps; the books count it as given from outside, with its work."""
    given = scene(text)
    simulation = start(given)
    budget = Budget(None, simulation.solid, None)
    budget.row(simulation)
    while not simulation.done:
        simulation.step()
    found, expected = simulation.solid.totals()["momentum"], impulse_of(given, burst)
    across = 2 if text is BLOCK else 0
    assert found[across] == pytest.approx(expected[across], rel=1e-10) and expected[across] > 10.0
    row = budget.row(simulation)
    assert max(abs(value) for name, value in row.items() if name.startswith("drift")) < 1e-12
    assert row[next(name for name in row if name.startswith("left energy"))] < 0.0


def test_a_free_rigid_body_takes_it_too(scene):
    """One that cannot deform, in 2D; the symmetry plane holds what pushes it across."""
    text = STRIP.replace("solid.bodies.strip", "solid.rigid.strip").replace(SOFT, "\nspacing = 0.1\ndensity = 1000\n")
    given = scene(text)
    simulation = start(given)
    while not simulation.done:
        simulation.step()
    assert simulation.solid.totals()["momentum"][0] == pytest.approx(impulse_of(given, SURFACE)[0], rel=1e-10)


def test_a_body_that_is_held_hands_it_on(scene):
    """A rigid support gets all of it."""
    held = 'solid.bodies.block.fixed={kind="box", lower=[-1, -1, -1], upper=[1, 1, 1]}'
    simulation = start(scene(BLOCK, held))
    while not simulation.done:
        simulation.step()
    assert np.abs(simulation.solid.totals()["momentum"]).max() == 0.0
    assert np.abs(simulation.solid.boundary_impulse()).max() < 1e-9
    assert simulation.solid.gravity_work() == 0.0


def test_ranks_and_a_restart_change_no_bit(tmp_path, scene):
    scene(STRIP)
    tables = []
    sizes = (
        "--set",
        "performance.block_cells=[4, 4]",
        "--set",
        "domain.cells=[8, 8]",
        "--set",
        "output.history_every=1",
    )
    for ranks in (1, 2):
        words = ["-m", "distfsi", tmp_path / "scene.toml", "--threads", 1, *sizes]
        run_ranks(ranks, [*map(str, words), "--set", f'output.directory="{tmp_path / str(ranks)}"'], 120.0)
        tables.append((tmp_path / str(ranks) / "history.csv").read_bytes())
    assert tables[0] == tables[1]
    first, again = start(scene(STRIP)), start(scene(STRIP))
    while first.time < 4e-3:
        first.step()
    for name, part in again.kept().items():
        part.restore(first.kept()[name].snapshot())
    for _ in range(3):
        first.step()
        again.step()
    assert np.array_equal(first.solid.columns["velocity"], again.solid.columns["velocity"])


def test_cuda_text_has_the_bits_of_the_cpu(monkeypatch, scene):
    pair = SideBySide(monkeypatch, ("fill_cells",))  # in any order on a GPU
    simulation = start(scene(STRIP))
    while simulation.time < 6e-3:
        simulation.step()
    assert not pair.unlike and pair.calls["bear_wave"] > 2
    assert simulation.solid.totals()["momentum"][0] > 0.0


# ---- what is refused -------------------------------------------------------------------------------------------------

FLUID = '\n[fluid.phases.air]\nmaterial = "air"\n[[fluid.regions]]\nphase = "air"\n'


@pytest.mark.parametrize(
    ("text", "override", "told"),
    [
        (BLOCK, "loads.charge.mass=5000", "the curves have no duration; they have one from 0.147 on"),
        (BLOCK, "loads.charge.mass=0.2 g", "no decay of Friedlander's wave reaches the impulse of the curves"),
        (BLOCK, "loads.charge.center=[0, 0, -200]", "the curves of a sphere in free air hold from 0.0531 to 40"),
        (BLOCK, "loads.charge.mass=-1", "loads.charge.mass"),
        (BLOCK + FLUID, "title=a", "presses on bodies where no fluid is computed"),
        (STRIP, "solid.bodies.strip.lattice_angle=30", "is on no lattice along the axes"),
    ],
)  # fmt: skip
def test_what_the_curves_do_not_know_is_a_fault(scene, text, override, told):
    with pytest.raises(InputError) as caught:
        scene(text, *override.split("\n"))
    assert any(told in line for line in caught.value.faults), caught.value.faults
