"""The same bits on any number of ranks and threads, for any block and tile size; and what must not move does not."""

import numpy as np
import pytest

from distfsi.mesh.communicator import Communicator
from distfsi.output.fields import read_cells, read_particles, series
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.step import TimeStep
from launch import ROOT, run_ranks

SETTINGS = (
    "domain.cells=[40, 40]",
    "domain.upper=['40 mm', '40 mm']",
    "solid.bodies.tube.spacing=0.6 mm",
    "fluid.riemann=adaptive",  # the flux that looks farthest
    "time.maximum_steps=60",
    "output.fields_every=0",
)
TUBE = (ROOT / "inputs/steel_tube.toml", *(word for setting in SETTINGS for word in ("--set", setting)))
BLOCKS = {"small": ("[16, 8]", "[16, 4]"), "large": ("[32, 40]", "[16, 24]")}


def final_state(directory):
    """Every field of the last cells and particles, the particles by id."""
    _, cells, *_ = read_cells(series(directory, "cells")[-1][1])
    _, particles = read_particles(series(directory, "particles")[-1][1])
    order = np.argsort(particles["id"])
    return cells | {f"particle {name}": column[order] for name, column in particles.items()}


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The tube after 60 steps on one rank and one thread, with small blocks."""
    return run_tube(tmp_path_factory.mktemp("reference"), 1, 1, "small")


def run_tube(directory, ranks, threads, blocks):
    block_cells, tile_cells = BLOCKS[blocks]
    sizes = ("--set", f"performance.block_cells={block_cells}", "--set", f"performance.tile_cells={tile_cells}")
    words = ("-m", "distfsi", "run", *TUBE, *sizes, "--threads", threads, "--set", f"output.directory={directory}")
    run_ranks(ranks, words, timeout=300.0)
    return final_state(directory)


@pytest.mark.parametrize(
    ("ranks", "threads", "blocks"),
    [
        (1, 2, "small"),
        (1, 1, "large"),
        (2, 1, "small"),
        pytest.param(4, 1, "small", marks=pytest.mark.full),
        pytest.param(2, 2, "large", marks=pytest.mark.full),
    ],
)
def test_coupled_run_has_the_same_bits(reference, tmp_path, ranks, threads, blocks):
    """A tube wall that moves across rank borders: cells and particles agree to the last bit."""
    state = run_tube(tmp_path, ranks, threads, blocks)
    assert state.keys() == reference.keys()
    for name, values in reference.items():
        np.testing.assert_array_equal(state[name], values, err_msg=name)


GAS = 'eos="ideal_gas", gamma=1.4'
WATER = 'eos="stiffened_gas", gamma=4.4, p_inf=6e8'
TNT = 'eos="jwl", rho0=1630, A=3.712e11, B=3.21e9, R1=4.15, R2=0.95, omega=0.3'
DENSITY = {GAS: 1.2, WATER: 1000.0, TNT: 100.0}
REST = """
title = "a uniform state at rest"
[domain]
lower = {lower}
upper = {upper}
cells = {cells}
x = ["wall", "outflow"]
[time]
end = 1
[fluid.phases]
{phases}
[[fluid.regions]]
phase = "first"
density = {density}
pressure = 2e7
"""


def rest(tmp_path, first, second, cells):
    """State before and after 1000 steps at rest, with 30 % of the first material where there are two."""
    phases = f"first = {{{first}}}" + (f"\nsecond = {{{second}}}" if second else "")
    path, D = tmp_path / "rest.toml", len(cells)
    path.write_text(REST.format(phases=phases, density=DENSITY[first], lower=[0] * D, upper=[1] * D, cells=cells))
    simulation = Simulation.of(load(path), Communicator(), threads=1)
    if second:
        W = (DENSITY[first], DENSITY[second], *[0.0] * D, 2e7, 0.3)
        simulation.fluid.state[:] = np.array(simulation.fluid.model.formula("conserved")(W))[:, None, None, None]
    before = simulation.fluid.cells(0).copy()
    for _ in range(1000):
        simulation.step()
    return before, simulation.fluid.cells(0)


@pytest.mark.full  # the stage itself is held to this for every pair in test_formulas.py
@pytest.mark.parametrize("first", [GAS, WATER, TNT], ids=["gas", "water", "tnt"])
@pytest.mark.parametrize("second", [None, GAS, WATER, TNT], ids=["alone", "gas", "water", "tnt"])
def test_a_uniform_state_at_rest_does_not_change_a_bit(tmp_path, first, second):
    """1000 steps for every pair of equations of state."""
    np.testing.assert_array_equal(*rest(tmp_path, first, second, [12]))


def test_a_uniform_state_at_rest_in_two_dimensions(tmp_path):
    """The same in 2D, between walls and outflows."""
    np.testing.assert_array_equal(*rest(tmp_path, TNT, WATER, [12, 7]))


SOD = """
title = "a shock tube along one axis"
[domain]
lower = {lower}
upper = {upper}
cells = {cells}
[time]
end = 0.2
maximum_steps = 20
[fluid.phases]
gas = {{eos="ideal_gas", gamma=1.4}}
[[fluid.regions]]
phase = "gas"
density = 0.125
pressure = 0.1
[[fluid.regions]]
phase = "gas"
density = 1
pressure = 1
shape = {{ kind="half_space", point={point}, normal={normal} }}
[performance]
block_cells = {blocks}
tile_cells = {tiles}
"""


def shock_tube(tmp_path, dimensions, axis):
    """Density, normal velocity and pressure along a tube that lies along `axis`, after 20 steps."""

    def pick(along, across):
        return [along if d == axis else across for d in range(dimensions)]

    text = SOD.format(
        lower=[0.0] * dimensions,
        upper=pick(1.0, 0.09375),
        cells=pick(64, 6),
        point=pick(0.5, 0.0),
        normal=pick(1.0, 0.0),
        blocks=pick(24, 4),
        tiles=pick(16, 4),
    )
    path = tmp_path / f"sod{dimensions}{axis}.toml"
    path.write_text(text)
    simulation = Simulation.of(load(path), Communicator(), threads=1)
    simulation.time_step = lambda: TimeStep(2e-3)  # one step size for all: the CFL number adds up over axes
    while not simulation.done:
        simulation.step()
    fields, blocks = simulation.fluid.outputs(), simulation.blocks
    line = np.zeros((3, 64))
    for block in range(blocks.local_count):
        start, count = blocks.origin[block][axis], blocks.extent[block][axis]
        at = tuple(slice(0, count) if a == axis else 0 for a in (2, 1, 0))
        line[0, start : start + count] = fields["density"][block][at]
        line[1, start : start + count] = fields["velocity"][block][..., axis][at]
        line[2, start : start + count] = fields["pressure"][block][at]
    return line


@pytest.mark.parametrize(("dimensions", "axis"), [(2, 1), (3, 0), (3, 1), (3, 2)])
def test_a_shock_tube_is_the_same_along_every_axis(tmp_path, dimensions, axis):
    """Direction and number of dimensions are parameters: a tube along any axis has the bits of the 1-D tube."""
    np.testing.assert_array_equal(shock_tube(tmp_path, dimensions, axis), shock_tube(tmp_path, 1, 0))
