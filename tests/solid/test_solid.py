"""The solid as a whole: impact, conservation, symmetry, and the same bits on any number of ranks and threads."""

import math
from dataclasses import replace

import numpy as np
import pytest

from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.laws.solid.strength.none import NoStrength
from distfsi.laws.sources.gravity import Gravity
from distfsi.scene.description import Ball, Box, HalfSpace, Tube
from distfsi.study.stability_solid import pieces
from launch import run_ranks
from mpi_solid import COPPER_EOS, SOFT, SOFT_EOS, body, solid, step


def energy(part):
    totals = part.totals()
    return totals["kinetic"] + totals["internal"]


def test_copper_plates_reach_the_hugoniot():
    length, spacing = 0.01, 5e-5
    left = body(Box((-length,), (0.0,)), spacing, 8930.0, (250.0,), COPPER_EOS, NoStrength())
    right = body(Box((0.0,), (length,)), spacing, 8930.0, (-250.0,), COPPER_EOS, NoStrength())
    part = solid([left, right], (-0.02,), (0.02,))
    before, time = energy(part), 0.0
    while time < 0.7 * length / 4312.0:
        time += step(part)[0]
    c = part.columns
    x = c["position"][:, 0]
    plateau = (np.abs(x) > 0.1 * length) & (np.abs(x) < 0.4 * length)
    assert c["pressure"][plateau].mean() == pytest.approx(9.627e9, rel=2e-3)
    assert c["density"][plateau].mean() / 8930.0 == pytest.approx(1.0615, rel=1e-3)
    settled = (np.abs(x) > 0.3 * length) & (np.abs(x) < 0.45 * length)  # away from the heated wall
    assert c["energy"][settled].mean() == pytest.approx(0.5 * 250.0**2, rel=0.02)
    assert energy(part) == pytest.approx(before, rel=1e-12)
    assert np.abs(part.totals()["momentum"]).max() < 1e-12 * 8930.0 * length * 250.0


@pytest.mark.parametrize(
    ("dimensions", "spacing", "steps", "share"), [(1, 0.02, 100, 0.0), (2, 0.04, 60, 0.0), (3, 0.08, 24, 0.3)]
)
def test_a_free_collision_conserves_mass_momentum_and_energy(dimensions, spacing, steps, share):
    here, there = (-0.3, 0.1, 0.1)[:dimensions], (0.3, 0.0, 0.0)[:dimensions]
    left = body(Ball(here, 0.29), spacing, 8930.0, (500.0, 50.0, -80.0)[:dimensions])
    right = body(Ball(there, 0.29), spacing, 2000.0, (-700.0, 0.0, 0.0)[:dimensions], SOFT_EOS, SOFT)
    part = solid([left, right], (-1.0,) * dimensions, (1.0,) * dimensions, artificial_stress=share)
    before = part.totals()
    scale = np.abs(part.columns["mass"][:, None] * part.columns["velocity"]).sum()
    for _ in range(steps):
        step(part)
    after = part.totals()
    assert after["internal"] > 0.05 * before["kinetic"]
    assert part.columns["plastic_strain"].max() > 0.01
    assert after["mass"] == pytest.approx(before["mass"], rel=1e-14)
    assert after["kinetic"] + after["internal"] == pytest.approx(before["kinetic"], rel=1e-12)
    assert np.abs(after["momentum"] - before["momentum"]).max() < 1e-12 * scale
    assert np.abs(part.boundary_impulse()).max() < 1e-12 * scale


def test_impulses_clamps_planes_and_gravity_close_the_balances():
    clamp = HalfSpace((-0.8, 0.0), (1.0, 0.0))
    beam = body(Box((-1.0, 0.0), (0.5, 0.3)), 0.05, 2000.0, (0.0, 0.0), SOFT_EOS, SOFT, clamp)
    part = solid([beam], (-1.0, 0.0), (1.0, 1.0), symmetric=(1,), sources=(Gravity((300.0, -500.0)),))
    given, work = np.zeros(2), 0.0

    def impulse(c):
        return c["mass"][:, None] * np.stack([np.sin(9.0 * c["position"][:, 1]), c["position"][:, 0]], axis=1)

    for _ in range(50):
        given += impulse(part.columns).sum(axis=0)
        work += step(part, impulse)[1]
    scale = np.abs(given).sum()
    fixed = part.columns["fixed"]
    assert 0 < fixed.sum() < len(fixed)
    assert np.all(part.columns["velocity"][fixed] == 0.0)
    assert np.abs(part.totals()["momentum"]).max() > 0.01 * scale
    assert np.allclose(part.totals()["momentum"], given + part.boundary_impulse(), rtol=0.0, atol=1e-12 * scale)
    assert energy(part) == pytest.approx(work + part.gravity_work(), rel=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.3])
@pytest.mark.parametrize(("dimensions", "spacing", "steps"), [(2, 0.05, 950), (3, 0.1, 150)])
def test_a_spinning_body_keeps_turning(dimensions, spacing, steps, share):
    """Half a turn (2D): angular momentum is kept, and the stress stays that of the centrifugal force."""
    ball = body(Ball((0.0,) * dimensions, 0.5), spacing, 1000.0, (0.0,) * dimensions, LinearEos(3.25e6), Elastic(0.7e6))
    part = solid([ball], (-1.0,) * dimensions, (1.0,) * dimensions, artificial_stress=share)
    rate, turned = 20.0, 0.0
    x = part.columns["position"]
    part.columns["velocity"][:, :2] = rate * np.stack([-x[:, 1], x[:, 0]], axis=1)

    def angular_momentum():
        x, v = part.columns["position"], part.columns["velocity"]
        return (part.columns["mass"] * (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])).sum()

    before = angular_momentum()
    for _ in range(steps):
        turned += rate * step(part)[0]
    assert turned > (math.pi if dimensions == 2 else 1.0)
    assert angular_momentum() == pytest.approx(before, rel=1e-12)
    assert part.outputs()["von_mises"].max() < 0.5 * 1000.0 * (rate * 0.5) ** 2
    assert np.hypot(*part.columns["position"].T[:2]).max() < 0.52


def clumped(dimensions, spacing, steps, tension, share):
    """How far [spacings] particles go, pushed by 1 cm/s at random, in a lattice with fixed sides under the mean strain
    `tension`, without viscosity; and by how much its energy grows, over that of this motion."""
    box = body(
        Box((-0.5,) * dimensions, (0.5,) * dimensions), spacing, 1000.0, (0.0,) * dimensions, SOFT_EOS, Elastic(0.7e9)
    )
    part = solid([box], (-1.0,) * dimensions, (1.0,) * dimensions, viscosity=(0.0, 0.0), artificial_stress=share)
    c = part.columns
    start = c["position"].copy()
    c["fixed"] = (np.abs(start) > 0.5 - 2.7 * spacing).any(axis=1)
    c["density"], c["pressure"] = c["density"] * (1.0 - tension), np.full(len(start), -SOFT_EOS.bulk_modulus * tension)
    pushes = np.random.default_rng(1).standard_normal(start.shape)
    c["velocity"] = np.where(c["fixed"][:, None], 0.0, 0.01 * pushes)
    before, kinetic = energy(part), part.totals()["kinetic"]
    for _ in range(steps):
        step(part)
    return np.abs(part.columns["position"] - start).max() / spacing, (energy(part) - before) / kinetic


@pytest.mark.parametrize(("dimensions", "spacing", "steps", "tension"), [(2, 0.05, 200, 0.02), (3, 0.1, 150, 0.05)])
def test_artificial_stress_keeps_a_stretched_lattice_from_clumping(dimensions, spacing, steps, tension):
    (free, _), (held, gained) = (clumped(dimensions, spacing, steps, tension, share) for share in (0.0, 0.3))
    assert held < 1e-3
    assert free > 100.0 * held
    assert abs(gained) < 1e-8  # of a motion that is a tiny part of the energy


RUBBER_SPACING = 0.2


def rubber_rings(share, time):
    """A quarter of two rubber rings, five particles across, that meet (Gray, Monaghan & Swift 2001), after sound has
    gone so far as `time` [m]; and its energy over that at the start."""
    E, poisson, density = 1e7, 0.3975, 1010.0
    K, G = E / 3.0 / (1.0 - 2.0 * poisson), E / 2.0 / (1.0 + poisson)
    sound, tube = math.sqrt(K / density), Tube((4.1, 0.0), 3.0, 4.0)
    ring = body(tube, RUBBER_SPACING, density, (-0.059 * sound, 0.0), LinearEos(K), Elastic(G))
    box = (0.0, 0.0), (16.0, 16.0), (0, 1)
    part = solid([replace(ring, packing="lattice")], *box, block_cells=16, artificial_stress=share)
    before, now = energy(part), 0.0
    while now < time / sound:
        now += step(part)[0]
    return part, energy(part) / before


@pytest.mark.full
def test_rubber_rings_collide_and_part_whole():
    """Contact of surfaces tears nothing out of them; with artificial stress they part sooner."""
    (without, _), (part, kept) = (rubber_rings(share, 200.0) for share in (0.0, 0.3))
    for rings in (without, part):
        assert pieces(rings.columns["position"], np.ones(2), RUBBER_SPACING) == 1
    closest, far = (rings.columns["position"][:, 0].min() for rings in (without, part))
    assert far > max(2.0 * RUBBER_SPACING, closest)  # from the middle: the rings have parted
    assert part.totals()["momentum"][0] > 0.0
    assert kept == pytest.approx(1.0, rel=1e-10)


def ringing_disc(lower, symmetric):
    """Columns, in the order of x and y, of a disc that was pulled apart along x and squeezed along y at once."""
    disc = body(Ball((0.0, 0.0), 0.5), 0.05, 8930.0, (0.0, 0.0))
    part = solid([disc], lower, (1.0, 1.0), symmetric)
    step(part, lambda c: c["mass"][:, None] * c["position"] * np.array([600.0, -500.0]))
    for _ in range(40):
        step(part)
    c = part.columns
    quarter = np.all(c["position"] > 0.0, axis=1)
    order = np.lexsort(np.round(c["position"][quarter].T, 6))
    return {name: column[quarter][order] for name, column in c.items()}


def test_a_quarter_with_symmetry_planes_is_a_quarter_of_the_whole():
    whole = ringing_disc((-1.0, -1.0), ())
    quarter = ringing_disc((0.0, 0.0), (0, 1))
    assert len(whole["id"]) == len(quarter["id"]) > 70
    assert whole["plastic_strain"].max() > 1e-3
    for name in set(whole) - {"id"}:
        size = np.abs(whole[name]).max()
        assert np.allclose(whole[name], quarter[name], rtol=0.0, atol=1e-10 * size), name


def test_an_elastic_wave_travels_with_the_longitudinal_speed():
    K, G, density, spacing = 3.25e9, 0.7e9, 1000.0, 0.005
    bar = body(Box((0.0,), (1.0,)), spacing, density, (0.0,), LinearEos(K), Elastic(G))
    part = solid([bar], (-1.0,), (2.0,), viscosity=(0.0, 0.0))
    speed = math.sqrt((K + 4.0 / 3.0 * G) / density)
    c = part.columns
    velocity = 0.1 * np.exp(-(((c["position"][:, 0] - 0.25) / 0.05) ** 2))
    strain = -velocity / speed  # of a wave to the right
    c["velocity"][:, 0] = velocity
    c["density"] *= 1.0 - strain
    c["deviator"][:, 0] = 4.0 / 3.0 * G * strain
    c["pressure"] = -K * strain
    time = 0.0
    while time < 0.5 / speed:
        time += step(part)[0]
    x, velocity = part.columns["position"][:, 0], part.columns["velocity"][:, 0]
    assert (x * velocity).sum() / velocity.sum() == pytest.approx(0.25 + speed * time, abs=0.01 * speed * time)
    assert velocity.max() == pytest.approx(0.1, rel=0.05)
    assert velocity.min() > -0.005


@pytest.fixture(scope="module")
def one_rank():
    return run_ranks(1, ["tests/support/mpi_solid.py"], 300)


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.full)])
def test_same_bits_on_any_number_of_ranks_and_threads(one_rank, ranks):
    assert run_ranks(ranks, ["tests/support/mpi_solid.py"], 300) == one_rank
