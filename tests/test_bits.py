"""The same bits on any number of ranks and threads, for any block and tile size; and what must not move does not."""

import numpy as np
import pytest

from distfsi.mesh.communicator import Communicator
from distfsi.output.fields import read_cells, read_particles, series
from distfsi.scene import load
from distfsi.simulation import Simulation
from launch import ROOT, run_ranks

TUBE = (
    ROOT / "inputs/steel_tube.toml",
    "--set", "domain.cells=[56, 56]",
    "--set", "domain.upper=['56 mm', '56 mm']",
    "--set", "solid.bodies.tube.spacing=0.6 mm",
    "--set", "time.maximum_steps=150",
    "--set", "output.fields_every=0",
)  # fmt: skip
BLOCKS = {"small": ("[16, 8]", "[16, 4]"), "large": ("[32, 56]", "[16, 24]")}


def final_state(directory):
    """Every field of the last cells and particles, the particles by id."""
    _, cells, *_ = read_cells(series(directory, "cells")[-1][1])
    _, particles = read_particles(series(directory, "particles")[-1][1])
    order = np.argsort(particles["id"])
    return cells | {f"particle {name}": column[order] for name, column in particles.items()}


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The tube after 150 steps on one rank and one thread, with small blocks."""
    return run_tube(tmp_path_factory.mktemp("reference"), 1, 1, "small")


def run_tube(directory, ranks, threads, blocks):
    block_cells, tile_cells = BLOCKS[blocks]
    sizes = ("--set", f"performance.block_cells={block_cells}", "--set", f"performance.tile_cells={tile_cells}")
    words = ("-m", "distfsi", "run", *TUBE, *sizes, "--threads", threads, "--set", f"output.directory={directory}")
    run_ranks(ranks, words, timeout=300.0)
    return final_state(directory)


@pytest.mark.parametrize(
    ("ranks", "threads", "blocks"), [(1, 2, "small"), (1, 1, "large"), (2, 1, "small"), (4, 1, "small"), (2, 2, "large")]
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
lower = [0, 0]
upper = [1, 1]
cells = [12, 7]
x = ["periodic", "periodic"]
y = ["wall", "outflow"]
[time]
end = 1
[fluid.phases]
{phases}
[[fluid.regions]]
phase = "first"
density = {density}
pressure = 2e7
"""


@pytest.mark.parametrize("first", [GAS, WATER, TNT])
@pytest.mark.parametrize("second", [None, GAS, WATER, TNT])
def test_a_uniform_state_at_rest_does_not_change_a_bit(tmp_path, first, second):
    """1000 steps for every pair of equations of state."""
    phases = f"first = {{{first}}}" + (f"\nsecond = {{{second}}}" if second else "")
    path = tmp_path / "rest.toml"
    path.write_text(REST.format(phases=phases, density=DENSITY[first]))
    simulation = Simulation.of(load(path), Communicator(), threads=1)
    if second:  # no trace of the second phase but a good part of it
        W = (DENSITY[first], DENSITY[second], 0.0, 0.0, 2e7, 0.3)
        simulation.fluid.state[:] = np.array(simulation.fluid.model.formula("conserved")(W))[:, None, None, None]
    before = simulation.fluid.cells(0).copy()
    for _ in range(1000):
        simulation.step()
    np.testing.assert_array_equal(simulation.fluid.cells(0), before)
