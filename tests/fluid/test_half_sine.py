"""A half-sine pulse, as seen from the table that it shakes: what is free gains 2/pi of its top times its duration, and
gas in a closed box is pressed against one wall."""

from math import cos, pi

import numpy as np
import pytest

from distfsi.laws.sources.half_sine import HalfSine
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.description import FluidState, Region
from distfsi.simulation import Simulation
from fluids import AIR
from launch import ROOT
from tubes import PERIODIC, advance, fields, scene_of, start

GAS = FluidState(0, 1.4, 1e5, (0.0,))
SOUND = 1e5**0.5  # m/s


def gained(time, top, duration, begin):
    """The integral of the pulse up to `time` [s]: the velocity of what is free."""
    return top * duration / pi * (1.0 - cos(pi * min(max((time - begin) / duration, 0.0), 1.0)))


def test_a_step_takes_the_mean_over_itself():
    """Also where it holds the beginning or the end of the pulse, or all of it."""
    source = HalfSine((3.0,), 2.0, 1.0)
    edges = np.array([0.0, 0.3, 1.2, 1.9, 2.99, 3.7, 5.0])
    steps = [source.share(a, b) * (b - a) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    assert sum(steps) == pytest.approx(source.share(0.0, 5.0) * 5.0, rel=1e-15) == pytest.approx(4.0 / pi, rel=1e-15)
    assert source.share(1.99, 2.01) == pytest.approx(1.0, rel=1e-4)
    assert source.share(0.0, 1.0) == source.share(3.0, 4.0) == 0.0


def test_gas_that_is_free_moves_as_one():
    """It rests until the pulse begins and moves uniformly after it; tiles at rest wake in time."""
    top, duration, begin = 2e4, 1e-3, 1e-3
    source = HalfSine((top,), duration, begin)
    scene = scene_of((AIR,), (Region(GAS, None),), (0.0,), (1.0,), (64,), 4e-3, (PERIODIC,), sources=(source,))
    simulation = start(scene)
    while not simulation.done:
        simulation.step()
        expected = gained(simulation.time, top, duration, begin)
        assert fields(simulation)["velocity"][..., 0] == pytest.approx(expected, rel=1e-12, abs=1e-9)
    assert simulation.fluid.share_at_rest() > 0.2


def test_gas_in_a_closed_box_is_pressed_against_a_wall():
    """Exact until waves come back: the wall is a piston with the velocity that free gas gains."""
    top, duration, walls = 2e5, 4e-4, (("wall", "wall"),)
    source = HalfSine((top,), duration, 0.0)
    scene = scene_of((AIR,), (Region(GAS, None),), (0.0,), (1.0,), (400,), 3e-4, walls, sources=(source,))
    simulation = advance(start(scene))
    pressure = fields(simulation)["pressure"].ravel()
    low, high = (1.5 * pressure[0] - 0.5 * pressure[1], 1.5 * pressure[-1] - 0.5 * pressure[-2])  # on the walls
    piston = 0.2 * gained(simulation.time, top, duration, 0.0) / SOUND
    assert high / 1e5 == pytest.approx((1.0 + piston) ** 7, rel=2e-3)
    assert low / 1e5 == pytest.approx((1.0 - piston) ** 7, rel=2e-3)


@pytest.mark.parametrize(("name", "end", "top"), [("plate_impact", 1e-6, 1e8), ("free_plate", 0.1, 5.0)])
def test_bodies_and_all_together_gain_what_is_free_gains(tmp_path, name, end, top):
    """Plates that collide, and a plate between gases that takes sub-steps: the momentum of all but the walls'."""
    duration, begin = 0.7 * end, 0.2 * end
    pulse = f'sources.table={{kind="half_sine", acceleration={top}, duration={duration}, start={begin}}}'
    words = [pulse, f"time.end={end}", f'output.directory="{tmp_path}"']
    simulation = Simulation.of(load(ROOT / f"inputs/{name}.toml", words), Communicator(), 1)

    def momentum():
        fluid, solid, coupling = simulation.fluid, simulation.solid.totals(), simulation.coupling
        mass, total = solid["mass"], solid["momentum"][0]
        if fluid:
            held, left = fluid.totals(coupling.volume)[0], fluid.left_domain()
            mass, total = mass + held[0], total + held[1] + left[1] - sum(coupling.budget_by_cause().values())[1]
        return total, mass

    first, mass = momentum()
    while not simulation.done:
        simulation.step()
        expected = gained(simulation.time, top, duration, begin)
        assert (momentum()[0] - first) / mass == pytest.approx(expected, rel=1e-12, abs=1e-12 * top * duration)
    assert name == "plate_impact" or simulation.last_step.sub_steps > 1
