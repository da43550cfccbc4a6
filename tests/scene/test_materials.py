"""Materials by name: each entry is plausible by itself, and a scene takes from it what it leaves out."""

import subprocess
import sys

import numpy as np
import pytest

from distfsi.errors import InputError
from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.law import Rest
from distfsi.laws.solid.metal import Metal
from distfsi.laws.solid.strength.johnson_cook import JohnsonCook
from distfsi.resources.material_sheet import at_rest, behind_shock, detonation, draw, listed, sheet
from distfsi.scene import load
from distfsi.scene.materials import ABOUT, find, laws, materials
from distfsi.scene.shocks import chapman_jouguet

EVERY = {material.name: material for material in materials()}
SOLIDS = [material for material in EVERY.values() if material.is_solid]
EXPLOSIVES = [material for material in EVERY.values() if material.kind == "explosive"]
SOUND = {  # slowest and fastest [m/s] that the kind allows
    "gas": (150.0, 1100.0),
    "liquid": (1400.0, 1650.0),
    "explosive": (1500.0, 6000.0),
    "metal": (1900.0, 8100.0),
    "concrete": (2000.0, 4500.0),
    "glass": (3500.0, 5500.0),
}
SCENE = """
[domain]
lower = 0
upper = 1
cells = 10
[time]
end = 1e-5
[fluid.phases.charge]
material = "TNT"
[fluid.phases.air]
material = "air"
[[fluid.regions]]
phase = "air"
[[fluid.regions]]
phase = "charge"
shape = { kind = "ball", center = 0, radius = 0.1 }
[solid.bodies.wall]
material = "4340"
shape = { kind = "box", lower = 0.5, upper = 0.9 }
spacing = 0.05
"""


def name_of(material):
    return material.name


@pytest.fixture
def scene(tmp_path):
    """The scene of a text with overrides."""

    def read(text, *overrides):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return load(path, overrides)

    return read


# ---- the entries -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("material", materials(), ids=name_of)
def test_an_entry_is_whole_and_its_sound_has_a_speed_of_its_kind(material):
    low, high = SOUND[material.kind]
    density, _, speed = at_rest(material)
    assert low < speed < high and density > 0.0
    for name, part in material.parts.items():
        if name != "state":
            assert part.about["source"] and set(part.about) <= set(ABOUT)
    for law in laws(material).values():
        law.check()


def test_names_are_unambiguous_in_any_spelling():
    names = [name for material in materials() for name in (material.name, *material.aliases)]
    assert all(find(name) is find(name.upper().replace("-", " ")) for name in names)
    assert len({find(name).name for name in EVERY}) == len(EVERY)
    assert find("al 6061 t6").name == "aluminium 6061-T6" and find("unobtainium") is None


@pytest.mark.parametrize("material", EXPLOSIVES, ids=name_of)
def test_speed_and_pressure_of_detonation_follow_from_the_set(material):
    found, given = detonation(material), material.detonation
    assert found.front == pytest.approx(given.speed, rel=1e-3)
    assert found.pressure == pytest.approx(given.pressure, rel=2e-3)
    # Chapman and Jouguet: the products leave the front at their own speed of sound.
    eos = laws(material)["fluid"]
    (reference, slope), (omega, _) = eos.reference(found.density), eos.grueneisen(found.density)
    sound = slope + (found.pressure - reference + omega * found.pressure) / found.density
    assert found.front - found.velocity == pytest.approx(np.sqrt(sound), rel=1e-6)


def test_the_detonation_of_an_ideal_gas_is_that_of_the_textbook():
    # Strong detonation: D^2 = 2 (gamma^2 - 1) q, rho = rho0 (gamma + 1)/gamma, p = rho0 D^2/(gamma + 1).
    from distfsi.laws.fluid.ideal_gas import IdealGas

    found = chapman_jouguet(IdealGas(3.0), 2.0, 1e6)
    assert found.front == pytest.approx(np.sqrt(2.0 * 8.0 * 1e6), rel=1e-9)
    assert found.density == pytest.approx(2.0 * 4.0 / 3.0, rel=1e-6)
    assert found.pressure == pytest.approx(2.0 * found.front**2 / 4.0, rel=1e-6)


@pytest.mark.parametrize("material", SOLIDS, ids=name_of)
def test_a_solid_has_elastic_constants_and_a_hugoniot_that_rises(material):
    density, _, speed = at_rest(material)
    law, bulk = laws(material), density * at_rest(material)[2] ** 2
    shear = law["strength"].shear_modulus
    poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
    assert (0.0 if material.name == "beryllium" else 0.12) < poisson < 0.45  # beryllium: 0.03 to 0.08
    pressures = [behind_shock(material, x).pressure for x in np.linspace(1.0005, 1.2, 40)]
    assert np.all(np.diff(pressures) > 0.0)
    eos = law["eos"]
    if hasattr(eos, "s1") and not (eos.s2 or eos.s3):  # metals: U = c0 + s u is what was measured
        for x in (1.05, 1.2):
            state = behind_shock(material, x)
            strength_of_fit = 0.02 if eos.a else 0.01
            assert state.front == pytest.approx(eos.c0 + eos.s1 * state.velocity, rel=strength_of_fit)
    memory = type("Memory", (), {column.name: column.initial for column in eos.columns})
    assert eos.respond(density, 0.0, Rest(density, eos.rest_bulk_modulus(density)), memory)[0] == 0.0
    yields = law["strength"]
    if isinstance(yields, Metal):
        assert 1e-4 < yields.flow_stress_at_rest() / shear < 0.03 or yields.flow_stress_at_rest() == np.inf
    if "failure" in law and hasattr(law["failure"], "D1"):
        strains = [law["failure"].fracture_strain(eta, 1.0, 0.0) for eta in (-0.3, 0.0, 1.0 / 3.0, 1.5)]
        assert min(strains) > 0.0 and np.all(np.diff(strains) < 0.0)


# ---- in a scene ------------------------------------------------------------------------------------------------------


def test_a_scene_takes_from_a_name_what_it_leaves_out(scene):
    found = scene(SCENE)
    charge, air = found.fluid.phases
    assert charge.eos == Jwl(1630.0, 371.2e9, 3.231e9, 4.15, 0.95, 0.3) and air.eos.gamma == 1.4
    ambient, released = (region.state for region in found.fluid.regions)
    assert (ambient.density, ambient.pressure) == (1.225, 101325.0)
    assert released.density == 1630.0 and released.pressure == pytest.approx(8.38e9, rel=1e-3)
    (wall,) = found.solid.bodies
    assert isinstance(wall.strength, JohnsonCook) and wall.strength.A == 792e6 and wall.failure.D2 == 3.44
    assert (wall.density, wall.eos.c0) == (7830.0, 4569.0)


def test_keys_beside_a_name_change_it(scene):
    found = scene(
        SCENE,
        "fluid.phases.charge.omega=0.35",
        "fluid.regions.0.pressure=2e5",
        "fluid.regions.1.density=1500",
        "solid.bodies.wall.strength.A=1e9",
        "solid.bodies.wall.density=8000",
        "solid.bodies.wall.failure=none",
    )
    assert found.fluid.phases[0].eos.omega == 0.35 and found.fluid.phases[0].eos.A == 371.2e9
    assert [region.state.density for region in found.fluid.regions] == [1.225, 1500.0]
    assert found.fluid.regions[0].state.pressure == 2e5
    (wall,) = found.solid.bodies
    assert (wall.strength.A, wall.strength.B, wall.density, wall.failure) == (1e9, 510e6, 8000.0, None)
    other = scene(SCENE, "solid.bodies.wall.strength=none", 'solid.bodies.wall.eos={kind="linear", bulk_modulus=1e11}')
    assert other.solid.bodies[0].eos.bulk_modulus == 1e11 and other.solid.bodies[0].strength.shear_modulus == 0.0


def test_a_wrong_name_is_one_fault_with_the_nearest_right_one(scene):
    def fault(*overrides):
        with pytest.raises(InputError) as caught:
            scene(SCENE, *overrides)
        (line,) = caught.value.faults
        return line

    assert "did you mean 'TNT'?" in fault("fluid.phases.charge.material=TNN")
    assert "'copper'" in fault("solid.bodies.wall.material=coper")
    assert "is a fluid, and no solid" in fault("solid.bodies.wall.material=water")
    assert "is a solid, and no fluid" in fault("fluid.phases.air.material=lead")
    assert "is of the eos 'jwl'" in fault("fluid.phases.charge.eos=ideal_gas")


# ---- the command -----------------------------------------------------------------------------------------------------


def test_the_command_lists_shows_and_draws(tmp_path):
    assert all(name in listed(materials()) for name in EVERY)
    assert "detonation at 6929 m/s (source: 6930)" in sheet(EVERY["TNT"])
    assert "# source: Johnson & Cook" in sheet(EVERY["steel 4340"])
    for name in ("TNT", "steel 4340"):
        path = draw(EVERY[name], tmp_path / "drawn.png")
        assert path.read_bytes().startswith(b"\x89PNG")
    ended = subprocess.run(
        [sys.executable, "-m", "distfsi", "materials", "tnn"], capture_output=True, text=True, timeout=60
    )
    assert ended.returncode == 2 and "did you mean 'TNT'" in ended.stderr
