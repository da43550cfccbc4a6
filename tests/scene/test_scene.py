"""Reading inputs: every example loads, every fault is told, units and overrides."""

import json
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from distfsi.errors import InputError
from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.laws.law import FluidEos, Strength
from distfsi.laws.registry import laws_of, word_of
from distfsi.laws.solid.failure.johnson_cook import JohnsonCookFailure
from distfsi.laws.solid.scatter import Scatter
from distfsi.laws.solid.strength.johnson_cook import JohnsonCook
from distfsi.laws.solid.strength.linear_hardening import LinearHardening
from distfsi.laws.solid.strength.none import NoStrength
from distfsi.laws.sources.gravity import Gravity
from distfsi.scene import load, mirrors, schema
from distfsi.scene.composed_tables import TABLES
from distfsi.scene.description import Ball
from distfsi.scene.reference import markdown
from distfsi.scene.thermodynamics import energy, pressure, sound_speed_squared
from distfsi.scene.units import UNITS, parse_unit, to_si
from launch import ROOT

INPUTS = sorted((ROOT / "inputs").glob("*.toml"))
TUBE = ROOT / "inputs" / "steel_tube.toml"

GAS = """
[domain]
lower = 0
upper = 1
cells = 10
[time]
end = 1
[fluid.phases.gas]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "gas"
density = 1
pressure = 1
"""


@pytest.fixture
def faults(tmp_path):
    """`faults(text, *overrides)`: the faults of an input as (place, rest) pairs."""

    def read(text, *overrides):
        file = tmp_path / "case.toml"
        file.write_text(text)
        with pytest.raises(InputError) as caught:
            load(file, overrides)
        assert caught.value.exit_code == 2
        assert all(fault.startswith("case.toml: ") for fault in caught.value.faults)
        return [fault.removeprefix("case.toml: ") for fault in caught.value.faults]

    return read


# ---- what loads ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_every_example_loads(path):
    scene = load(path)
    assert scene.title
    assert scene.output.directory == f"out/{path.stem}"


def test_the_steel_tube_is_what_the_paper_says():
    scene = load(TUBE)
    products, air = scene.fluid.phases
    assert products.eos == Jwl(1630.0, 3.712e11, 3.21e9, 4.15, 0.95, 0.3)
    assert air.name == "air"
    charge = scene.fluid.regions[1]
    assert charge.shape == Ball((0.0, 0.0), 0.03)
    assert charge.state.pressure == pytest.approx(8.3759e9, rel=1e-5)
    assert charge.state.velocity == (0.0, 0.0)
    (tube,) = scene.solid.bodies
    assert isinstance(tube.strength, JohnsonCook)
    assert (tube.strength.A, tube.strength.melt_temperature, tube.spacing) == (792e6, 1793.0, 0.25e-3)
    assert scene.domain.boundaries == (("symmetry", "outflow"), ("symmetry", "outflow"))
    assert scene.time.end == 2e-5
    assert (scene.performance.block_cells, scene.performance.tile_cells) == ((128, 64), (128, 32))


def test_three_dimensions_and_defaults(tmp_path, faults):
    text = GAS.replace("lower = 0", "lower = [0, 0, 0]").replace(
        "upper = 1", "upper = [1, 1, 2]\ngravity = [0, 0, -9.81]"
    )
    text = text.replace("cells = 10", "cells = [10, 10, 20]")
    text += """
[solid.bodies.one]
shape = { kind = "ball", center = [0.5, 0.5, 1], radius = 0.2 }
spacing = 0.05
density = 1000
eos = { kind = "linear", bulk_modulus = "2 GPa" }
strength = { kind = "elastic", shear_modulus = "1 GPa" }
"""
    (tmp_path / "ball.toml").write_text(text)
    scene = load(tmp_path / "ball.toml")
    assert (scene.domain.dimensions, scene.sources, scene.title) == (3, (Gravity((0.0, 0.0, -9.81)),), "ball")
    assert (scene.performance.block_cells, scene.performance.tile_cells) == ((64, 32, 32), (64, 8, 8))
    assert scene.fluid.inflow == ((None, None),) * 3
    assert scene.solid.bodies[0].velocity == (0.0, 0.0, 0.0)
    body = "solid.bodies.one"
    box = f'{body}.shape={{kind="box", lower=[0.4, 0.4, 0.4], upper=[0.6, 0.6, 0.6]}}'
    assert faults(text, f"{body}.packing=rings", box) == [
        f"{body}.packing (--set): 'rings' need a tube, ball or cylinder, in 2D or 3D"
    ]
    assert faults(text, f"{body}.lattice_angle=30 deg", "domain.lower=[0.4, 0, 0]", "domain.x=symmetry") != []
    hollow = {"start": "[0, 0.5, 1]", "end": "[1, 0.5, 1]", "radius": "0.2", "inner_radius": "0.3"}
    cylinder = ", ".join(f"{key} = {value}" for key, value in hollow.items())
    assert faults(text, f"{body}.shape={{kind = 'cylinder', {cylinder}}}") == [
        f"{body}.shape (--set): inner_radius must be smaller than radius"
    ]


METAL = """
[domain]
lower = [0, 0]
upper = [1, 1]
cells = [10, 10]
[time]
end = 1
[solid]
objective_rate = "green_naghdi"
[solid.bodies.one]
shape = { kind = "ball", center = [0.5, 0.5], radius = 0.2 }
spacing = 0.05
density = 1000
eos = { kind = "linear", bulk_modulus = "2 GPa" }
strength = { kind = "linear_hardening", shear_modulus = "1 GPa", yield_stress = "1 MPa", hardening_modulus = "2 MPa" }
fixed = { kind = "half_space", point = [0.4, 0], normal = [1, 0] }
fixed_velocity = [10, 0]
radial_velocity = 3
packing = "rings"
[solid.bodies.one.failure]
kind = "johnson_cook"
D1 = 0.05
D2 = 3.44
D3 = -2.12
spall_strength = "3 GPa"
fracture_energy = "20 kJ/m2"
scatter = { modulus = 10, size = "2 mm", seed = 7 }
"""


def test_what_breaks_and_moves_a_body(tmp_path, faults):
    (tmp_path / "metal.toml").write_text(METAL)
    solid = load(tmp_path / "metal.toml").solid
    (body,) = solid.bodies
    assert solid.objective_rate == "green_naghdi"
    assert body.strength == LinearHardening(1e9, 1e6, 2e6)
    assert solid.form_of(body) == "total_lagrangian"
    (updated,) = load(tmp_path / "metal.toml", ("solid.bodies.one.form=updated_lagrangian",)).solid.bodies
    assert (solid.form_of(updated), solid.form) == ("updated_lagrangian", "total_lagrangian")
    assert body.failure == JohnsonCookFailure(0.05, 3.44, -2.12, 0.0, 0.0, 1.0, 3e9, 2e4, Scatter(10.0, 2e-3, 7))
    assert (body.fixed_velocity, body.radial_velocity, body.packing) == ((10.0, 0.0), 3.0, "rings")
    one = "solid.bodies.one"
    assert faults(METAL, f"{one}.lattice_angle=30 deg", f"{one}.shape.radius=0.1", f"{one}.eos={COMPACTION}") == [
        f"{one}.lattice_angle (--set): needs packing = 'lattice', another shape than a half space, 2D or 3D",
        f"{one}.strength (line 15): 'concrete' and the eos 'compaction' need each other",
    ]


COMPACTION = (
    "{kind='compaction', crush_pressure=16e6, crush_strain=0.001, lock_pressure=0.8e9, lock_strain=0.1, "
    "K1=85e9, K2=-171e9, K3=208e9}"
)


# ---- overrides -------------------------------------------------------------------------------------------------------


def test_overrides_reach_tables_lists_and_names():
    overrides = [
        "solid.bodies.tube.strength=none",
        "fluid.regions.1.density=1600 kg/m3",
        "domain.cells=[80, 80]",
        "solid.bodies.tube.spacing = 0.0005",
        "output.directory=elsewhere",
        "performance.block_cells=[16, 8]",
    ]
    scene = load(TUBE, overrides)
    assert scene.solid.bodies[0].strength == NoStrength()
    assert scene.fluid.regions[1].state.density == 1600.0
    assert scene.domain.cells == (80, 80)
    assert scene.output.directory == "elsewhere"
    assert (scene.performance.block_cells, scene.performance.tile_cells) == ((16, 8), (16, 8))


SLAB = ROOT / "inputs" / "concrete_slab.toml"


def test_former_words_are_read_with_a_note(tmp_path):
    file = tmp_path / "slab.toml"
    file.write_text(SLAB.read_text().replace("minimum_failure_strain", "least_failure_strain"))
    scene, expected = load(file), load(SLAB)
    assert scene.solid == expected.solid and expected.notes == ()
    (note,) = scene.notes
    assert note.startswith("slab.toml: solid.bodies.slab.strength.least_failure_strain (line ")
    assert "is called minimum_failure_strain now" in note
    tube = load(TUBE, ["coupling.scheme=paper"])
    assert tube.coupling.scheme == "immersed_boundary"
    assert tube.notes == (
        "steel_tube.toml: coupling.scheme (--set): 'paper' is called 'immersed_boundary' now; read until 0.3.0",
    )


def test_a_former_key_beside_that_of_now_is_a_fault(faults):
    text = SLAB.read_text().replace(
        "minimum_failure_strain = 0.01", "minimum_failure_strain = 1\nleast_failure_strain = 1"
    )
    (fault,) = faults(text)
    assert "least_failure_strain" in fault


def test_faulty_overrides_are_told(faults):
    told = faults(
        GAS, "nonsense", "fluid.phases.gsa.gamma=1.3", "fluid.regions.1.density=1", "time.cfl=2", "time.end.x=1"
    )
    assert told == [
        "--set: 'nonsense'; expected key.path=value",
        "--set: 'fluid.phases.gsa.gamma=1.3'; no such phase; expected one of 'gas'; did you mean 'gas'?",
        "--set: 'fluid.regions.1.density=1'; fluid.regions has elements 0 to 0",
        "--set: 'time.end.x=1'; time.end is no table",
        "time.cfl (--set): 2; must be <= 1",
    ]


# ---- faults ----------------------------------------------------------------------------------------------------------

BROKEN = """\
titel = "broken"
[domain]
lower = [0, 0]
upper = [1, "2 kg"]
cells = [10, 20]
x = ["symmetry", "outflw"]
[time]
end = "-1 us"
cfl = true
[fluid.phases.air]
eos = "idel_gas"
gamma = 1.4
[fluid.phases."sea water"]
eos = "stiffened_gas"
gama = 4.4
[[fluid.regions]]
phase = "air"
density = "1.2 kg/m2"
pressure = 1e5
energy = 2e5
[[fluid.regions]]
phase = "aer"
density = 1
[fluid.regions.shape]
kind = "bal"
[solid.bodies.tube]
shape = { kind = "tube", center = [0], inner_radius = 1, outer_radius = 2 }
spacing = "0.1 fs"
eos = 3
strength = "nne"
fixed = { center = [0, 0] }
[output]
history_every = 1.5
[performance]
tile_cells = [0, 1]
"""


def words(kind):
    """The laws of a kind as a message lists them."""
    return ", ".join(repr(word_of(law)) for law in laws_of(kind))


SIMPLE = (mirrors.Box, mirrors.Ball, mirrors.HalfSpace, mirrors.Tube, mirrors.Cylinder)
SHAPES = [repr(get_args(table.model_fields["kind"].annotation)[0]) for table in (*SIMPLE, *TABLES)]


def test_all_faults_are_told_at_once_with_line_and_hint(faults):
    sections = ", ".join(
        f"'{name}'"
        for name in (
            "title",
            "domain",
            "time",
            "fluid",
            "charges",
            "solid",
            "sources",
            "loads",
            "output",
            "gauges",
            "coupling",
            "performance",
            "stages",
        )
    )
    assert faults(BROKEN) == [
        f"titel (line 1): unknown key; expected one of {sections}; did you mean 'title'?",
        'domain.upper (line 4): [1, "2 kg"] has units kg, needs m',
        "domain.x.1 (line 6): \"outflw\"; expected one of 'wall', 'symmetry', 'outflow', 'inflow', 'periodic', 'axis'; "
        "did you mean 'outflow'?",
        'time.end (line 8): "-1 us"; must be > 0',
        "time.cfl (line 9): true is no number; expected one",
        f"fluid.phases.air.eos (line 11): \"idel_gas\"; expected one of {words(FluidEos)}; did you mean 'ideal_gas'?",
        "fluid.phases.sea water.p_inf (line 13): is missing; expected stiffening pressure [Pa]",
        "fluid.phases.sea water.gama (line 15): unknown key; expected one of 'eos', 'gamma', 'p_inf'; "
        "did you mean 'gamma'?",
        'fluid.regions.0.density (line 18): "1.2 kg/m2" has units kg/m2, needs kg/m3',
        "fluid.regions.1.phase (line 22): \"aer\"; expected one of 'air', 'sea water'; did you mean 'air'?",
        f"fluid.regions.1.shape.kind (line 25): \"bal\"; expected one of {', '.join(SHAPES)}; did you mean 'ball'?",
        "solid.bodies.tube.density (line 26): is missing; expected density at rest [kg/m3]",
        "solid.bodies.tube.shape.center (line 27): [0] has 1 entries, needs 2, one per dimension of the domain",
        "solid.bodies.tube.spacing (line 28): \"0.1 fs\" has the unknown unit 'fs'; did you mean 's'?",
        "solid.bodies.tube.eos (line 29): 3; expected a table",
        f"solid.bodies.tube.strength (line 30): \"nne\"; expected one of {words(Strength)}; did you mean 'none'?",
        f"solid.bodies.tube.fixed.kind (line 31): is missing; expected one of {', '.join(sorted(SHAPES))}",
        "output.history_every (line 33): 1.5; it should be a valid integer",
        "performance.tile_cells.0 (line 35): 0; must be >= 1",
    ]


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["domain.upper=0"], "domain.upper (--set): must be greater than lower along x"),
        (['domain.x=["periodic", "wall"]'], "domain.x (--set): one end is periodic; expected both or none"),
        (
            ['domain.x=["wall"]'],
            "domain.x.1 (--set): is missing; "
            "expected one of 'wall', 'symmetry', 'outflow', 'inflow', 'periodic', 'axis'",
        ),
        (["domain.x=wall"], 'domain.x (--set): "wall"; expected a list'),
        (['domain.y=["wall", "wall"]'], "domain.y (--set): the domain has 1 dimension(s), so no y ends"),
        (['domain.x=["inflow", "wall"]'], "fluid.inflow.x_low: is missing: the low x end of the domain is 'inflow'"),
        (["fluid.phases.gas.gamma=1"], "fluid.phases.gas.gamma (--set): 1; must be > 1"),
        (["fluid.regions=[]"], "fluid.regions (--set): is empty; expected an initial state"),
        (
            ["fluid.regions.0.pressure=-1"],
            "fluid.regions.0.pressure (--set): too low: at this density 'gas' has a sound speed only above 0 Pa",
        ),
        (["fluid.regions.0.energy=1"], "fluid.regions.0 (line 11): give either pressure or energy, not both"),
        (
            ["fluid.regions.0.shape={kind='ball', center=0, radius=1}"],
            "fluid.regions.0.shape (--set): the first region covers the whole domain; expected no shape",
        ),
        (
            ["fluid.inflow.x_high={phase='gas', density=1, pressure=1}"],
            "fluid.inflow.x_high (--set): has a state, but the high x end of the domain is 'outflow'; "
            "expected 'inflow'",
        ),
        (["performance.block_cells=[8, 8]"], "performance.block_cells (--set): has 2 entries, needs 1"),
        (["performance.block_cells=2"], "performance.block_cells (--set): 2; must be >= 4"),
        (
            ["performance.block_cells=8", "performance.tile_cells=9"],
            "performance.tile_cells (--set): a tile is larger than a block",
        ),
        (["time.end=inf"], "time.end (--set): Infinity is not finite"),
    ],
)
def test_faults_between_the_parts_of_a_fluid(faults, overrides, expected):
    assert faults(GAS, *overrides) == [expected]


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (
            ['domain.x=["periodic", "periodic"]', "solid.bodies.tube.shape.center=[0.04, 0]"],
            ["domain.x (--set): periodic; a scene with bodies in a fluid needs ends of another kind"],
        ),
        (
            ["solid.bodies.tube.spacing=0.4 mm"],
            [
                "solid.bodies.tube.spacing (--set): 0.0004 m is too coarse for the fluid cells; "
                "expected at most 0.000375 m, 0.75 of the smallest cell; half a cell is better"
            ],
        ),
        (
            ["solid.bodies.tube.shape.center=[1, 1]"],
            [
                "solid.bodies.tube.shape (line {tube}): reaches beyond the high x end of the domain, "
                "which is 'outflow'; only 'symmetry' may cut a body",
                "solid.bodies.tube.shape (line {tube}): reaches beyond the high y end of the domain, "
                "which is 'outflow'; only 'symmetry' may cut a body",
                "solid.bodies.tube.shape (line {tube}): no particle of it lies inside the domain",
            ],
        ),
        (
            ["solid.bodies.tube.shape.inner_radius=35 mm"],
            ["solid.bodies.tube.shape (line {tube}): inner_radius must be smaller than outer_radius"],
        ),
        (
            ["solid.bodies.tube.strength.melt_temperature=200"],
            ["solid.bodies.tube.strength (line {strength}): melt_temperature must be above room_temperature"],
        ),
        (
            ["fluid.regions.1.energy=0.4 MJ/kg"],
            [
                "fluid.regions.1.energy (--set): too low: at this density 'products' has a sound speed only above "
                "1.66677e+06 J/kg"
            ],
        ),
    ],
)
def test_faults_between_fluid_and_solid(overrides, expected):
    with pytest.raises(InputError) as caught:
        load(TUBE, overrides)
    text = TUBE.read_text().splitlines()
    lines = {
        "tube": text.index("[solid.bodies.tube]") + 2,
        "strength": next(n for n, line in enumerate(text, 1) if line.startswith("[solid.bodies.tube.strength]")),
    }
    assert caught.value.faults == ["steel_tube.toml: " + line.format(**lines) for line in expected]


def test_overlapping_bodies_are_a_fault():
    impact = ROOT / "inputs" / "plate_impact.toml"
    for lower, depth in (("-1 mm", "0.001 m"), ("-0.03 mm", "3e-05 m")):
        with pytest.raises(InputError) as caught:
            load(impact, [f"solid.bodies.right.shape.lower={lower}"])
        assert f": overlaps body 'left' by {depth}" in str(caught.value)
    assert load(impact, ["solid.bodies.right.shape.lower=0.01 mm"])


def test_a_faulty_section_does_not_hide_the_faults_of_others(faults):
    told = faults(GAS.replace("pressure = 1", "pressure = -1") + "[output]\nfields_every = -1\n[domian]\n")
    places = ["fluid.regions.0.pressure (line 14)", "output.fields_every (line 16)", "domian (line 17)"]
    assert [line.split(":")[0] for line in told] == places


def test_a_scene_needs_a_material(faults):
    assert faults(GAS[: GAS.index("[fluid")]) == ["has no material; expected [fluid], [solid] or both"]


def test_what_cannot_be_read_is_told(tmp_path):
    (tmp_path / "broken.toml").write_text("[domain\n")
    (tmp_path / "latin.toml").write_bytes(b"title = '\xe9'")
    for name, words in (("missing", "cannot be read"), ("broken", "line 1"), ("latin", "UTF-8")):
        with pytest.raises(InputError, match=words) as caught:
            load(tmp_path / f"{name}.toml")
        assert str(tmp_path / f"{name}.toml") in str(caught.value)


# ---- units -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.5 mm", "m", 5e-4),
        ("7.81 GPa", "Pa", 7.81e9),
        ("20us", "s", 2e-5),
        ("1.225 kg/m3", "kg/m3", 1.225),
        ("1.63 g/cm^3", "kg/m3", 1630.0),
        ("4.29 MJ/kg", "J/kg", 4.29e6),
        ("477 J/(kg K)", "J/(kg K)", 477.0),
        ("477 J kg-1 K**-1", "J/(kg K)", 477.0),
        ("10 N*s/m2", "Pa", None),
        ("1 bar", "Pa", 1e5),
        ("1e4 1/s", "1/s", 1e4),
        ("36 km/h", "m/s", 10.0),
        ("50 %", "1", 0.5),
        ("-.5", "1", -0.5),
        (3, "m", 3.0),
    ],
)
def test_units(text, unit, value):
    if value is None:
        with pytest.raises(ValueError, match="has units"):
            to_si(text, unit)
    else:
        assert to_si(text, unit) == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("20 degC", "temperatures are given in K"),
        ("20 mss", "did you mean 'ms'"),
        ("20", "has no units, needs m"),
        ("20 m/", "a name is missing"),
        ("20 m//s", "a name is missing"),
        ("20 (m", "lacks a"),
        ("20 m)", "too many"),
        ("20 m$", "not understood at"),
        ("ten m", "is not understood; expected a number"),
        (True, "is no number"),
        (float("nan"), "not finite"),
    ],
)
def test_faulty_units(text, words):
    with pytest.raises(ValueError, match=words):
        to_si(text, "m")


@given(st.floats(-1e12, 1e12, allow_subnormal=False), st.sampled_from(sorted(UNITS)), st.sampled_from(sorted(UNITS)))
def test_a_value_in_any_unit_comes_back(value, first, second):
    factor, dimension = parse_unit(f"{first}/{second}")
    other, inverse = parse_unit(f"{second}/{first}")
    assert factor * other == 1
    assert inverse == tuple(-d for d in dimension)
    for name, (scale, exponents) in (("m", UNITS["m"]), (first, UNITS[first])):
        si = to_si(f"{value!r} {name}", name)
        assert si == pytest.approx(value * float(scale), rel=1e-15)
        assert parse_unit(name)[1] == exponents


# ---- equations of state ----------------------------------------------------------------------------------------------


def test_states_of_tnt_products_and_water():
    tnt, water = Jwl(1630.0, 3.712e11, 3.21e9, 4.15, 0.95, 0.3), StiffenedGas(4.4, 6e8)
    p = pressure(tnt, 1630.0, 4.29e6)
    assert p == pytest.approx(8.3759e9, rel=1e-5)
    assert energy(tnt, 1630.0, p) == pytest.approx(4.29e6, rel=1e-14)
    assert sound_speed_squared(tnt, 1630.0, p) ** 0.5 == pytest.approx(4079.9, rel=2e-5)
    assert sound_speed_squared(tnt, 1630.0 / 5.0, 0.186073e9) ** 0.5 == pytest.approx(1017.8, rel=1e-4)
    assert sound_speed_squared(water, 1000.0, 1e5) ** 0.5 == pytest.approx(1624.9, rel=1e-4)
    assert energy(water, 1000.0, 1e5) == pytest.approx((1e5 + 4.4 * 6e8) / (3.4 * 1000.0), rel=1e-14)


# ---- documents -------------------------------------------------------------------------------------------------------


def test_the_reference_is_up_to_date():
    assert (ROOT / "docs" / "input.md").read_text() == markdown() + "\n"


def test_the_schema_is_json_and_names_every_section():
    assert set(json.loads(json.dumps(schema()))["properties"]) >= {"domain", "time", "fluid", "solid", "output"}
