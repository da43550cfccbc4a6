"""Bars in bodies, against closed forms: their bond, waves in them, momentum and energy."""

import math
from copy import deepcopy

import numpy as np
import pytest

from distfsi.errors import InputError
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.bar_lines import Line, lines_of
from distfsi.scene.bars import Bars, Bond
from distfsi.simulation import Simulation
from distfsi.solid.bars import BarNetwork, Nodes, assemble, bond_stress

BOND = Bond(13.7e6, (1e-3, 2e-3, 5e-3), 0.4, 0.4)
STEEL = Bars(0.012, 0.1, 0.03, (0,), "high", 7850.0, 200e9, 500e6, 1e9, 0.1, BOND, 0.01)
BEAM = """
[domain]
lower = [0.0, 0.0]
upper = [1.0, 1.0]
cells = [8, 8]
[time]
end = 1.0
[solid.bodies.beam]
shape = { kind = "box", lower = [0.2, 0.4], upper = [0.8, 0.6] }
spacing = 0.025
density = 2400.0
eos = { kind = "linear", bulk_modulus = 17e9 }
strength = { kind = "elastic", shear_modulus = 12e9 }
[solid.bodies.beam.bars]
diameter = 0.02
spacing = 0.1
cover = 0.04
directions = ["x"]
yield_stress = 500e6
bond = { strength = 13.7e6 }
"""


def simulation_of(tmp_path, text, *changes):
    (tmp_path / "scene.toml").write_text(text)
    return Simulation.of(load(tmp_path / "scene.toml", changes), Communicator(), 1)


def straight(length, count, law):
    """A bar along x in a block that stands, a point of it at each node."""
    nodes = np.column_stack([np.linspace(0.0, length, count + 1), np.zeros(count + 1)])
    line = Line(nodes, 1.0, np.zeros(nodes.shape, dtype=bool))
    parts = assemble([(0, 0, line)], [law], False, np.zeros((1, 2)))
    around = np.arange(count + 1)[:, None]
    tied = Nodes(**parts, tied=np.arange(count + 1), around=around, weight=np.ones(around.shape))
    return BarNetwork(tied, [law], np.full(count + 1, 1e6)), nodes.copy()


def pulled(bar, block, speed, slip):
    """The force at the last node, which is pulled slowly until it has slipped by `slip`; what swings is damped."""
    dt, nodes = bar.longest, bar.nodes
    still = np.zeros_like(block)
    while nodes.position[-1, 0] - block[-1, 0] < slip:
        bar.find_forces(block)
        bar.kick(dt, still, np.zeros(2))
        nodes.velocity *= 0.995
        nodes.velocity[-1] = speed, 0.0
        bar.go(dt)
    bar.find_forces(block)
    return -bar._force[-1, 0]


# ---- the bond --------------------------------------------------------------------------------------------------------


def test_a_short_bar_is_pulled_out_with_the_stress_of_its_bond():
    """As it hardly stretches, its force is stress times surface, before and behind the peak."""
    surface = math.pi * 0.012 * 0.02
    for slip, factor in ((0.5e-3, 0.5**0.4), (4e-3, 1.0 - 0.6 * 2.0 / 3.0)):
        bar, block = straight(0.02, 4, STEEL)
        force = pulled(bar, block, 0.5, slip)
        assert force == pytest.approx(surface * 13.7e6 * factor, rel=0.02)


def test_a_long_bar_is_pulled_with_the_force_that_the_energy_of_its_bond_tells():
    """At the loaded end of a bar that is longer than it slips: sigma^2/(2 E) = (4/d) times the integral of the bond's
    stress over the slip."""
    bar, block = straight(0.6, 120, STEEL)
    slip = 0.2e-3
    force = pulled(bar, block, 0.2, slip)
    energy = 13.7e6 * 1e-3 * (slip / 1e-3) ** 1.4 / 1.4
    assert force == pytest.approx(STEEL.section * math.sqrt(8.0 * 200e9 * energy / 0.012), rel=0.02)


def test_a_bond_remembers_how_far_it_has_slipped():
    stress = bond_stress(BOND, np.array([0.0, 5e-6, 1e-5, 1e-3, 2e-3, 5e-3, 1.0]))
    assert stress == pytest.approx(13.7e6 * np.array([0.0, 0.5 * 0.01**0.4, 0.01**0.4, 1.0, 1.0, 0.4, 0.4]))


# ---- bars ------------------------------------------------------------------------------------------------------------


def test_a_wave_in_a_bar_goes_with_the_speed_of_sound_of_bars():
    """A bar without bond runs into a wall with 10 m/s: stress rho c v behind the wave, which has gone c t."""
    law = Bars(**{**vars(STEEL), "bond": Bond(1e-6, (1e-3, 2e-3, 5e-3), 0.4, 0.4), "yield_stress": 1e12})
    bar, block = straight(1.0, 800, law)
    bar.nodes.velocity[:, 0] = -10.0
    bar.nodes.velocity[0] = 0.0
    bar.nodes.held[0] = True
    c, time, before = math.sqrt(200e9 / 7850.0), 0.0, bar.kinetic
    while time < 0.5 / c:
        bar.find_forces(block)
        bar.kick(bar.longest, np.zeros_like(block), np.zeros(2))
        bar.go(bar.longest)
        time += bar.longest
    x = 0.5 * (bar.nodes.position[1:] + bar.nodes.position[:-1])[:, 0]
    assert bar.stress[x < 0.4].mean() == pytest.approx(-7850.0 * c * 10.0, rel=0.01)
    front = x[np.flatnonzero(bar.stress < -0.5 * 7850.0 * c * 10.0)[-1]]
    assert front == pytest.approx((c - 10.0) * time, rel=0.01)
    assert bar.kinetic + bar.internal == pytest.approx(before, rel=1e-10)


def test_a_bar_yields_and_is_torn():
    """One element, pulled: its work is that of yield stress and hardening up to the failure strain."""
    law = Bars(**{**vars(STEEL), "bond": None})
    bar, _ = straight(0.01, 1, law)
    bar.nodes.position[1, 0] = 0.01 * (1.0 + 0.0525 + 550e6 / 200e9)
    bar.find_forces(bar.nodes.position.copy())
    assert bar.strained[0] == pytest.approx(0.0525, rel=0.01) and not bar.torn[0]
    assert bar.stress[0] == pytest.approx(500e6 + 1e9 * bar.strained[0], rel=1e-9)
    bar.nodes.position[1, 0] = 0.0115
    bar.find_forces(bar.nodes.position.copy())
    assert bar.torn[0] and bar.stress[0] == 0.0


# ---- in bodies -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bond", ["slips", "holds"])
def test_momentum_and_energy_are_kept_and_bars_bear_their_part(tmp_path, bond):
    """A beam whose halves fly apart: what it bears in bars and concrete."""
    text = BEAM if bond == "slips" else BEAM.replace("bond = { strength = 13.7e6 }\n", "")
    simulation = simulation_of(tmp_path, text)
    solid = simulation.solid
    c = solid.columns
    c["velocity"][:] = 5.0 * (c["position"] - [0.5, 0.5]) + [1.0, 2.0]
    c.changed("velocity")
    start = solid.totals()
    for _ in range(200):
        simulation.step()
    now = solid.totals()
    scale = start["mass"] * 5.0
    assert now["momentum"] == pytest.approx(start["momentum"], abs=1e-10 * scale)
    assert solid.boundary_impulse() == pytest.approx([0.0, 0.0], abs=1e-10 * scale)
    assert now["kinetic"] + now["internal"] == pytest.approx(start["kinetic"] + start["internal"], rel=1e-10)
    mass = 2400.0 * 0.6 * 0.2 + 7850.0 * math.pi / 4.0 * 0.02**2 / 0.1 * 0.52
    assert start["mass"] == pytest.approx(mass, rel=1e-12)
    found = solid.reported()
    assert found["bars internal energy [J/m]"] > 0.0 and found["bars torn"] == 0.0
    assert (found["bars slip [m]"] > 1e-7) == (bond == "slips")


def test_bars_hold_a_beam_that_is_cut(tmp_path):
    """Its halves fly apart and it cracks in the middle; the bars stop them."""
    failure = '\nfailure = { kind = "principal_stress", tensile_strength = 2e6, fracture_energy = 1.0 }'
    cut = BEAM.replace("shear_modulus = 12e9 }", "shear_modulus = 12e9 }" + failure)
    gaps = []
    for text in (cut, cut[: cut.index("[solid.bodies.beam.bars]")]):
        simulation = simulation_of(tmp_path, text, "solid.bodies.beam.spacing=0.05")
        c = simulation.solid.columns
        right = c["position"][:, 0] > 0.5
        c["velocity"][:, 0] = np.where(right, 0.3, -0.3)
        c.changed("velocity")
        while simulation.time < 1.5e-3:
            simulation.step()
        right = c["reference"][:, 0] > 0.5
        gaps.append(c["position"][right, 0].mean() - c["position"][~right, 0].mean() - 0.3)
    assert gaps[1] > 7e-4 and gaps[0] < 0.3 * gaps[1], gaps


def test_a_restart_goes_on_to_the_same_bits(tmp_path):
    runs = []
    for _ in range(2):
        simulation = simulation_of(tmp_path, BEAM)
        c = simulation.solid.columns
        c["velocity"][:, 0] = 5.0 * (c["position"][:, 0] - 0.5)
        c.changed("velocity")
        runs.append(simulation)
    one, other = runs
    for _ in range(20):
        one.step()
    snapshots = {name: deepcopy(part.snapshot()) for name, part in one.kept().items()}
    for name, part in other.kept().items():
        part.restore(snapshots[name])
    for _ in range(20):
        one.step()
        other.step()
    first, second = (c["position"][np.argsort(c["id"])] for c in (one.solid.columns, other.solid.columns))
    assert np.array_equal(first, second)
    assert one.solid.reported() == other.solid.reported()


def test_a_grid_of_bars_lies_where_its_table_says(tmp_path):
    """In a quarter of a slab: bars along x and y, 0.1 apart, those in symmetry planes with half of their section."""
    ends = 'x = ["symmetry", "outflow"]\ny = ["symmetry", "outflow"]\n'
    slab = {"[0.0, 0.0]": "[0.0, 0.0, 0.0]", "[1.0, 1.0]": "[1.0, 1.0, 1.0]", "[8, 8]": "[8, 8, 8]", "0.025": "0.1"}
    slab |= {"[0.2, 0.4]": "[-0.5, -0.5, 0.4]", "[0.8, 0.6]": "[0.5, 0.5, 0.6]", '["x"]': '["x", "y"]'}
    slab |= {"cells": ends + "cells", "cover = 0.04": "cover = 0.06"}
    text = BEAM
    for given, other in slab.items():
        text = text.replace(given, other)
    (tmp_path / "scene.toml").write_text(text)
    scene = load(tmp_path / "scene.toml")
    body = scene.solid.bodies[0]
    lines = lines_of(body, body.bars, scene.domain)
    assert len(lines) == 2 * 5 and sorted(line.share for line in lines)[:3] == [0.5, 0.5, 1.0]
    along_x = [line.nodes for line in lines[:5]]
    assert [nodes[0, 1] for nodes in along_x] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert along_x[1][0] == pytest.approx([0.0, 0.1, 0.54]) and along_x[1][-1] == pytest.approx([0.44, 0.1, 0.54])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (('solid.bodies.beam.bars.directions=["z"]',), "there is no z"),
        (("solid.bodies.beam.bars.cover=0.2",), "no bar fits"),
        (("solid.bodies.beam.bars.bond.slips=[2e-3, 1e-3, 5e-3]",), "must grow"),
    ],
)
def test_faults_are_told(tmp_path, changes, words):
    with pytest.raises(InputError, match=words):
        simulation_of(tmp_path, BEAM, *changes)
