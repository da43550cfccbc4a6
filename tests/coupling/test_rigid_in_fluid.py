"""Rigid bodies that the fluid, springs and others move, against exact answers and ordinary differential equations."""

from math import sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from distfsi.device.cpu import Cpu
from distfsi.device.gpu import Gpu
from distfsi.device.host import HostRuntime
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.mesh.communicator import Communicator
from distfsi.scene import description as d
from distfsi.scene.motion import Support
from distfsi.simulation import Simulation
from mpi_coupling import Coupled, among_others, gas, rigid

OPEN = ("outflow", "outflow")


def coupled(bodies, regions, lower, upper, cells, kinds=None, **given):
    given.setdefault("form", "total_lagrangian")
    return Coupled(bodies, regions, lower, upper, cells, kinds, scheme="cut_cells", **given)


# ---- driven by gas and water ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("thickness", [0.05, 0.025])
def test_a_rigid_plate_flies_as_the_simple_wave_says(thickness):
    """Gas (gamma 1.4, p = rho = 1) drives a plate of mass 1 into a vacuum: u(0.5) = 0.39093, exact; 1 and 1/2 cells
    thick."""
    plate = rigid(d.Box((0.0,), (thickness,)), 0.5 * thickness, 1.0 / thickness, (0,))
    driver = (gas(1.0, 1.0, (0,)), d.Box((-2.0,), (0.5 * thickness,)))
    case = coupled([plate], [(gas(1e-7, 1e-8, (0,)), None), driver], (-2.0,), (2.0,), (80,), block=80, cfl=0.4)
    before = case.balance()
    while case.simulation.time < 0.5:
        dt, impulse = case.step()
    velocity = case.solid.totals()["momentum"][0] - (case.simulation.time - 0.5) * impulse[0] / dt
    assert velocity == pytest.approx(0.3909302681, rel=5e-3)
    assert np.abs(case.balance() - before).max() < 1e-12
    assert all(np.abs(made).max() < 1e-14 for made in case.coupling.budget_by_cause().values())


@pytest.mark.parametrize(("lightness", "cells", "least"), [(1.0, 2.0, 0.3), (0.1, 1.0, 2.0), (0.01, 1.0, 20.0)])
def test_a_light_rigid_plate_goes_along_with_the_water_around_it(lightness, cells, least):
    """A wave moves it as the water, u = p/(rho c), though in a step much more water goes along, rho c dt, than it has
    mass m per area."""
    n, rho, base, over = 80, 1000.0, 1e3, 1e5
    h, c = 1.0 / n, sqrt(4.4 * (base + 6e8) / rho)
    low = 0.5 + 0.3 * h
    plate = rigid(d.Box((low,), (low + cells * h,)), 0.5 * h, lightness * rho, (0,))
    wave = gas(rho * (1.0 + over / (4.4 * (base + 6e8))), base + over, (over / (rho * c),))
    regions = [(gas(rho, base, (0,)), None), (wave, d.Box((0.0,), (0.4,)))]
    water = (d.Phase("water", StiffenedGas(4.4, 6e8)),)
    case = coupled([plate], regions, (0.0,), (1.0,), (n,), (OPEN,), block=n, phases=water, cfl=0.9, runge_kutta="rk2")
    mass, velocity, late = lightness * rho * cells * h, [], []
    before = case.balance()
    while case.simulation.time < 0.8 / c:
        case.step()
        velocity.append(case.solid.totals()["momentum"][0] / mass * rho * c / over)
        late += velocity[-1:] if case.simulation.time > 0.3 / c else []
    assert rho * c * case.simulation.dt / mass > least
    assert np.abs(np.diff(velocity)).sum() < 1.07 * np.ptp(velocity)
    assert np.abs(np.array(late) - 1.0).max() < 5e-3
    assert np.abs(case.balance() - before).max() < 1e-12 * np.abs(before).max()


def wall_pressure(rho, p, approach):
    """Exact pressure on a wall that gas (gamma 1.4) of this state approaches: a shock, or a fan if it recedes."""
    c = sqrt(1.4 * p / rho)
    if approach < 0.0:
        return p * (1.0 + 0.2 * approach / c) ** 7
    a = 0.6 * approach / c
    return p * (1.0 + 1.4 * approach / c * (a + sqrt(1.0 + a * a)))


def test_a_mass_on_a_spring_in_a_shock_tube_swings_as_its_equation_says():
    """m v' = pressure before - pressure behind - k x - d v, each pressure that of the gas which comes towards the plate
    and which its speed compresses."""
    p, rho, n = 1.1, 1.4 * (1.1 * 6.0 + 1.0) / (1.1 + 6.0), 400
    u = 0.1 / 1.4 / sqrt((0.4 + 2.4 * 1.1) / 2.8)  # behind a shock into p = 1, rho = 1.4, c = 1
    front, low, high = 0.59, 0.6, 0.62
    stiffness, damping, mass = 8.0, 0.1, 0.2
    spring = Support(None, (stiffness,), (damping,))
    plate = rigid(d.Box((low,), (high,)), 0.5 / 200, 1.0, (0,), mass=mass, supports=(spring,))
    regions = [(gas(1.4, 1.0, (0,)), None), (gas(rho, p, (u,)), d.Box((-1.4,), (front,)))]
    case = coupled([plate], regions, (-0.4,), (1.6,), (n,), (OPEN,), block=n)
    start, before = (low - front) / (0.1 / 1.4 / u), case.balance()
    times, places = [], []
    while case.simulation.time < 0.9:
        case.step()
        times.append(case.simulation.time)
        places.append(float(case.solid.columns["position"].mean()) - 0.61)

    def motion(_, state):
        x, v = state
        pushes = wall_pressure(rho, p, u - v) - wall_pressure(1.4, 1.0, v)
        return v, (pushes - stiffness * x - damping * v) / mass

    found = solve_ivp(motion, (start, 1.0), (0.0, 0.0), rtol=1e-10, atol=1e-12, dense_output=True)
    exact = found.sol(np.maximum(times, start))[0]
    assert np.abs(np.array(places) - exact).max() < 5e-3 * np.abs(exact).max()
    assert np.abs(case.balance() - before)[1:].max() < 1e-12 * np.abs(before).max() + 1e-12


@pytest.mark.parametrize("dimensions", [2, pytest.param(3, marks=pytest.mark.full)])
def test_books_close_around_a_rigid_body_that_is_thrown_about(dimensions):
    """An oblique box that spins in a blast, in a closed box; the coupling makes nothing."""
    D, cells = dimensions, (20, 20, 16)[:dimensions]
    box = d.Box((0.4,) * D, (0.7, 0.55, 0.6)[:D])
    spin = (4.0,) if D == 2 else (4.0, 1.0, -2.0)
    block = rigid(box, 0.025, 3.0, (0.7, 0.3, -0.2)[:D], spin=spin)
    regions = [(gas(1.0, 1.0, (0,) * D), None), (gas(2.0, 5.0, (0,) * D), d.Box((0.0,) * D, (0.25,) * D))]
    case = coupled([block], regions, (0.0,) * D, tuple(0.05 * n for n in cells), cells)
    before = case.balance()
    for _ in range(30):
        case.step()
    assert np.abs(case.balance() - before).max() < 1e-12 * before.max()
    assert all(np.abs(made).max() < 1e-13 for made in case.coupling.budget_by_cause().values())


def test_a_rigid_body_goes_with_a_uniform_flow_as_if_it_were_none():
    """No force; the moments that cells give beside its corners turn it slowly, as they lie half a cell deep in it."""
    block = rigid(d.Box((0.3, 0.35), (0.65, 0.6)), 0.025, 0.5, (0.5, 0.3))
    case = coupled([block], [(gas(1.0, 1.0, (0.5, 0.3)), None)], (0.0,) * 2, (1.0,) * 2, (20, 20), (OPEN, OPEN))
    for _ in range(20):
        case.step()
    found = case.solid.reported()
    assert [found["body velocity_x [m/s]"], found["body velocity_y [m/s]"]] == pytest.approx([0.5, 0.3], abs=1e-6)
    assert abs(found["body angle [rad]"]) < 1e-4


# ---- among others ---------------------------------------------------------------------------------------------------


def test_rigid_bodies_obstacles_and_soft_ones_meet_in_one_scene():
    """Momentum and energy of all, but for what the obstacle gives, which is what its motion costs."""
    case, _ = among_others(1, 10, "cut_cells")
    before = case.balance()
    for _ in range(60):
        case.step()
    assert np.abs(case.balance() - before).max() < 1e-12 * np.abs(before).max()
    x, ids = case.solid.columns["position"], case.solid.columns["body"]
    assert case.solid.columns["energy"][ids == 0].max() > 0.0
    told = case.simulation.scene.solid.bodies[2].motion
    assert x[ids == 2] == pytest.approx(told.positions(case.solid.columns["reference"][ids == 2], case.simulation.time))
    for a, b in ((0, 1), (1, 2)):  # they have met and not passed through each other
        gaps = np.linalg.norm(x[ids == a][:, None] - x[ids == b], axis=2)
        assert 0.4 * 0.025 < gaps.min() < 2.0 * 0.025


@pytest.mark.full
def test_a_gpu_has_the_bits_of_the_cpu():
    """Its text, compiled for the host; with bars."""
    scene, found = among_others(1, 10, "cut_cells")[0].simulation.scene, []
    for device in (Cpu(1), Gpu(HostRuntime(), True)):
        simulation = Simulation.of(scene, Communicator(), device=device)
        for _ in range(4):
            simulation.step()
        c = simulation.solid.columns
        found.append((simulation.fluid.state, c["position"], c["velocity"], simulation.solid.given))
    for first, second in zip(*found, strict=True):
        assert np.array_equal(first, second)
