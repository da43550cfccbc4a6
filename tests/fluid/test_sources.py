"""Sources: what accelerates everything alike, as one body force that kernels get as numbers at run time."""

import ast
from dataclasses import dataclass

import numpy as np
import pytest

from distfsi.device.cpu import Cpu
from distfsi.device.emit import Emission
from distfsi.device.gpu import Gpu
from distfsi.device.host import HostRuntime
from distfsi.device.markers import driver
from distfsi.fluid.kernels.stage import advance_tiles
from distfsi.formulas.symbols import BODY_FORCE
from distfsi.laws.body_force import BodyForce
from distfsi.laws.law import Source, vector
from distfsi.laws.sources.gravity import Gravity
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.description import Box, FluidState, Region
from distfsi.simulation import Simulation
from fluids import AIR, model_of
from launch import ROOT
from tubes import PERIODIC, fields, scene_of, start


@dataclass(frozen=True)
class Ramp(Source):
    """An acceleration that grows with time from the start."""

    acceleration: tuple[float, ...] = vector("m/s2", "after a second")

    def share(self, start, end):
        return 0.5 * (start + end)


@driver
def fall(begin, end, dt, velocity):
    """velocity[i] after `dt` of the body force along the first axis."""
    for i in range(begin, end):
        velocity[i] = velocity[i] + dt * BODY_FORCE[0]


def text_with(*sources):
    """Of the stage's kernel in two dimensions."""
    model = model_of("air", dimensions=2, sources=sources)
    emission = Emission(model.constants, model.bindings)
    emission.root(advance_tiles)
    text = "\n".join(ast.unparse(tree) for _, tree in emission.functions.values())
    return text, tuple(emission.numbers.values())


def test_without_a_source_kernels_know_of_none():
    text, numbers = text_with()
    with_one, more = text_with(Gravity((0.0, -9.81)))
    assert len(with_one) > len(text) and more.count(-9.81) == 1
    assert [number for number in more if number != -9.81] == list(numbers)


def test_a_source_that_changes_has_the_kernel_of_one_that_does_not():
    assert text_with(Ramp((0.0, 3.0)))[0] == text_with(Gravity((0.0, -9.81)))[0]


@pytest.mark.parametrize("device", [Cpu(1), Gpu(HostRuntime())], ids=["cpu", "gpu"])
def test_a_kernel_gets_the_value_of_the_moment(device):
    force = BodyForce([Ramp((3.0,)), Gravity((1.0,))], 1)
    kernel = device.build([fall], {"BODY_FORCE": force.acceleration}).fall
    velocity = device.zeros(2)
    for time, expected in ((0.0, 0.5 + 0.375), (0.5, 0.5 + 1.125)):
        assert force.average_over(time, 0.5)
        before = device.download(velocity).copy()
        device.run(kernel, 2, 0.5, velocity)
        assert np.array_equal(device.download(velocity) - before, [expected] * 2)


def test_only_axes_along_which_something_acts_have_a_number():
    steady, varying = (
        BodyForce([Gravity((0.0, -9.81, 1.0)), Gravity((0.0, 0.0, 2.0))], 3),
        BodyForce([Ramp((0.0, 1.0))], 2),
    )
    assert steady.acceleration == (0.0, -9.81, 3.0) and not steady.average_over(1.0, 1.0)
    assert varying.acceleration[0] == 0.0 and varying.average_over(1.0, 1.0) and not varying.average_over(1.0, 1.0)


def test_the_fluid_gains_the_integral():
    """In a periodic box, however its density varies; what was at rest begins to move. An interface is advected."""
    light, heavy = (FluidState(0, rho, 1e5, (0.0,)) for rho in (1.0, 2.0))
    regions = (Region(light, None), Region(heavy, Box((0.25,), (0.5,))))
    scene = scene_of((AIR,), regions, (0.0,), (1.0,), (64,), 1e-3, (PERIODIC,), sources=(Ramp((2e4,)),))
    simulation = start(scene)
    while not simulation.done:
        simulation.step()
        momentum, mass = simulation.fluid.totals()[0][[1, 0]]
        assert momentum / mass == pytest.approx(1e4 * simulation.time**2, rel=1e-12)
    assert np.abs(fields(simulation)["velocity"]).max() > 0.0


def test_gravity_of_the_domain_and_sources_add_up(tmp_path):
    changes = ["domain.gravity=-9.81", 'sources.more={kind="gravity", acceleration="1 km/s2"}']
    scene = load(ROOT / "inputs/sod.toml", changes)
    assert scene.sources == (Gravity((-9.81,)), Gravity((1000.0,)))
    assert Simulation.of(scene, Communicator(), 1).fluid.model.body_force.acceleration == (990.19,)
