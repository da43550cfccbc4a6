"""What a scene measures is given to kernels at run time: other numbers compile nothing."""

import ast
import math
from dataclasses import fields, is_dataclass, replace

import pytest

from distfsi.device import cpu
from distfsi.device.emit import Emission, callees_first
from distfsi.fluid.kernels.signals import fastest_signals
from distfsi.fluid.kernels.stage import advance_tiles
from distfsi.laws.law import FluidEos
from distfsi.laws.registry import laws_of, word_of
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.shipped import shipped_inputs
from distfsi.simulation import Simulation
from fluids import AIR, model_of

INPUTS = shipped_inputs()
SCENES = {
    "tnt_air": ["fluid.sharpening=true"],
    "sod": ["fluid.precision=float32", "domain.gravity=-9.81", "output.peaks=true"],
    "plate_impact": [],
    "steel_tube": ["domain.cells=[40, 40]", "solid.bodies.tube.spacing=1.2 mm"],
}


def text_of(driver, constants, bindings):
    """All that is emitted for a driver, and which numbers it is given."""
    emission = Emission(constants, bindings)
    emission.root(driver)
    functions = callees_first(emission.functions)
    return "\n".join([*(ast.unparse(tree) for _, tree in functions), *emission.numbers])


def nudged(value):
    """A scene or a part of it with every number a little larger, but for 0 and whole numbers."""
    if is_dataclass(value):
        return replace(value, **{each.name: nudged(getattr(value, each.name)) for each in fields(value)})
    if isinstance(value, tuple):
        return tuple(map(nudged, value))
    return value * (1.0 + 1e-6) if isinstance(value, float) and math.isfinite(value) else value


def texts_of(scene, monkeypatch):
    """The texts of all kernels of a scene, by name and precision."""
    texts, build = {}, cpu.build

    def keep(drivers, constants, bindings=None, real="float64"):
        drivers = list(drivers)
        for driver in drivers:
            texts[driver.__name__, real] = text_of(driver, constants, bindings or {})
        return build(drivers, constants, bindings, real)

    monkeypatch.setattr(cpu.Cpu, "build", staticmethod(keep))
    Simulation.of(scene, Communicator(), 1)
    return texts


@pytest.mark.parametrize("name", SCENES)
def test_other_numbers_make_no_other_kernels(monkeypatch, name):
    """Every number that the input gives, defaults included."""
    scene = load(INPUTS / f"{name}.toml", SCENES[name])
    texts = texts_of(scene, monkeypatch)
    assert len(texts) > 20 if scene.solid else len(texts) >= 3
    assert texts_of(nudged(scene), monkeypatch) == texts


def test_every_number_is_nudged():
    scene = load(INPUTS / "steel_tube.toml")
    other = nudged(scene)
    assert other.fluid.phases[1].eos.gamma == scene.fluid.phases[1].eos.gamma * (1.0 + 1e-6)
    assert other.solid.bodies[0].strength.n > scene.solid.bodies[0].strength.n
    assert other.domain.upper > scene.domain.upper
    assert other.time.cfl > scene.time.cfl
    assert other.domain.cells == scene.domain.cells


@pytest.mark.parametrize("law", laws_of(FluidEos), ids=word_of)
@pytest.mark.parametrize("driver", [advance_tiles, fastest_signals], ids=lambda driver: driver.__name__)
def test_numbers_of_a_law_make_no_other_kernels(law, driver):
    texts = set()
    for shift in (0.0, 0.5):
        eos = law(*(2.0 + shift + k for k in range(len(fields(law)))))
        model = model_of(eos, AIR, dimensions=2)
        texts.add(text_of(driver, model.constants, model.bindings))
    assert len(texts) == 1


def test_another_number_leaves_no_new_file(tmp_path, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path))

    def files_after(*settings):
        simulation = Simulation.of(load(INPUTS / "tnt_air.toml", ["domain.cells=64", *settings]), Communicator(), 1)
        for _ in range(2):
            simulation.step()
        return {path.name for path in tmp_path.iterdir()}, simulation.fluid.cells(0).sum()

    (files, total), (others, other_total) = files_after(), files_after("fluid.phases.air.gamma=1.39")
    assert files and files == others
    assert total != other_total
