"""The solid's formulas at single points, against exact values."""

import math

import numpy as np
import pytest

from distfsi.device import cpu
from distfsi.laws.law import EosMemory, Rest
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.eos.mie_grueneisen import MieGrueneisen
from distfsi.laws.solid.strength.johnson_cook import JohnsonCook
from distfsi.laws.solid.strength.linear_hardening import LinearHardening
from distfsi.laws.solid.strength.perfectly_plastic import PerfectlyPlastic
from distfsi.solid.formulas import pair, rotation, smoothing, stress

STEEL = JohnsonCook(77e9, 792e6, 510e6, 0.26, 0.014, 1.03, 1.0, 273.0, 1793.0, 477.0, 0.9)
COPPER, COPPER_DENSITY = MieGrueneisen(3940.0, 1.489, 0.0, 0.0, 2.0, 0.47), 8930.0


def compiled(dimensions, *formulas):
    constants = {
        "DIMENSIONS": dimensions,
        "COMPONENTS": dimensions * (dimensions + 1) // 2,
        "VISCOSITY_ALPHA": 1.0,
        "VISCOSITY_BETA": 2.0,
    }
    return cpu.build(formulas, constants)


def as_rows(matrix):
    return tuple(tuple(map(float, row)) for row in matrix)


# ---- smoothing -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_the_kernel_integrates_to_one_and_its_slope_is_its_derivative(dimensions):
    kernels = compiled(dimensions, smoothing.smoothing_kernel, smoothing.smoothing_slope)
    h = 0.7
    nodes, weights = np.polynomial.legendre.leggauss(20)
    r = h * (1.0 + nodes)  # 0 … 2h, where the kernel is a polynomial
    W = np.array([kernels.smoothing_kernel(x * x, h) for x in r])
    slope = np.array([kernels.smoothing_slope(x * x, h) for x in r])
    shell = {1: 2.0 + 0.0 * r, 2: 2.0 * math.pi * r, 3: 4.0 * math.pi * r * r}[dimensions]
    assert h * weights @ (W * shell) == pytest.approx(1.0, rel=1e-13)
    # integral of r dW/dr over the ball is -dimensions
    assert h * weights @ (slope * r * r * shell) == pytest.approx(-dimensions, rel=1e-13)


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_dilation_conserves_mass_and_particles_per_support(dimensions):
    dilated = compiled(dimensions, smoothing.dilated).dilated
    density, h = dilated(1000.0, 0.1, -30.0, 0.01)
    assert density == pytest.approx(1000.0 * math.exp(0.3))
    assert density * h**dimensions == pytest.approx(1000.0 * 0.1**dimensions)


# ---- pairs ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_pair_forces_are_opposite_to_the_bit_and_energy_balances(dimensions):
    kernels = compiled(dimensions, pair.approach_speeds, pair.viscosity, pair.pair_acceleration, pair.pair_heating)
    random = np.random.default_rng(1)
    dx, v_i, v_j = random.normal(size=(3, dimensions)) * 0.3
    S_i, S_j = random.normal(size=(2, dimensions, dimensions))
    dv, distance2, slope = v_i - v_j, float(dx @ dx), -0.8
    seen = -0.1, -0.3
    approach = kernels.approach_speeds(tuple(dv), tuple(dx), seen, -0.5, distance2, 1.0)
    assert approach == kernels.approach_speeds(tuple(-dv), tuple(-dx), seen[::-1], -0.5, distance2, 1.0)
    Pi = kernels.viscosity(0.3, 0.2, 2.0, 1.1)
    assert Pi == pytest.approx((2.0 * 0.2 + 2.0 * 0.3**2) / 1.1)
    a_i = np.array(kernels.pair_acceleration(tuple(dx), slope, as_rows(S_i + S_j), 1.3, Pi))
    a_j = np.array(kernels.pair_acceleration(tuple(-dx), slope, as_rows(S_j + S_i), 1.3, Pi))
    assert np.array_equal(a_i, -a_j)
    e_i = kernels.pair_heating(tuple(dv), tuple(dx), slope, as_rows(S_i), 1.3, Pi)
    e_j = kernels.pair_heating(tuple(-dv), tuple(-dx), slope, as_rows(S_j), 1.3, Pi)
    assert a_i @ v_i + a_j @ v_j + e_i + e_j == pytest.approx(0.0, abs=1e-14)


def test_viscosity_and_pressure_push_apart_and_heat():
    kernels = compiled(2, pair.approach_speeds, pair.pair_acceleration, pair.pair_heating)
    dx, nearing, nothing, pressure = (0.5, 0.0), (-1.0, 0.0), np.zeros((2, 2)), -np.eye(2)
    unseen, smooth = (0.0, 0.0), (-0.5, -0.5)
    assert kernels.approach_speeds(nearing, dx, unseen, 0.0, 0.25, 1.0) == pytest.approx((0.5 / 0.26, 0.5 / 0.26))
    assert kernels.approach_speeds((1.0, 0.0), dx, unseen, 0.0, 0.25, 1.0) == (0.0, 0.0)
    for dilation in (0.0, -4.0):  # shear, and a plane wave
        assert kernels.approach_speeds(nearing, dx, smooth, dilation, 0.25, 1.0) == pytest.approx((0.5 / 0.26, 0.0))
    for sigma, Pi in ((pressure, 0.0), (nothing, 1.0)):
        assert kernels.pair_acceleration(dx, -1.0, as_rows(sigma), 1.0, Pi)[0] > 0.0
        assert kernels.pair_heating(nearing, dx, -1.0, as_rows(sigma), 1.0, Pi) > 0.0


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_corrected_gradients_are_exact_at_a_ragged_surface(dimensions):
    kernels = compiled(dimensions, pair.pair_gradient, pair.gradient_correction, smoothing.smoothing_slope)
    random = np.random.default_rng(2)
    neighbours = random.uniform(-2.0, 2.0, size=(200, dimensions))
    neighbours[:, 0] = -np.abs(neighbours[:, 0])  # none on one side
    volume = 0.5 * 4.0**dimensions / len(neighbours)
    exact = random.normal(size=(dimensions, dimensions))
    gradient, moment = np.zeros((2, dimensions, dimensions))
    for x in neighbours[(neighbours**2).sum(axis=1) < 4.0]:
        slope = kernels.smoothing_slope(float(x @ x), 1.0)
        gradient += kernels.pair_gradient(tuple(-exact @ x), tuple(-x), slope, volume)
        moment += kernels.pair_gradient(tuple(-x), tuple(-x), slope, volume)
    correction = np.array(kernels.gradient_correction(as_rows(moment)))
    assert np.abs(gradient - exact).max() > 0.1
    assert np.allclose(gradient @ correction, exact, rtol=0.0, atol=1e-12)


def test_too_few_neighbours_are_not_corrected():
    correction = compiled(3, pair.gradient_correction).gradient_correction
    assert np.array_equal(correction(as_rows(np.zeros((3, 3)))), np.eye(3))
    assert np.array_equal(correction(as_rows(np.diag([1.0, 1.0, 0.04]))), np.eye(3))
    assert np.array_equal(correction(as_rows(np.diag([1.0, 0.5, 0.5]))), np.diag([1.0, 2.0, 2.0]))


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_the_gradient_at_mid_step_belongs_to_the_positions_half_a_step_later(dimensions):
    mid_step = compiled(dimensions, pair.mid_step).mid_step
    gradient, dt = np.random.default_rng(3).normal(size=(dimensions, dimensions)), 0.3
    moved = np.eye(dimensions) + 0.5 * dt * gradient
    assert np.allclose(mid_step(as_rows(gradient), dt), gradient @ np.linalg.inv(moved), rtol=0.0, atol=1e-14)


# ---- equation of state ---------------------------------------------------------------------------------------------


def response(eos, rest_density, density, energy):
    """Pressure and bulk modulus [Pa]."""
    modulus = rest_density * eos.reference_sound_speed(rest_density) ** 2
    return eos.respond(density, energy, Rest(rest_density, modulus), EosMemory())[:2]


@pytest.mark.parametrize(("u", "p", "compression"), [(250.0, 9.627e9, 1.0615), (500.0, 20.916e9, 1.1195)])
def test_copper_hugoniot(u, p, compression):
    shock = COPPER.c0 + COPPER.s1 * u
    density = COPPER_DENSITY / (1.0 - u / shock)
    assert density / COPPER_DENSITY == pytest.approx(compression, rel=1e-4)
    exact = COPPER_DENSITY * shock * u
    assert exact == pytest.approx(p, rel=1e-4)
    assert response(COPPER, COPPER_DENSITY, density, 0.5 * u * u)[0] == pytest.approx(exact, rel=1e-13)


def test_the_linear_law_is_linear():
    K, rho0 = 3.25e6, 1000.0
    for density in (700.0, 999.0, 1000.0, 1300.0):
        p, bulk = response(LinearEos(K), rho0, density, 1e5)
        assert p == pytest.approx(K * (density / rho0 - 1.0), rel=1e-14, abs=1e-8)
        assert bulk == pytest.approx(K * density / rho0, rel=1e-14)


@pytest.mark.parametrize("compression", [0.97, 1.0001, 1.05, 1.2])
def test_the_bulk_modulus_is_the_slope_of_the_isentrope(compression):
    steel, rest = MieGrueneisen(4569.0, 1.49, 0.1, 0.05, 2.17, 0.46), 7830.0
    rho, e, d = compression * rest, 2e4, 1e-5
    p, bulk = response(steel, rest, rho, e)
    de = p / rho * d
    ahead, _ = response(steel, rest, rho * (1.0 + d), e + de)
    behind, _ = response(steel, rest, rho * (1.0 - d), e - de)
    assert bulk == pytest.approx((ahead - behind) / (2.0 * d), rel=1e-7)


def test_hot_material_swells_until_it_has_no_pressure():
    energy = 2e5
    density = COPPER_DENSITY * math.exp(-COPPER.free_swelling(energy))
    assert abs(response(COPPER, COPPER_DENSITY, density, energy)[0]) < 1e-9 * COPPER_DENSITY * COPPER.c0**2
    assert COPPER.free_swelling(-1e5) == LinearEos(1e9).free_swelling(energy) == 0.0


def test_longitudinal_sound_speed_of_steel():
    G, K, rho = 80.23e9, 164.29e9, 7850.0  # E = 207 GPa, nu = 0.29
    speed = compiled(3, stress.longitudinal_speed).longitudinal_speed
    assert speed(rho, K, G, 0.1 * K) == pytest.approx(5878.0, rel=1e-3)


# ---- strength ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("strain", "rate", "temperature", "megapascal"),
    [
        (0.0, 1.0, 273.0, 792.00),
        (0.1, 1.0, 273.0, 1072.27),
        (0.1, 1e4, 273.0, 1210.53),
        (0.1, 1e4, 700.0, 883.18),
        (0.5, 1e4, 1033.0, 701.62),
        (0.0, 1e-3, 100.0, 792.00),
        (1.0, 1e5, 1500.0, 299.25),
        (1.0, 1e5, 2000.0, 0.0),
    ],
)
def test_johnson_cook_yield_stress(strain, rate, temperature, megapascal):
    assert STEEL.yield_stress(strain, rate, temperature) * 1e-6 == pytest.approx(megapascal, abs=0.01)


def test_the_return_of_rate_independent_metals_is_exact():
    constant, growing = PerfectlyPlastic(80e9, 400e6), LinearHardening(80e9, 400e6, 3e9)
    assert constant.plastic_increment(640e6, 0.3, 0.0, 1e-7) == pytest.approx(240e6 / 240e9, rel=1e-14)
    exact = (640e6 - 400e6 - 3e9 * 0.03) / (240e9 + 3e9)
    assert growing.plastic_increment(640e6, 0.03, 0.0, 1e-7) == pytest.approx(exact, rel=1e-14)


@pytest.mark.parametrize("before", [0.0, 1e-6, 0.01, 1.0])
@pytest.mark.parametrize("dt", [1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("overshoot", [1e-5, 0.01, 0.3, 5.0])
def test_the_return_ends_on_the_yield_surface(before, dt, overshoot):
    trial = (1.0 + overshoot) * STEEL.initial_yield(before, 400.0)
    increment = STEEL.plastic_increment(trial, before, 400.0, dt)
    after = STEEL.yield_stress(before + increment, increment / dt, 400.0)
    assert trial - 3.0 * STEEL.shear_modulus * increment == pytest.approx(after, rel=1e-4 if before == 0.0 else 1e-6)


def test_von_mises_counts_the_stress_out_of_the_plane():
    assert compiled(1, stress.von_mises).von_mises((2.0,)) == pytest.approx(3.0)
    plane = compiled(2, stress.von_mises).von_mises
    space = compiled(3, stress.von_mises).von_mises
    assert plane((2.0, -0.5, 0.7)) == pytest.approx(space((2.0, -0.5, -1.5, 0.7, 0.0, 0.0)))
    assert space((0.0, 0.0, 0.0, 1.0, 0.0, 0.0)) == pytest.approx(math.sqrt(3.0))


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize(
    ("polar", "exact"),
    [(False, [math.sin(1.0), math.sin(2.0), math.sin(4.0)]), (True, [0.8698, 1.3863, 2.3179])],
)
def test_simple_shear_follows_the_objective_rate(dimensions, polar, exact):
    """Shear stress over G at shears of 1, 2, 4: it swings with the vorticity, it grows with the polar rotation."""
    kernels = compiled(dimensions, stress.trial_deviator, rotation.polar_rotation, rotation.vorticity)
    shear = np.zeros((dimensions, dimensions))
    shear[0, 1] = 1.0
    gradient, xy, dt = as_rows(shear), {2: 2, 3: 3}[dimensions], 1e-3
    S = (0.0,) * (dimensions * (dimensions + 1) // 2)
    V = (1.0,) * dimensions + S[dimensions:]
    measured = {}
    for step in range(1, 4001):
        spin = kernels.vorticity(gradient)
        if polar:
            spin, V = kernels.polar_rotation(gradient, V, dt)
        S = kernels.trial_deviator(S, gradient, spin, 1.0, dt)
        measured[step] = S[xy]
    assert [measured[1000], measured[2000], measured[4000]] == pytest.approx(exact, abs=6e-5)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_the_polar_rotation_is_that_of_the_polar_decomposition(dimensions):
    kernels = compiled(dimensions, rotation.polar_rotation, rotation.rotation)
    gradient = np.random.default_rng(4).normal(size=(dimensions, dimensions))
    F, R, dt = np.eye(dimensions), np.eye(dimensions), 1e-3
    V = (1.0,) * dimensions + (0.0,) * (dimensions * (dimensions - 1) // 2)
    for _ in range(1000):
        spin, V = kernels.polar_rotation(as_rows(gradient), V, dt)
        R = np.array(kernels.rotation(spin, dt)) @ R
        F = np.linalg.solve(np.eye(dimensions) - 0.5 * dt * gradient, (np.eye(dimensions) + 0.5 * dt * gradient) @ F)
    U, stretches, W = np.linalg.svd(F)
    assert np.allclose(R, U @ W, rtol=0.0, atol=1e-5)
    assert np.allclose(np.array(V)[:dimensions], np.diag(U @ np.diag(stretches) @ U.T), rtol=1e-5)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_rigid_rotation_keeps_the_stress(dimensions):
    trial_deviator = compiled(dimensions, stress.trial_deviator).trial_deviator
    von_mises = compiled(dimensions, stress.von_mises).von_mises
    axis = np.array([0.0, 0.0, 1.0]) if dimensions == 2 else np.array([1.0, 2.0, -2.0]) / 3.0
    spin = np.cross(np.eye(3), axis)[:dimensions, :dimensions].T
    start = {2: (3.0, 1.0, 0.5), 3: (3.0, 1.0, -4.0, 0.5, -0.7, 0.2)}[dimensions]
    S, steps = start, 3600
    for _ in range(steps):
        S = trial_deviator(S, as_rows(spin), as_rows(spin), 1e11, 2.0 * math.pi / steps)
    assert von_mises(S) == pytest.approx(von_mises(start), rel=1e-12)
    assert np.allclose(S, start, rtol=0.0, atol=1e-10)


def test_a_quarter_turn_turns_the_stress_the_way_the_material_turns():
    trial_deviator = compiled(2, stress.trial_deviator).trial_deviator
    S = (2.0, 0.0, 0.3)
    for _ in range(100):
        spin = ((0.0, -1.0), (1.0, 0.0))
        S = trial_deviator(S, spin, spin, 1.0, 0.25 * math.pi / 100)  # 45 degrees counterclockwise
    assert np.allclose(S, (0.7, 1.3, 1.0), rtol=0.0, atol=1e-8)
