"""The CUDA C of every kernel, run on the host, gives the bits of the CPU: in whole scenes, call by call."""

import pytest

from distfsi.coupling.cut_cells.kernels import (
    band,
    fluxes,
    forces,
    fractions,
    images,
    inflation,
    lone,
    merging,
    nodal_distance,
    particles,
    redistribution,
    volumes,
)
from distfsi.coupling.immersed_boundary.kernels import covering, states
from distfsi.coupling.kernels import spreading
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.solid.kernels import bonds, contact, cracks, neighbours, pairs, self_contact, walls
from launch import ROOT
from side_by_side import SideBySide

ANY_ORDER = ("fill_cells",)  # of the particles in a cell, before order_cells
# Where particles fail, as none does in these scenes: the ball of test_gpu.py that bursts reaches them.
FAILING = ("find_cracks", "cut_bonds", "spread_damage", "mark_damaged", "mark_cut", "mark_unbonded", "open_voids")
STANDING = ("node_positions", "put_distances")  # of walls that stand: those of test_obstacles.py
NOT_REACHED = (*FAILING, *STANDING, "accept_fit", "scatter_neighbours", "carry_unbonded", "keep_rates")
FORMS = {"updated_lagrangian": (contact, neighbours, pairs, walls)}
FORMS["total_lagrangian"] = (bonds, contact, cracks, self_contact, walls)
CUT_CELLS = (band, fluxes, forces, fractions, images, inflation, lone, merging, nodal_distance, particles)
CUT_CELLS += (redistribution, spreading, volumes)
SCHEMES = {"immersed_boundary": (covering, spreading, states), "cut_cells": CUT_CELLS}
SCHEMES["staircase"] = SCHEMES["cut_cells"]
OF_OTHER_SCHEMES = {"immersed_boundary": set(), "cut_cells": {"round_apertures", "round_fractions"}}
OF_OTHER_SCHEMES["staircase"] = {"absorb", "put_moved", "cover_absorbed"}  # no cell is small before it is shut
ALWAYS = {"copy_regions", "remember_peaks", "advance_tiles", "fastest_signals", "deform", "find_cells", "order_cells"}
ALWAYS |= {"find_neighbours", "apply_impulse"}

AIR = '{ eos = "ideal_gas", gamma = 1.4 }'
TNT = '{ eos = "jwl", rho0 = 1630, A = 3.712e11, B = 3.21e9, R1 = 4.15, R2 = 0.95, omega = 0.3 }'
STEEL = """density = 7830
eos = { kind = "mie_grueneisen", c0 = 4569, s1 = 1.49, gamma0 = 2.17, a = 0.46 }
strength = { kind = "perfectly_plastic", yield_stress = "1 GPa", shear_modulus = "80 GPa" }"""


def drivers_of(modules) -> set[str]:
    """The names of all drivers that the modules define."""
    functions = [function for module in modules for function in vars(module).values()]
    own = [f for f in functions if getattr(f, "__kind__", "") == "driver" and f.__module__ in map(_name, modules)]
    return {function.__name__ for function in own} - {*ANY_ORDER, *NOT_REACHED}


def _name(module) -> str:
    return module.__name__


def write_scene(path, dimensions: int, phases: dict[str, str], precision: str, scheme: str, form: str):
    """A ball of steel, fast and thick, a thin light plate and a lone particle at a wall in a box of gas: cells get
    covered, deep and fresh."""
    D = dimensions
    path.write_text(
        f"""
coupling = {{ scheme = "{scheme}"{", drop_below = 1" if scheme != "immersed_boundary" else ""} }}
domain = {{ lower = {[0] * D}, upper = {["16 mm"] * D}, cells = {[16] * D}, x = ["symmetry", "wall"] }}
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
form = "{form}"
friction = 0.3
wall_friction = 0.3
{"artificial_stress = 0.3" if D == 3 and form == "updated_lagrangian" else ""}
[solid.bodies.ball]
shape = {{ kind = "ball", center = {["8 mm"] * D}, radius = "5 mm" }}
spacing = "0.7 mm"
velocity = {[3000, 500, 250][:D]}
{STEEL}
[solid.bodies.plate]
shape = {{ kind = "box", lower = {["1.4 mm", *["2 mm"] * (D - 1)]}, upper = {["2.1 mm", *["14 mm"] * (D - 1)]} }}
spacing = "0.7 mm"
{STEEL.replace("7830", "300" if scheme != "immersed_boundary" else "7830")}
[solid.bodies.speck]
shape = {{ kind = "box", lower = {["15.3 mm", *["14 mm"] * (D - 1)]}, upper = {["16 mm", *["14.7 mm"] * (D - 1)]} }}
spacing = "0.7 mm"
velocity = {[500, 0, 0][:D]}
{STEEL}
"""
    )
    return path


def steps_side_by_side(monkeypatch, path, steps, overrides=()):
    """The kernels compared in the first steps of a scene."""
    pair = SideBySide(monkeypatch, ANY_ORDER)
    simulation = Simulation.of(load(path, overrides), Communicator(), 1)
    for _ in range(steps):
        simulation.step()
    simulation.coupling.trapped()
    assert not pair.unlike
    return pair.calls


@pytest.mark.parametrize(
    ("dimensions", "phases", "precision", "scheme", "form"),
    [
        pytest.param(1, {"air": AIR}, "float32", "immersed_boundary", "updated_lagrangian", marks=pytest.mark.full),
        (2, {"air": AIR}, "float32", "cut_cells", "total_lagrangian"),
        pytest.param(
            2, {"tnt": TNT, "air": AIR}, "float64", "immersed_boundary", "updated_lagrangian", marks=pytest.mark.full
        ),
        pytest.param(2, {"tnt": TNT, "air": AIR}, "float32", "staircase", "total_lagrangian", marks=pytest.mark.full),
        pytest.param(3, {"air": AIR}, "float64", "cut_cells", "total_lagrangian", marks=pytest.mark.full),
        pytest.param(
            3, {"tnt": TNT, "air": AIR}, "float32", "immersed_boundary", "updated_lagrangian", marks=pytest.mark.full
        ),
    ],
)
def test_a_coupled_scene_call_by_call(monkeypatch, tmp_path, dimensions, phases, precision, scheme, form):
    path = write_scene(tmp_path / "ball.toml", dimensions, phases, precision, scheme, form)
    steps = 40 if dimensions == 3 else 12  # until a cell loses its fluid
    calls = steps_side_by_side(monkeypatch, path, steps)
    assert (drivers_of((*SCHEMES[scheme], *FORMS[form])) | ALWAYS) - OF_OTHER_SCHEMES[scheme] <= set(calls)


def test_johnson_cook_call_by_call(monkeypatch):
    """The shipped scene with logarithms and powers, and artificial stress."""
    coarse = ("domain.cells=[32, 32]", "solid.bodies.tube.spacing=1 mm", "solid.artificial_stress=0.3")
    calls = steps_side_by_side(monkeypatch, ROOT / "inputs/steel_tube.toml", 4, coarse)
    assert calls["deform"] >= 5
