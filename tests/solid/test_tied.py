"""Tied bodies: bonds across bodies of different materials and spacings."""

import math

import numpy as np
import pytest

from distfsi.errors import InputError
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation

BAR = """
[domain]
lower = -2.0
upper = 2.0
cells = 40
[time]
end = 1.0
[solid]
tied = [["a", "b"]]
[solid.bodies.a]
shape = { kind = "box", lower = -1.0, upper = 0.0 }
spacing = 0.01
density = 1.0
velocity = -1e-3
eos = { kind = "linear", bulk_modulus = 1.0 }
strength = { kind = "elastic", shear_modulus = 0.3 }
[solid.bodies.b]
shape = { kind = "box", lower = 0.0, upper = 1.0 }
spacing = 0.01
density = 4.0
eos = { kind = "linear", bulk_modulus = 2.0 }
strength = { kind = "elastic", shear_modulus = 0.6 }
"""


def pulled(tmp_path, *changes):
    """Two halves of a bar, the left of which leaves: when waves have gone 0.5, the velocities near the tie."""
    (tmp_path / "bar.toml").write_text(BAR)
    simulation = Simulation.of(load(tmp_path / "bar.toml", changes), Communicator(), 1)
    end = 0.5 / math.sqrt(1.4)  # of the faster wave
    start = simulation.solid.totals()
    while simulation.time < end:
        simulation.step()
    totals, c = simulation.solid.totals(), simulation.solid.columns
    assert totals["momentum"] == pytest.approx(start["momentum"], rel=1e-12)
    energy, before = (each["kinetic"] + each["internal"] for each in (totals, start))
    assert energy == pytest.approx(before, rel=1e-10)
    near = np.abs(c["position"][:, 0]) < 0.15
    return c["velocity"][near, 0], simulation


@pytest.mark.parametrize("spacing", [0.01, 0.02], ids=["equal", "2:1"])
def test_a_bar_of_two_materials_carries_a_wave_across_the_tie(tmp_path, spacing):
    """In tension, which no contact carries: the velocity behind both waves is that of their impedances."""
    velocity, simulation = pulled(tmp_path, f"solid.bodies.b.spacing={spacing}")
    impedance = [math.sqrt(1.0 * 1.4), math.sqrt(4.0 * 2.8)]
    exact = -1e-3 * impedance[0] / sum(impedance)
    assert np.mean(velocity) == pytest.approx(exact, rel=1e-2)
    assert simulation.solid.pieces()["piece"].size == 1


def test_unequal_spacings_reflect_next_to_nothing(tmp_path):
    """One material, spacings 2:1."""
    same = ("density=1.0", "eos.bulk_modulus=1.0", "strength.shear_modulus=0.3", "spacing=0.02")
    velocity, _ = pulled(tmp_path, *(f"solid.bodies.b.{change}" for change in same))
    assert np.abs(np.mean(velocity) + 0.5e-3) < 1e-2 * 0.5e-3


def test_bodies_that_are_not_tied_part(tmp_path):
    velocity, simulation = pulled(tmp_path, "solid.tied=[]")
    assert np.ptp(velocity) > 0.99e-3 and simulation.solid.pieces()["piece"].size == 2


PLATE = """
[domain]
lower = [-1.0, -1.0]
upper = [1.0, 1.0]
cells = [10, 10]
[time]
end = 1.0
"""
LAYER = """
[solid.bodies.NAME]
shape = { kind = "box", lower = [-0.3, LOWER], upper = [0.3, UPPER] }
spacing = 0.05
density = 1.0
eos = { kind = "linear", bulk_modulus = 1.0 }
strength = { kind = "elastic", shear_modulus = 0.5 }
"""


def layer(name, lower, upper):
    return LAYER.replace("NAME", name).replace("LOWER", str(lower)).replace("UPPER", str(upper))


def test_two_tied_layers_bend_as_the_plate_that_they_make(tmp_path):
    """A plate that is bent, of one body and of two: the same but for the order of sums."""
    moved = []
    for text in (
        layer("whole", -0.1, 0.1),
        '[solid]\ntied = [["low", "high"]]' + layer("low", -0.1, 0.0) + layer("high", 0.0, 0.1),
    ):
        (tmp_path / "plate.toml").write_text(PLATE + text)
        simulation = Simulation.of(load(tmp_path / "plate.toml"), Communicator(), 1)
        c = simulation.solid.columns
        c["velocity"][:, 1] = 0.05 * np.cos(math.pi * c["position"][:, 0] / 0.3)
        for _ in range(40):
            simulation.step()
        order = np.lexsort(c["reference"].round(9).T)
        moved.append((c["position"] - c["reference"])[order])
    assert np.abs(moved[0]).max() > 1e-3
    assert np.abs(moved[0] - moved[1]).max() < 1e-12


TEE = """
[domain]
lower = [-70.0, -10.0, -10.0]
upper = [70.0, 10.0, 20.0]
cells = [14, 2, 3]
[time]
end = 1e6
[solid]
tied = [["flange", "web"]]
[solid.bodies.flange]
shape = { kind = "box", lower = [-60.0, -4.0, 0.0], upper = [60.0, 4.0, 2.0] }
spacing = 1.0
density = 1.0
eos = { kind = "linear", bulk_modulus = 0.6667 }
strength = { kind = "elastic", shear_modulus = 0.4 }
[solid.bodies.web]
shape = { kind = "box", lower = [-60.0, -1.0, 2.0], upper = [60.0, 1.0, 8.0] }
spacing = 1.0
density = 1.0
eos = { kind = "linear", bulk_modulus = 0.6667 }
strength = { kind = "elastic", shear_modulus = 0.4 }
"""


def free_beam(length, area, moment, shear_area, elements=100):
    """Lowest frequency [rad/s] of a free beam of Young's modulus 1, shear modulus 0.4 and density 1 (Timoshenko), and
    its deflection at the nodes: linear elements, shear taken at their middles."""
    h, n = length / elements, 2 * (elements + 1)
    stiffness, mass = np.zeros((n, n)), np.zeros((n, n))
    slope, turn = np.array([-1.0, 0.0, 1.0, 0.0]) / h, np.array([0.0, 0.5, 0.0, 0.5])
    bend = np.array([0.0, -1.0, 0.0, 1.0]) / h
    shear = slope - turn
    part = h * (moment * np.outer(bend, bend) + 0.4 * shear_area * np.outer(shear, shear))
    for k in range(elements):
        rows = slice(2 * k, 2 * k + 4)
        stiffness[rows, rows] += part
        mass[rows, rows] += 0.5 * h * np.diag([area, moment, area, moment])
    root = 1.0 / np.sqrt(np.diag(mass))
    squares, modes = np.linalg.eigh(root[:, None] * stiffness * root)
    return math.sqrt(squares[2]), (root * modes[:, 2])[::2]


@pytest.mark.full
def test_a_stiffener_that_is_tied_to_its_plate_bends_with_it_as_a_tee(tmp_path):
    """The lowest frequency of a free beam: a quarter of its period, until the velocity with its shape is gone."""
    (tmp_path / "tee.toml").write_text(TEE)
    simulation = Simulation.of(load(tmp_path / "tee.toml"), Communicator(), 1)
    flange, web, middle = 16.0, 12.0, (16.0 * 1.0 + 12.0 * 5.0) / 28.0
    moment = 8 * 2**3 / 12 + flange * (middle - 1.0) ** 2 + 2 * 6**3 / 12 + web * (5.0 - middle) ** 2
    rate, shape = free_beam(120.0, 28.0, moment, web)
    c = simulation.solid.columns
    x = c["position"][:, 0].copy()
    along = np.interp(x, np.linspace(-60.0, 60.0, len(shape)), shape)
    tilt = np.interp(x, np.linspace(-60.0, 60.0, len(shape)), np.gradient(shape, 120.0 / (len(shape) - 1)))
    size = 1e-4 / np.abs(along).max()
    c["velocity"][:, 2] = size * along
    c["velocity"][:, 0] = -size * tilt * (c["position"][:, 2] - middle)
    c.changed("velocity")
    times, speeds = [], []
    while not speeds or speeds[-1] > 0.0:
        simulation.step()
        times.append(simulation.time)
        speeds.append(float((simulation.solid.columns["velocity"][:, 2] * along).sum()))
    crossing = np.interp(0.0, [-speeds[-2], -speeds[-1]], times[-2:])
    assert 0.5 * math.pi / crossing == pytest.approx(rate, rel=0.03)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('solid.tied=[["a", "c"]]', "'c' is no body; expected one of 'a', 'b'"),
        ('solid.tied=[["a"]]', "two bodies or more"),
        ("solid.bodies.b.form=updated_lagrangian", "need one form"),
    ],
)
def test_faults_of_ties_are_told(tmp_path, change, words):
    (tmp_path / "bar.toml").write_text(BAR)
    with pytest.raises(InputError) as caught:
        load(tmp_path / "bar.toml", [change])
    assert words in str(caught.value) and "solid.tied.0" in str(caught.value)
