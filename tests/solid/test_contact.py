"""Bodies that meet: each other, their mirror images, the walls of the domain; how they start, and what ends a run."""

import math
from dataclasses import replace

import numpy as np
import pytest

from distfsi.errors import InputError, StepTooShort
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.laws.sources.gravity import Gravity
from distfsi.mesh.communicator import Communicator
from distfsi.scene.description import Ball, Box, Cylinder, HalfSpace, Tube
from distfsi.scene.interpenetration import overlap
from distfsi.scene.loader import load
from distfsi.scene.packing import pack
from distfsi.scene.shapes import dimensions
from distfsi.simulation import Simulation
from distfsi.solid.contact import surface_tables
from mpi_solid import body, solid, step

FORMS = ("total_lagrangian", "updated_lagrangian")
SOFT_EOS, SOFT = LinearEos(833.3333), Elastic(384.6154)  # of density 1000: longitudinal waves at 1.16 m/s
BLOCKS = """
domain = { lower = ["-20 mm", "-20 mm"], upper = ["20 mm", "20 mm"], cells = [20, 20] }
time.end = "2 us"
"""
STEEL = """spacing = "1 mm"
density = 7830
eos = { kind = "linear", bulk_modulus = "160 GPa" }
strength = { kind = "elastic", shear_modulus = "80 GPa" }
"""


def energy(part):
    totals = part.totals()
    return totals["kinetic"] + totals["internal"]


def momenta(part, chosen=slice(None)):
    """Mass, momentum, angular momentum about the center of mass, and this, of chosen particles in two dimensions."""
    c = part.columns
    m, x, v = c["mass"][chosen, None], c["position"][chosen], c["velocity"][chosen]
    center = (m * x).sum(axis=0) / m.sum()
    r = x - center
    return m.sum(), (m * v).sum(axis=0), (m[:, 0] * (r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0])).sum(), center


def run_until(part, end):
    time = 0.0
    while time < end:
        time += step(part)[0]


def run_to_end(simulation):
    while not simulation.done:
        simulation.step()


def scene_of(tmp_path, text, *overrides):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return load(path, overrides)


# ---- starts ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "second", "thickness"),
    [
        (Box((-10.0, -10.0), (10.0, 0.0)), Box((-10.0, -0.25), (10.0, 9.75)), 0.25),
        (Box((0.0, 0.0), (10.0, 10.0)), Ball((5.0, 5.0), 2.0), 4.0),
        (Box((0.0, 0.0), (10.0, 10.0)), Ball((12.0, 12.0), 2.8), 0.0),
        (Tube((0.0, 0.0), 9.5, 12.5), Ball((0.0, 0.0), 9.5), 0.0),
        (Tube((0.0, 0.0), 9.5, 12.5), Ball((0.0, 0.0), 9.6), 0.1),
        (Tube((0.0, 0.0), 9.5, 12.5), Ball((0.0, 0.0), 9.0), 0.0),
        (Ball((-7.0, 7.0), 5.0), Ball((0.0, 0.0), 5.0), 10.0 - 7.0 * math.sqrt(2.0)),
        (Ball((-10.0, 0.0), 5.0), Ball((0.0, 0.0), 5.0), 0.0),
        (Ball((0.0, 10.0), 5.0), HalfSpace((0.0, 10.0 - 5.0 * math.sqrt(2.0)), (1.0, 1.0)), 0.0),
        (Ball((0.0, 10.0), 5.0), HalfSpace((0.0, 10.0 - 4.9 * math.sqrt(2.0)), (1.0, 1.0)), 0.1),
        (Cylinder((0.0,) * 3, (0.0, 0.0, 10.0), 6.0, 3.0), Cylinder((0.0,) * 3, (0.0, 0.0, 10.0), 3.1, 0.0), 0.1),
        (Cylinder((0.0,) * 3, (0.0, 0.0, 10.0), 6.0, 0.0), Cylinder((0.0, 0.0, 10.0), (0.0, 0.0, 15.0), 6.0, 0.0), 0.0),
    ],
)
def test_shapes_overlap_by_what_they_have_in_common(first, second, thickness):
    D = dimensions(first)
    bodies = [body(shape, 1.0, 1000.0, (0.0,) * D) for shape in (first, second)]
    points = np.concatenate([pack(each, (-20.0,) * D, (20.0,) * D)[0] for each in bodies])
    assert overlap(first, second, points, 1.0) == pytest.approx(thickness, rel=1e-8, abs=1e-8)


def test_a_true_overlap_is_a_fault_with_its_depth(tmp_path):
    text = f"""{BLOCKS}
[solid.bodies.lower]
shape = {{ kind = "box", lower = ["-10 mm", "-10 mm"], upper = ["10 mm", 0] }}
{STEEL}
[solid.bodies.upper]
shape = {{ kind = "box", lower = ["-10 mm", "-0.25 mm"], upper = ["10 mm", "9.75 mm"] }}
{STEEL}"""
    with pytest.raises(InputError) as caught:
        scene_of(tmp_path, text)
    assert "solid.bodies.upper.shape" in str(caught.value)
    assert "overlaps body 'lower' by 0.00025 m" in str(caught.value)
    assert scene_of(tmp_path, text, 'solid.bodies.upper.shape.lower=["-10 mm", 0]')


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("radius", ["8.3 mm", "9.5 mm"])
def test_a_core_in_its_jacket_is_at_rest(tmp_path, form, radius):
    text = f"""{BLOCKS}
solid.form = "{form}"
[solid.bodies.jacket]
shape = {{ kind = "tube", center = [0, 0], inner_radius = "{radius}", outer_radius = "12.5 mm" }}
{STEEL}
[solid.bodies.core]
shape = {{ kind = "ball", center = [0, 0], radius = "{radius}" }}
{STEEL}"""
    simulation = Simulation.of(scene_of(tmp_path, text), Communicator(), 1)
    for _ in range(5):
        simulation.step()
    assert simulation.solid.totals()["kinetic"] == 0.0


# ---- bodies that meet ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize(("own", "other"), [(1.0, 1.0), (1.0, 4.0), (4.0, 1.0)])
def test_tables_of_surfaces_are_means_over_lattices(dimensions, own, other):
    """What a lattice's particles, one by one, add up to at touch, averaged over places along the surface."""
    h = 1.3 * max(own, other)
    n = math.ceil(2.0 * h / other) + 1
    layers = 0.5 * own + other * (np.arange(n) + 0.5)
    along = other * np.arange(-n, n + 1)
    grids = np.meshgrid(layers, *[along] * (dimensions - 1), indexing="ij")
    lattice = np.stack([grid.ravel() for grid in grids], axis=1)
    norm = {2: 1.75 / math.pi, 3: 1.3125 / math.pi}[dimensions]
    fills = []
    for place in other * (np.arange(8) + 0.5) / 8:
        q = np.minimum(np.linalg.norm(lattice - np.array([0.0, *[place] * (dimensions - 1)]), axis=1) / h, 2.0)
        fills.append(norm * (other / h) ** dimensions * ((1.0 - 0.5 * q) ** 4 * (1.0 + 2.0 * q)).sum())
    tables = surface_tables(np.array([own, other]), dimensions)
    assert tables.fill[0, 1] == pytest.approx(np.mean(fills), rel=0.01)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_elastic_discs_bounce(form, angle):
    """At 12 % of their sound speed, along the lattice and across, 20 particles across: they part, and do not spin."""
    turn = math.radians(angle)
    way, radius, spacing, speed = np.array([math.cos(turn), math.sin(turn)]), 0.2, 0.02, 0.1414
    left, right = (
        body(Ball(tuple(-sign * 0.21 * way), radius), spacing, 1000.0, sign * speed * way, SOFT_EOS, SOFT)
        for sign in (1.0, -1.0)
    )
    part = solid([left, right], (-1.0, -1.0), (1.0, 1.0), form=form, viscosity=(0.5, 1.0))
    whole, first = energy(part), part.columns["body"] == 0
    run_until(part, 1.5)
    mass, momentum, spin, center = momenta(part, part.columns["body"] == 0)
    other = momenta(part, part.columns["body"] == 1)
    assert first.any()
    assert np.abs(momentum + other[1]).max() < 1e-12 * mass * speed
    back = momentum / mass / speed
    assert np.linalg.norm(other[3] - center) > 2.0 * radius
    assert -0.92 < back @ way < -0.75
    assert abs(back @ np.array([-way[1], way[0]])) < 0.03
    assert abs(spin) < 0.02 * mass * speed * radius
    assert energy(part) == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("angle", [7.0, 22.0])
def test_discs_in_rings_bounce_straight_and_alike(angle):
    """10 particles across: restitution within 0.5 %, no more than a degree aside, hardly a spin. As lattices, which are
    staircases, they leave up to 7 degrees aside."""
    turn, radius, speed = math.radians(angle), 0.2, 0.1414
    way, side = np.array([math.cos(turn), math.sin(turn)]), np.array([-math.sin(turn), math.cos(turn)])
    left, right = (
        body(Ball(tuple(-sign * 0.21 * way), radius), 0.04, 1000.0, sign * speed * way, SOFT_EOS, SOFT)
        for sign in (1.0, -1.0)
    )
    discs = [replace(disc, packing="rings") for disc in (left, right)]
    part = solid(discs, (-1.0, -1.0), (1.0, 1.0), form=FORMS[0], viscosity=(0.5, 1.0))
    run_until(part, 1.5)
    mass, momentum, spin, _ = momenta(part, part.columns["body"] == 0)
    back = momentum / mass / speed
    assert back @ way == pytest.approx(-0.8785, rel=0.005)
    assert abs(back @ side) < math.tan(math.radians(1.0)) * abs(back @ way)
    assert abs(spin) < 0.012 * mass * speed * radius


@pytest.mark.parametrize("form", FORMS)
def test_five_discs_in_a_row_pass_the_impulse_on(form):
    """Newton's cradle: four at rest that touch, and one that comes with 2 % of the sound speed, 20 particles across."""
    discs = [
        replace(body(Ball((0.4 * i - 0.8, 0.0), 0.2), 0.02, 1000.0, (0.0, 0.0), SOFT_EOS, SOFT), packing="rings")
        for i in range(1, 5)
    ]
    first = replace(discs[0], shape=Ball((-0.82, 0.0), 0.2), velocity=(0.02, 0.0))
    part = solid([first, *discs], (-1.2, -1.0), (1.2, 1.0), form=form)
    run_until(part, 6.0)
    velocities = [np.divide(*momenta(part, part.columns["body"] == b)[1::-1])[0] / 0.02 for b in range(5)]
    assert velocities[4] > 0.9
    assert np.abs(velocities[:3]).max() < 0.05


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_momentum_angular_momentum_and_energy_are_kept(friction):
    """In an oblique hit of discs of different materials and spacings; friction makes them spin."""
    left = body(Ball((-0.22, 0.1), 0.2), 0.04, 1000.0, (0.3, 0.0), SOFT_EOS, SOFT)
    right = body(Ball((0.22, -0.1), 0.2), 0.025, 3000.0, (-0.1, 0.05), SOFT_EOS, SOFT)
    part = solid([left, right], (-1.0, -1.0), (1.0, 1.0), form="total_lagrangian", friction=friction)
    whole, (mass, momentum, spin, _) = energy(part), momenta(part)
    run_until(part, 0.6)
    kept = momenta(part)
    assert energy(part) == pytest.approx(whole, rel=1e-12)
    assert np.abs(kept[1] - momentum).max() < 1e-12 * mass * 0.3
    assert abs(kept[2] - spin) < 1e-12 * mass * 0.3 * 0.4
    own = momenta(part, part.columns["body"] == 0)
    assert (abs(own[2]) > 0.05 * own[0] * 0.3 * 0.2) == (friction > 0.0)


@pytest.mark.parametrize(("form", "ratio"), [(FORMS[0], 1), (FORMS[0], 4), (FORMS[1], 2)])
def test_plates_with_a_gap_bear_the_stress_of_waves(form, ratio):
    """Between elastic plates of one material the stress is density x c x closing speed / 2, whatever their spacings.
    Poisson's ratio is 0, so that free sides do not matter."""
    E, density, length, speed = 207e9, 7850.0, 0.1, 10.0
    eos, strength, spacing, c = LinearEos(E / 3.0), Elastic(E / 2.0), 0.0025, math.sqrt(207e9 / 7850.0)
    left = body(Box((-length, 0.0), (0.0, 0.02)), spacing, density, (speed, 0.0), eos, strength)
    right = body(Box((5e-6, 0.0), (length, 0.02)), spacing / ratio, density, (0.0, 0.0), eos, strength)
    part = solid([left, right], (-0.2, 0.0), (0.2, 0.1), (1,), form=form, viscosity=(0.5, 1.0))
    run_until(part, 0.6 * length / c)
    x, stress = part.columns["position"][:, 0], part.columns["pressure"] - part.columns["deviator"][:, 0]
    for plateau in ((x > -0.4 * length) & (x < -0.1 * length), (x > 0.1 * length) & (x < 0.4 * length)):
        assert stress[plateau].mean() == pytest.approx(0.5 * density * c * speed, rel=0.01)


def balls(form, n, speed, spacing, end):
    """Two steel balls that meet along n; no step may be below a twentieth of the first."""
    bodies = [
        f"""[solid.bodies.{name}]
shape = {{ kind = "ball", center = {(-sign * 0.0113137 * n).tolist()}, radius = "10 mm" }}
velocity = {(sign * speed * n).tolist()}
spacing = "{spacing}"
density = 7830
eos = {{ kind = "mie_grueneisen", c0 = 4569, s1 = 1.49, gamma0 = 2.17, a = 0.46 }}
strength = {{ kind = "perfectly_plastic", shear_modulus = "80 GPa", yield_stress = "1 GPa" }}
"""
        for name, sign in (("a", 1.0), ("b", -1.0))
    ]
    return f"""domain = {{ lower = [-0.03, -0.03, -0.03], upper = [0.03, 0.03, 0.03], cells = [10, 10, 10] }}
time = {{ end = "{end}", smallest_step = 0.05 }}
solid.form = "{form}"
{"".join(bodies)}"""


@pytest.mark.parametrize(
    ("form", "packing", "distance", "spread"),
    [(FORMS[0], "relaxed", 8.43e-3, 0.01), (FORMS[0], "lattice", 8.95e-3, 0.03), (FORMS[1], "lattice", 9.6e-3, 0.03)],
)
@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0)], ids=["x", "xy", "xyz"])
@pytest.mark.full
def test_steel_balls_do_not_pass_each_other(tmp_path, form, packing, distance, spread, way):
    """At 424 m/s each, five particles across a radius, they end about equally far from each other in all directions:
    8.48, 8.41 and 8.44 mm with bonds and a relaxed packing; 9.08, 9.10 and 8.74 mm with a lattice."""
    n = np.array(way) / np.linalg.norm(way)
    text = balls(form, n, 424.264, "2 mm", "30 us").replace("velocity =", f'packing = "{packing}"\nvelocity =')
    simulation = Simulation.of(scene_of(tmp_path, text), Communicator(), 1)
    run_to_end(simulation)
    first, second = (simulation.solid.body_totals(b)["center"] for b in (0, 1))
    assert np.linalg.norm(second - first) == pytest.approx(distance, rel=spread)


@pytest.mark.parametrize("form", FORMS)
def test_fast_balls_neither_pass_nor_hang(tmp_path, form):
    """At 2 km/s each, four particles across a radius, along no axis of the lattice."""
    n = np.array([1.0, 2.0, 3.0]) / math.sqrt(14.0)
    simulation = Simulation.of(scene_of(tmp_path, balls(form, n, 2000.0, "2.5 mm", "6.4 us")), Communicator(), 1)
    before = energy(simulation.solid)
    run_to_end(simulation)
    first, second = (simulation.solid.body_totals(b)["center"] for b in (0, 1))
    assert (second - first) @ n > 5e-3
    assert energy(simulation.solid) == pytest.approx(before, rel=1e-12)


# ---- friction --------------------------------------------------------------------------------------------------------


def block_on_a_floor(friction, gravity, speed):
    """A soft block, 4 particles high, on a fixed floor, under `gravity` (2,) [m/s2]; c = 41 m/s."""
    eos, strength = LinearEos(1e6), Elastic(5e5)
    floor = Box((-0.5, -0.05), (0.5, 0.0))
    low = replace(body(floor, 0.025, 1000.0, (0.0, 0.0), eos, strength, floor), name="floor")
    block = body(Box((-0.1, 0.0), (0.1, 0.1)), 0.025, 1000.0, (speed, 0.0), eos, strength)
    sources = (Gravity(gravity),)
    form = "total_lagrangian"
    return solid([low, block], (-1.0, -1.0), (1.0, 1.0), form=form, sources=sources, friction=friction)


@pytest.mark.parametrize(
    ("friction", "slope", "speed"),
    [(0.0, 0.0, 0.5), (0.3, 0.0, 0.5), (0.3, 0.0, 0.1), (0.3, 0.2, 0.0), (0.3, 0.5, 0.0)],
    ids=["free", "slides", "stops", "sticks", "slips"],
)
def test_a_block_slides_and_sticks_as_coulomb_says(friction, slope, speed):
    """On a floor or a slope, after 0.08 s under 10 m/s2 across. What the floor has pressed follows from how the block
    rises or falls on it."""
    part, time = block_on_a_floor(friction, (10.0 * slope, -10.0), speed), 0.08
    chosen = part.columns["body"] == 1
    run_until(part, time)
    mass, momentum, _, _ = momenta(part, chosen)
    velocity = momentum / mass
    free, rubbed = speed + 10.0 * slope * time, friction * (10.0 * time + velocity[1])
    sticks = friction > slope and free < rubbed
    assert velocity[0] == pytest.approx(0.0 if sticks else free - rubbed, abs=0.01)
    assert abs(velocity[1]) < 0.1


@pytest.mark.full
def test_a_disc_that_slides_begins_to_roll():
    """In rings, 8 particles to its radius: with 2/3 of its speed and the spin of that, which is 8 % too small."""
    eos, strength, floor = LinearEos(1e6), Elastic(5e5), Box((-0.3, -0.025), (0.3, 0.0))
    low = replace(body(floor, 0.0125, 1000.0, (0.0, 0.0), eos, strength, floor), name="floor")
    disc = replace(body(Ball((0.0, 0.1), 0.1), 0.0125, 1000.0, (0.3, 0.0), eos, strength), packing="rings")
    given = {"form": "total_lagrangian", "sources": (Gravity((0.0, -10.0)),), "friction": 0.3}
    part, time, found = solid([low, disc], (-0.5, -0.5), (0.5, 0.5), **given), 0.0, []
    while time < 0.08:  # it slides until 0.033
        time += step(part)[0]
        mass, momentum, spin, _ = momenta(part, part.columns["body"] == 1)
        if time > 0.06:
            found.append((momentum[0] / mass, -spin / (0.5 * mass * 0.1)))
    speed, edge = np.mean(found, axis=0)
    assert speed == pytest.approx(0.2, rel=0.02)
    assert edge == pytest.approx(0.2, rel=0.1)


# ---- walls -----------------------------------------------------------------------------------------------------------


def box_at_walls(tmp_path, center, velocity, *overrides):
    ends = ", ".join(f'{axis} = ["wall", "wall"]' for axis in "xy")
    low, high = ((np.array(center) + sign * 0.1).tolist() for sign in (-1.0, 1.0))
    text = f"""domain = {{ lower = [0, 0], upper = [1, 1], cells = [20, 20], {ends} }}
time.end = 0.2
[solid.bodies.b]
shape = {{ kind = "box", lower = {low}, upper = {high} }}
velocity = {velocity}
spacing = 0.025
density = 10
eos = {{ kind = "linear", bulk_modulus = 100 }}
strength = {{ kind = "elastic", shear_modulus = 50 }}
"""
    return Simulation.of(scene_of(tmp_path, text, *overrides), Communicator(), 1)


@pytest.mark.parametrize("form", FORMS)
def test_a_wall_turns_a_body_back(tmp_path, form):
    """At 3/4 of its sound speed."""
    simulation = box_at_walls(tmp_path, (0.7, 0.5), [3.0, 0.0], f"solid.form={form}")
    solid, whole = simulation.solid, energy(simulation.solid)
    farthest = 0.0
    while not simulation.done:
        simulation.step()
        farthest = max(farthest, solid.columns["position"][:, 0].max())
    totals, mass = solid.totals(), 0.04 * 10.0
    assert 0.98 < farthest < 1.0 + 0.1 * 0.025
    assert -3.0 * mass < totals["momentum"][0] < -1.5 * mass
    assert np.allclose(totals["momentum"] - [3.0 * mass, 0.0], solid.boundary_impulse(), rtol=0.0, atol=1e-12 * mass)
    assert energy(solid) == pytest.approx(whole, rel=1e-12)


def test_a_body_slides_along_a_wall_and_rests_on_it(tmp_path):
    """Without friction, from the start: what touches is at rest across the wall and keeps its velocity along it."""
    simulation = box_at_walls(tmp_path, (0.5, 0.1), [1.0, 0.0])
    for _ in range(30):
        simulation.step()
    velocity = simulation.solid.columns["velocity"]
    assert np.abs(velocity - [1.0, 0.0]).max() < 1e-13


@pytest.mark.full
def test_a_pile_in_a_box_comes_to_rest(tmp_path):
    """Nine discs and boxes that fall on each other, with friction between them: energy does not grow, and none gets
    out."""
    random, bodies = np.random.default_rng(3), []
    for n in range(9):
        x, y = np.array([0.2 + 0.3 * (n % 3), 0.18 + 0.34 * (n // 3)]) + random.uniform(-0.02, 0.02, 2)
        disc = f'{{ kind = "ball", center = [{x}, {y}], radius = 0.12 }}'
        box = f'{{ kind = "box", lower = [{x - 0.1}, {y - 0.09}], upper = [{x + 0.1}, {y + 0.09}] }}'
        bodies.append(f"""[solid.bodies.b{n}]
shape = {disc if n % 2 else box}
spacing = 0.03
density = 1000
velocity = [{random.uniform(-0.5, 0.5)}, -1]
eos = {{ kind = "linear", bulk_modulus = 2e6 }}
strength = {{ kind = "elastic", shear_modulus = 1e6 }}
""")
    ends = 'x = ["wall", "wall"], y = ["wall", "outflow"]'
    text = f"""domain = {{ lower = [0, 0], upper = [1, 1.4], cells = [20, 28], {ends} }}
time.end = 2
solid.friction = 0.3
sources.g = {{ kind = "gravity", acceleration = [0, -10] }}
{"".join(bodies)}"""
    simulation = Simulation.of(scene_of(tmp_path, text), Communicator(), 1)
    part = simulation.solid

    def whole():
        return energy(part) + 10.0 * (part.columns["mass"] * part.columns["position"][:, 1]).sum()

    before = whole()
    while not simulation.done:
        simulation.step()
        if simulation.steps % 100 == 0:
            assert whole() < 1.0005 * before  # positions and velocities are half a step apart
    x = part.columns["position"]
    assert part.totals()["kinetic"] < 0.005 * before
    assert (x > 0.0).all() and (x[:, 0] < 1.0).all()


# ---- the clock -------------------------------------------------------------------------------------------------------


def test_a_step_that_falls_too_far_ends_the_run(tmp_path):
    """With the place, the body and the cause; the state before it is valid."""
    simulation = box_at_walls(tmp_path, (0.7, 0.5), [3.0, 0.0], "time.smallest_step=0.97")
    with pytest.raises(StepTooShort) as caught:
        run_to_end(simulation)
    text = str(caught.value)
    assert caught.value.exit_code == 3
    assert "less than 0.97 of the first" in text
    assert "of solid particle" in text and "of body 'b' at (" in text
    assert f"at t = {simulation.time:.6g} s, after {simulation.steps} steps" in text
    assert simulation.is_valid()
