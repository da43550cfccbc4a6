"""The CUDA C of every kernel, run on the host, gives the bits of numba: in whole scenes, call by call."""

import pytest

from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from launch import ROOT
from side_by_side import SideBySide

SERIAL = ("fill_cells",)
PARTICLES = ("find_cells", "order_cells", "find_neighbours", "correct", "accelerate", "heat", "deform")
WALL = (
    "cover", "find_depth", "list_cells", "find_wall_velocity", "fill_covered", "fill_fresh", "fill_deep",
    "collect_wall", "collect_sides", "spread", "push",
)  # fmt: skip

AIR = '{ eos = "ideal_gas", gamma = 1.4 }'
TNT = '{ eos = "jwl", rho0 = 1630, A = 3.712e11, B = 3.21e9, R1 = 4.15, R2 = 0.95, omega = 0.3 }'


def write_scene(path, dimensions: int, phases: dict[str, str], precision: str):
    """A ball of steel, fast and thick, at the corner of a box of gas: cells get covered, deep and fresh."""
    D = dimensions
    path.write_text(
        f"""
domain = {{ lower = {[0] * D}, upper = {["16 mm"] * D}, cells = {[16] * D}, x = ["symmetry", "outflow"] }}
time = {{ end = "1 ms" }}
performance = {{ block_cells = {[8] * D}, tile_cells = {[8, 4, 4][:D]} }}
output = {{ peaks = true }}
[fluid]
precision = "{precision}"
{"riemann = 'adaptive'" if D > 1 else ""}
phases = {{ {", ".join(f"{name} = {eos}" for name, eos in phases.items())} }}
[[fluid.regions]]
phase = "{next(iter(phases))}"
density = 1000
pressure = "2 GPa"
[solid]
[solid.bodies.ball]
shape = {{ kind = "ball", center = {["8 mm"] * D}, radius = "5 mm" }}
spacing = "0.7 mm"
velocity = {[3000, 500, 250][:D]}
density = 7830
eos = {{ kind = "mie_grueneisen", c0 = 4569, s1 = 1.49, gamma0 = 2.17, a = 0.46 }}
strength = {{ kind = "perfectly_plastic", yield_stress = "1 GPa", shear_modulus = "80 GPa" }}
"""
    )
    return path


def steps_side_by_side(monkeypatch, path, steps, overrides=()):
    """The kernels compared in the first steps of a scene."""
    pair = SideBySide(monkeypatch, SERIAL)
    simulation = Simulation.of(load(path, overrides), Communicator(), 1)
    for _ in range(steps):
        simulation.step()
    assert not pair.unlike
    return pair.calls


@pytest.mark.parametrize(
    ("dimensions", "phases", "precision"),
    [
        (1, {"air": AIR}, "float32"),
        (2, {"tnt": TNT, "air": AIR}, "float64"),
        (2, {"air": AIR}, "float32"),
        pytest.param(3, {"air": AIR}, "float64", marks=pytest.mark.full),
        pytest.param(3, {"tnt": TNT, "air": AIR}, "float32", marks=pytest.mark.full),
    ],
)
def test_a_coupled_scene_call_by_call(monkeypatch, tmp_path, dimensions, phases, precision):
    calls = steps_side_by_side(monkeypatch, write_scene(tmp_path / "ball.toml", dimensions, phases, precision), 12)
    assert set(calls) == {*PARTICLES, *WALL, "copy_regions", "remember_peaks", "advance_tiles", "fastest_signals"}


def test_johnson_cook_call_by_call(monkeypatch):
    """The shipped scene with logarithms and powers."""
    calls = steps_side_by_side(
        monkeypatch, ROOT / "inputs/steel_tube.toml", 4, ("domain.cells=[32, 32]", "solid.bodies.tube.spacing=1 mm")
    )
    assert calls["deform"] == 5
