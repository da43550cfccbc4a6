"""The coupling: covered cells, forces, closed budgets, mirror images, and the same bits on any number of ranks."""

import math

import numpy as np
import pytest
from scipy.ndimage import label

from distfsi.scene.description import Ball, Box, HalfSpace, Tube
from launch import run_ranks
from mpi_coupling import AIR, AIR_AND_WATER, Coupled, body, gas, shock

# ---- covered cells --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("dimensions", "spacing"), [(1, 0.02), (2, 0.02), (2, 0.03), (3, 0.02)])
def test_a_box_covers_the_cells_whose_centers_it_holds(dimensions, spacing):
    D, low, high = dimensions, (0.13, 0.12, 0.12), (0.42, 0.48, 0.48)
    box = body(Box(low[:D], high[:D]), spacing, 1.0, (0,) * D)
    coupled = Coupled([box], [(gas(1.0, 1.0, (0,) * D), None)], (0.0,) * D, (0.8,) * D, (20,) * D)
    x = (np.arange(20) + 0.5) * 0.04
    covered = coupled.covered[7 if D > 2 else 0]
    assert np.array_equal(covered[7 if D > 1 else 0], (x > low[0]) & (x < high[0]))
    if D > 1:
        assert np.array_equal(covered[:, 7], (x > low[1]) & (x < high[1]))


@pytest.mark.parametrize(("thickness", "stretch"), [(4.0, 1.75), (1.5, 2.0)])
def test_a_stretched_ring_stays_closed(thickness, stretch):
    """Hoops of particles farther apart, in a wall as thin as its area makes it: from 8 cells to 4.6, from 3 to 1.5."""
    inner = 10.0
    ring = body(Tube((0.0, 0.0), inner, inner + thickness), 0.25, 1.0, (0, 0))
    coupled = Coupled([ring], [(gas(1.0, 1.0, (0, 0)), None)], (-24.0, -24.0), (24.0, 24.0), (96, 96), block=32)
    c = coupled.solid.columns
    grown = (stretch**2 - 1.0) * inner**2
    c["position"] *= np.sqrt(1.0 + grown / (c["position"] ** 2).sum(axis=1))[:, None]
    coupled.solid.migrate()
    coupled.solid.prepare(coupled.coupling.reach)
    coupled.coupling.update_geometry()
    covered = coupled.covered[0]
    assert label(~covered)[1] == 2
    x = (np.arange(96) + 0.5) * 0.5 - 24.0
    r = np.hypot(*np.meshgrid(x, x))
    inside = (r > stretch * inner) & (r < math.sqrt((inner + thickness) ** 2 + grown))
    assert covered.sum() == pytest.approx(inside.sum(), rel=0.02)


# ---- forces ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("phases", "precision"),
    [(AIR, "float64"), pytest.param(AIR, "float32", marks=pytest.mark.full), (AIR_AND_WATER, "float64")],
)
def test_gas_at_rest_around_a_clamped_body_stays_at_rest(phases, precision):
    everywhere = HalfSpace((2.0, 0.0), (1.0, 0.0))
    disc = body(Ball((0.47, 0.52), 0.21), 0.02, 3.0, (0, 0), everywhere)
    coupled = Coupled(
        [disc], [(gas(1.3, 1.7, (0, 0)), None)], (0.0, 0.0), (1.0, 1.0), (25, 25), phases=phases, precision=precision
    )
    accuracy = 1e-12 if precision == "float64" else 1e-4
    for _ in range(20):
        dt, impulse = coupled.step()
    U = coupled.grid_of(coupled.fluid.state)[:, ~coupled.covered]
    velocity = U[len(phases) : len(phases) + 2] / U[: len(phases)].sum(axis=0)
    assert np.abs(velocity).max() < accuracy
    assert np.abs(U[0] / U[0, 0] - 1.0).max() < accuracy
    assert np.abs(impulse).max() < accuracy * dt * 1.7


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_a_shock_pushes_a_wall_with_its_reflected_pressure(dimensions):
    """And all momentum that the fluid loses arrives: the wall is at rest."""
    density, pressure, velocity, speed, reflected = shock(2.0)
    h, cells, aside = 0.02, (50, 6, 4)[:dimensions], (0.0,) * (dimensions - 1)
    upper = tuple(h * n for n in cells)
    block = Box((0.6, *aside), (0.8, *upper[1:]))
    wall = body(block, 0.5 * h, 5.0, (0,) * dimensions, HalfSpace((2.0, *aside), (1.0, *aside)))
    still, moving = gas(1.0, 1.0, (0, *aside)), gas(density, pressure, (velocity, *aside))
    coupled = Coupled(
        [wall],
        [(still, None), (moving, HalfSpace((0.4, *aside), (1.0, *aside)))],
        (0.0,) * dimensions,
        upper,
        cells,
        (("outflow", "wall"), *(("wall", "wall"),) * (dimensions - 1)),
    )
    before, time = coupled.balance(), 0.0
    while time < 0.2 / speed + 0.15:
        dt, impulse = coupled.step()
        time += dt
    force = impulse / dt / math.prod(upper[1:])
    assert force[0] == pytest.approx(reflected - 1.0, rel=5e-3)  # the gas behind the wall pushes back with 1
    assert np.abs(force[1:]).max(initial=0.0) < 1e-12
    made = coupled.coupling.budget_by_cause()["wall"]
    assert np.abs(made[1:-1]).max() < 1e-13
    assert np.abs(coupled.balance() - before).max() < 1e-12


@pytest.mark.parametrize("speed", [1.0, -0.5])
def test_a_heavy_piston_makes_the_pressure_of_its_speed(speed):
    """Ideal gas (gamma 1.4): exact shock, and rarefaction, of a piston in gas with rho = p = 1."""
    g, c = 1.4, math.sqrt(1.4)
    if speed > 0.0:
        b = 0.5 * (g + 1.0) * speed**2
        exact, accuracy = 1.0 + 0.5 * b + math.sqrt(0.25 * b * b + g * speed**2), 0.01
    else:
        exact, accuracy = (1.0 + 0.5 * (g - 1.0) * speed / c) ** (2.0 * g / (g - 1.0)), 0.25
    piston = body(Box((0.6,), (0.8,)), 0.005, 1e6, (speed,), stiffness=1e6)
    coupled = Coupled([piston], [(gas(1.0, 1.0, (0,)), None)], (0.0,), (2.0,), (200,), block=64)
    time = 0.0
    while time < 0.2:
        dt, _ = coupled.step()
        time += dt
    face = 0.8 + speed * time
    x = (np.arange(200) + 0.5) * 0.01
    front = (x > face + 0.03) & (x < face + 0.1)
    rho, momentum, energy = coupled.grid_of(coupled.fluid.state)[:, 0, 0, front]
    p = 0.4 * (energy - 0.5 * momentum**2 / rho)
    assert p.mean() == pytest.approx(exact, rel=accuracy)


# ---- budgets --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("dimensions", "phases"), [(1, AIR), (2, AIR), (2, AIR_AND_WATER), (3, AIR)])
def test_books_close_around_a_body_that_is_thrown_about(dimensions, phases):
    D, cells = dimensions, (24, 16, 16)[:dimensions]
    ball = body(Ball((0.51, 0.41, 0.41)[:D], 0.2), 0.025, 3.0, (0.7, 0.3, -0.2)[:D])
    still, hot = gas(1.0, 1.0, (0,) * D), gas(2.0, 5.0, (0,) * D, len(phases) - 1)
    regions = [(still, None), (hot, Box((0.0,) * D, (0.2,) * D))]
    coupled = Coupled([ball], regions, (0.0,) * D, tuple(0.05 * n for n in cells), cells, phases=phases)
    before = coupled.balance()
    for _ in range(40):
        coupled.step()
    created = coupled.coupling.budget_by_cause()
    assert np.abs(coupled.balance() - before).max() < 1e-12 * before.max()
    assert created["covered"][-1] < 0.0 < created["fresh"][-1]


def burst(lower, symmetric):
    """Hot gas in a soft ring; the quarter of it above the origin, fluid and solid."""
    ring = body(Tube((0.0, 0.0), 0.4, 0.55), 0.025, 2.0, (0, 0))
    kinds = tuple(("symmetry" if symmetric else "outflow", "outflow") for _ in range(2))
    n = 20 if symmetric else 40
    regions = [(gas(1.0, 1.0, (0, 0)), None), (gas(5.0, 30.0, (0, 0)), Ball((0.0, 0.0), 0.4))]
    coupled = Coupled([ring], regions, lower, (1.0, 1.0), (n, n), kinds)
    before, size = coupled.balance(), 0.0
    for _ in range(60):
        coupled.step()
        size = max(size, np.abs(coupled.coupling.budget_by_cause()["sides"]).max())
    assert np.abs(coupled.balance() - before).max() < 1e-12 * (size + before[-1])
    covered = coupled.covered[0, -20:, -20:]
    state = np.where(covered, 0.0, coupled.grid_of(coupled.fluid.state)[:, 0, -20:, -20:])
    rows = coupled.particles()
    rows = rows[(rows[:, :2] > 0.0).all(axis=1)]
    return covered, state, rows[np.lexsort(np.round(rows[:, :2].T, 6))]


def test_a_quarter_with_symmetry_planes_is_a_quarter_of_the_whole():
    quarter, whole = burst((0.0, 0.0), True), burst((-1.0, -1.0), False)
    assert np.array_equal(quarter[0], whole[0])
    assert np.hypot(*whole[2][:, :2].T).min() > 0.45
    for part, other in zip(quarter[1:], whole[1:], strict=True):
        assert np.allclose(part, other, rtol=0.0, atol=1e-10 * np.abs(other).max())


def test_a_void_that_opens_inside_the_solid_holds_gas_at_rest():
    slab = body(Box((0.2,), (0.8,)), 0.01, 1.0, (0,), stiffness=1.0)
    coupled = Coupled([slab], [(gas(1.2, 1.0, (0.3,)), None)], (0.0,), (1.0,), (50,), (("outflow", "outflow"),))
    c = coupled.solid.columns
    c["position"][:] += 0.1 * np.sign(c["position"] - 0.5)
    coupled.solid.migrate()
    before = coupled.balance()
    coupled.step()
    rho, momentum, _ = coupled.grid_of(coupled.fluid.state)[:, 0, 0, 24:26].T[0]
    assert (rho, momentum) == (1.2, 0.0)
    assert np.abs(coupled.balance() - before).max() < 1e-13


# ---- ranks ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def one_rank():
    return run_ranks(1, ["tests/support/mpi_coupling.py"], 300)


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.full)])
def test_same_bits_on_any_number_of_ranks_and_threads_and_for_any_blocks(one_rank, ranks):
    assert one_rank.count("\n") == 7
    assert run_ranks(ranks, ["tests/support/mpi_coupling.py"], 300) == one_rank
