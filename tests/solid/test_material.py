"""The material point as a whole: `deform` driven through strain histories, against exact and independent answers."""

import itertools
import math
from dataclasses import astuple, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from distfsi.device import cpu
from distfsi.device.emit import plain
from distfsi.laws.law import DAMAGE, Failure, SolidEos, Strength
from distfsi.laws.registry import laws_of
from distfsi.laws.solid.eos.compaction import Compaction
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.failure.johnson_cook import JohnsonCookFailure
from distfsi.laws.solid.failure.principal_stress import PrincipalStress
from distfsi.laws.solid.scatter import Scatter
from distfsi.laws.solid.strength.concrete import Concrete
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.laws.solid.strength.johnson_cook import JohnsonCook
from distfsi.laws.solid.strength.linear_hardening import LinearHardening
from distfsi.laws.solid.strength.perfectly_plastic import PerfectlyPlastic
from distfsi.solid.formulas import stress
from distfsi.solid.materials import crack_width, weibull
from material_point import Point, Points, body_of, von_mises

STEEL = JohnsonCook(77e9, 792e6, 510e6, 0.26, 0.014, 1.03, 1.0, 273.0, 1793.0, 477.0, 0.9)
STEEL_EOS = LinearEos(160e9)
HJC_EOS = Compaction(16e6, 0.001, 0.80e9, 0.10, 85e9, -171e9, 208e9)
HJC = Concrete(14.86e9, 48e6, 4e6, 0.79, 1.60, 0.61, 0.007, 7.0, 0.04, 1.0, 0.01, 1.0)
WIDTH = crack_width(1.3, 3)  # spacings
TENSION, SHEAR = np.diag([1.0, 0.0, 0.0]), np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


# ---- laws side by side -----------------------------------------------------------------------------------------------


def test_bodies_of_different_laws_have_the_bits_that_they_have_alone():
    """Metals, one of them breaking and of which one is twice there, beside concrete: each by the kernel of its laws."""
    failure = JohnsonCookFailure(0.05, 0.0, 0.0, 0.0, 0.0, 1.0, None, 1e3, Scatter(8.0, 1e-3, 1))
    bodies = [
        body_of(STEEL_EOS, STEEL, failure=failure),
        body_of(HJC_EOS, HJC, 2440.0),
        body_of(STEEL_EOS, replace(STEEL, A=300e6), failure=failure),
        body_of(STEEL_EOS, Elastic(77e9)),
    ]
    together = Points(bodies, [2, 0, 1, 3, 0])
    alone = [Points([bodies[b]], [0] * 5) for b in (2, 0, 1, 3, 0)]
    random = np.random.default_rng(7)
    mean = random.standard_normal((5, 3, 3))
    mean[1], mean[2] = np.diag([1.0, -0.5, -0.5]), -np.eye(3)
    for _ in range(200):
        gradient = 5e4 * (mean + 0.3 * random.standard_normal((5, 3, 3)))
        for points in (together, *alone):
            points.strain(1e-8, gradient)
    assert [len(group.rows) for group in together.groups.groups] == [3, 1, 1]
    for row, points in enumerate(alone):
        for name, column in points.columns.items():
            if name != "body":
                assert np.array_equal(together.columns[name][row], column[row]), name
    assert together.columns["damage"][1] > 0.0
    assert together.columns["peak_compression"][2] > 0.0


def test_what_the_laws_of_a_scene_do_not_use_is_not_stored():
    always = {"body", "h", "energy", "density", "deviator", "pressure", "sound_speed"}
    assert set(Point(STEEL_EOS, Elastic(77e9)).columns) == always
    assert set(Point(STEEL_EOS, PerfectlyPlastic(77e9, 4e8)).columns) == always | {"plastic_strain"}
    whole = Point(HJC_EOS, HJC, 2440.0, PrincipalStress(3.6e6, 80.0, None), rate="green_naghdi")
    concrete = {"plastic_strain", "accumulated_damage", "peak_compression", "damage", "stretch"}
    assert set(whole.columns) == always | concrete


def test_laws_of_different_kinds_remember_different_things():
    named = {kind: {c.name for law in laws_of(kind) for c in law.columns} for kind in (SolidEos, Strength, Failure)}
    for first, second in itertools.combinations(named.values(), 2):
        assert not first & second
    for law in laws_of(Failure):
        assert law.columns[0] == DAMAGE


# ---- plastic flow ----------------------------------------------------------------------------------------------------


@pytest.mark.full
def test_a_cycle_of_shear_follows_the_independent_integration():
    """Forth, back and forth again at 1e4/s: rate form of Johnson-Cook with heating, integrated by scipy."""
    point, rate, dt = Point(STEEL_EOS, STEEL), 1e4, 2e-9
    G, A, B, n, C, m, _, room, melt, capacity, taylor_quinney = astuple(STEEL)

    def rates(time, y, sign):
        """Of shear stress, plastic strain and temperature: the overstress says how fast it flows."""
        tau, strain, temperature = y
        soft = 1.0 - (max(temperature - room, 0.0) / (melt - room)) ** m
        over = math.sqrt(3.0) * abs(tau) / ((A + B * max(strain, 0.0) ** n) * soft) - 1.0
        flow = math.exp(min(over / C, 40.0)) if over > 0.0 else 0.0
        heating = taylor_quinney * math.sqrt(3.0) * abs(tau) * flow / (7830.0 * capacity)
        return [sign * G * rate - math.copysign(math.sqrt(3.0) * G * flow, tau), flow, heating]

    y = [0.0, 0.0, 273.0]
    for sign, duration in ((1.0, 4e-6), (-1.0, 6e-6), (1.0, 4e-6)):
        for _ in range(round(duration / dt)):
            point.strain(dt, sign * rate * 0.5 * (SHEAR + SHEAR.T))
        tolerances = {"rtol": 1e-9, "atol": [1.0, 1e-12, 1e-9], "max_step": 1e-8}
        y = solve_ivp(rates, (0.0, duration), y, "LSODA", args=(sign,), **tolerances).y[:, -1]
        assert point.deviator[0, 3] == pytest.approx(y[0], rel=3e-4)
        assert point.plastic_strain[0] == pytest.approx(y[1], rel=3e-4)
        assert point.temperature[0] - 273.0 == pytest.approx(y[2] - 273.0, rel=3e-4)


def test_linear_hardening_is_exact_in_uniaxial_strain():
    G, Y, H, K = 77e9, 400e6, 3e9, 160e9
    point, strain = Point(STEEL_EOS, LinearHardening(G, Y, H)), 0.02
    for _ in range(100):
        point.strain(1e-8, strain / 100 / 1e-8 * TENSION)
    plastic = (2.0 * G * strain - Y) / (3.0 * G + H)
    assert point.plastic_strain[0] == pytest.approx(plastic, rel=1e-12)
    assert von_mises(point.deviator[0]) == pytest.approx(Y + H * plastic, rel=1e-12)
    assert point.pressure[0] == pytest.approx(K * (math.exp(-strain) - 1.0), rel=1e-12)


def test_a_closed_elastic_cycle_comes_back():
    point = Point(STEEL_EOS, Elastic(77e9), rate="green_naghdi")
    for sign in (1.0, -1.0):
        for _ in range(200):
            point.strain(1e-8, sign * 1e5 * (SHEAR + 0.3 * TENSION))
    assert np.abs(point.deviator).max() < 1e-4 * 77e9 * 0.2


@pytest.mark.parametrize("rate", ["jaumann", "green_naghdi"])
def test_a_rigid_turn_of_a_strained_point_keeps_its_stress(rate):
    point = Point(STEEL_EOS, Elastic(77e9), rate=rate).strain(1e-6, 1e4 * TENSION)
    before = point.deviator.copy()
    for _ in range(720):
        point.strain(1.0, 2.0 * math.pi / 720 * (SHEAR - SHEAR.T))
    assert np.allclose(point.deviator, before, rtol=0.0, atol=1e-10 * np.abs(before).max())


# ---- failure ---------------------------------------------------------------------------------------------------------

NO_RATE = {"D3": 0.0, "D4": 0.0, "D5": 0.0, "reference_rate": 1.0, "spall_strength": None, "scatter": None}


def test_shear_fails_at_the_fracture_strain_and_not_before():
    failure = JohnsonCookFailure(D1=0.05, D2=0.15, fracture_energy=0.0, **NO_RATE)
    point = Point(STEEL_EOS, PerfectlyPlastic(77e9, 400e6), failure=failure)
    while point.plastic_strain[0] < 0.1999:
        point.strain(1e-8, 1e4 * (SHEAR + SHEAR.T))
        assert point.damage[0] == 0.0
    assert point.ductile_damage[0] == pytest.approx(point.plastic_strain[0] / 0.2, rel=1e-12)
    while point.plastic_strain[0] < 0.2:
        point.strain(1e-8, 1e4 * (SHEAR + SHEAR.T))
    assert point.damage[0] == 1.0
    assert np.all(point.deviator == 0.0)


@pytest.mark.parametrize(
    ("triaxiality", "rate", "temperature", "strain"),
    [  # 4340 steel, Johnson & Cook 1985
        (0.0, 1.0, 273.0, 3.49),
        (1.0 / 3.0, 1.0, 273.0, 0.05 + 3.44 * math.exp(-2.12 / 3.0)),
        (1.5, 1e4, 1033.0, (0.05 + 3.44 * math.exp(-3.18)) * (1.0 + 0.002 * math.log(1e4)) * 1.305),
        (9.0, 1.0, 273.0, 0.05 + 3.44 * math.exp(-3.18)),
    ],
)
def test_johnson_cook_fracture_strain(triaxiality, rate, temperature, strain):
    failure = JohnsonCookFailure(0.05, 3.44, -2.12, 0.002, 0.61, 1.0, None, 0.0, None)
    heat = STEEL.scaled_temperature(temperature)
    assert failure.fracture_strain(triaxiality, rate, heat) == pytest.approx(strain, rel=1e-12)


def test_crushing_uses_nothing_up():
    failure = JohnsonCookFailure(D1=0.05, D2=0.15, fracture_energy=0.0, **NO_RATE)
    point = Point(STEEL_EOS, PerfectlyPlastic(77e9, 400e6), failure=failure)
    for _ in range(1000):
        point.strain(1e-8, -2e4 * TENSION)
    assert point.plastic_strain[0] > 0.1
    assert (point.ductile_damage[0], point.damage[0]) == (0.0, 0.0)


@pytest.mark.parametrize("spacing", [0.25e-3, 0.5e-3, 1e-3])
def test_a_crack_takes_its_energy_at_any_spacing(spacing):
    """Ductile in shear: work on a particle after the fracture strain, times its size, is the fracture energy."""
    energy, dt, rate = 2e4, 2e-9, 1e4
    failure = JohnsonCookFailure(D1=0.2, D2=0.0, fracture_energy=energy, **NO_RATE)
    point = Point(STEEL_EOS, PerfectlyPlastic(77e9, 400e6), failure=failure, spacing=spacing)
    work = 0.0
    while point.damage[0] < 1.0:
        before, worn = point.deviator[0, 3], point.ductile_damage[0] >= 1.0
        point.strain(dt, rate * 0.5 * (SHEAR + SHEAR.T))
        work += worn * 0.5 * (before + point.deviator[0, 3]) * rate * dt
    assert work * WIDTH * spacing == pytest.approx(energy, rel=0.01)


@pytest.mark.parametrize("spacing", [0.25e-3, 1e-3])
def test_a_ductile_crack_takes_its_energy_where_it_cannot_contract(spacing):
    """The work of the mean tension counts as that of plastic flow does; the elastic energy of shear does not."""
    energy, dt, width = 2e4, 2e-9, WIDTH * spacing
    failure = JohnsonCookFailure(D1=0.2, D2=0.0, fracture_energy=energy, **NO_RATE)
    point, work = Point(STEEL_EOS, PerfectlyPlastic(77e9, 400e6), failure=failure, spacing=spacing), 0.0
    point.ductile_damage[:] = 1.0
    while point.damage[0] < 1.0:
        before, density = point.normal_stress[0], point.density[0]
        point.strain(dt, 1e5 * TENSION)
        work += 0.5 * (before + point.normal_stress[0]) * (7830.0 / point.density[0] - 7830.0 / density)
    assert work * width == pytest.approx(energy + width * 400e6**2 / (6.0 * 77e9), rel=0.01)


@pytest.mark.parametrize("spacing", [0.5e-3, 1e-3, 2e-3])
@pytest.mark.parametrize("aside", [0.0, -0.2, 1.0], ids=["held", "free to contract", "pulled on all sides"])
def test_a_brittle_crack_takes_its_energy_at_any_spacing(spacing, aside):
    K, G, strength, energy = 16e9, 12e9, 4e6, 20.0
    failure = PrincipalStress(strength, energy, None)
    point, work, peak = Point(LinearEos(K), Elastic(G), failure=failure, spacing=spacing), 0.0, 0.0
    strain = 2e-7 * np.diag([1.0, aside, aside])
    while point.damage[0] < 1.0:
        before = point.deviator[0, :3] - point.pressure[0]
        point.strain(1.0, strain)
        work += 0.5 * (before + point.deviator[0, :3] - point.pressure[0]) @ np.diag(strain)
        peak = max(peak, point.normal_stress[0])
    assert peak == pytest.approx(strength, rel=5e-3)
    assert work * WIDTH * spacing == pytest.approx(energy, rel=0.01)


def test_a_failed_particle_carries_pressure_only():
    point = Point(STEEL_EOS, Elastic(77e9), failure=PrincipalStress(1e9, 0.0, None))
    while point.damage[0] < 1.0:
        point.strain(1e-8, 1e4 * TENSION)
    for _ in range(20):
        point.strain(1e-8, 1e4 * (TENSION + SHEAR))
    assert np.abs(point.deviator).max() == np.abs(point.pressure).max() == 0.0
    for _ in range(400):
        point.strain(1e-8, -1e4 * TENSION)
    assert point.pressure[0] > 1e9
    assert np.all(point.deviator == 0.0)


@pytest.mark.parametrize("D", [1, 2, 3])
def test_the_largest_principal_value_of_a_deviator(D):
    largest = cpu.build(
        (stress.largest_principal,), {"DIMENSIONS": D, "COMPONENTS": D * (D + 1) // 2}
    ).largest_principal
    random = np.random.default_rng(5)
    for case in range(300):
        values = random.normal(size=3)
        values[2] = values[1] if case % 3 == 0 else values[2]  # double roots at either end
        S = np.diag(values * (-1.0) ** case)
        turn, _ = np.linalg.qr(random.normal(size=(D, D)))
        S[:D, :D] = turn @ S[:D, :D] @ turn.T if D > 1 else S[:D, :D]
        S -= np.trace(S) / 3.0 * np.eye(3)
        if D == 1:
            S = np.diag([S[0, 0], -0.5 * S[0, 0], -0.5 * S[0, 0]])
        packed = [S[a, a] for a in range(D)] + [S[a, b] for a in range(D) for b in range(a + 1, D)]
        assert largest(tuple(packed)) == pytest.approx(np.linalg.eigvalsh(S).max(), rel=1e-6, abs=1e-9)


# ---- scatter ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("modulus", [2.0, 10.0])
def test_scatter_is_weibulls_and_the_weakest_link_of_a_volume_does_not_know_the_spacing(modulus):
    scatter = Scatter(modulus, 2e-3, 3)
    fine = weibull(scatter, np.arange(64 * 4000), np.full(64 * 4000, 0.5e-3**3), 3)
    coarse = weibull(scatter, np.arange(4000), np.full(4000, 2e-3**3), 3)
    weakest = fine.reshape(4000, 64).min(axis=1)
    assert coarse.mean() == pytest.approx(1.0, rel=4.0 / modulus / math.sqrt(4000))
    assert weakest.mean() == pytest.approx(1.0, rel=4.0 / modulus / math.sqrt(4000))
    exact = math.sqrt(math.gamma(1.0 + 2.0 / modulus) / math.gamma(1.0 + 1.0 / modulus) ** 2 - 1.0)
    assert coarse.std() == pytest.approx(exact, rel=0.05)
    assert weakest.std() == pytest.approx(exact, rel=0.05)


def test_scatter_depends_on_seed_and_id_alone():
    ids, volume = np.array([7, 3, 100000]), np.full(3, 1e-9)
    one = weibull(Scatter(5.0, 1e-3, 1), ids, volume, 3)
    assert np.array_equal(one[::-1], weibull(Scatter(5.0, 1e-3, 1), ids[::-1], volume, 3))
    assert not np.any(one == weibull(Scatter(5.0, 1e-3, 2), ids, volume, 3))


# ---- concrete --------------------------------------------------------------------------------------------------------


def hydrostat(point, mu, steps=400):
    """Compress evenly to density rho0 (1 + mu)."""
    start = point.density[0]
    rate = math.log(start / (2440.0 * (1.0 + mu))) / 3.0 / steps
    for _ in range(steps):
        point.strain(1.0, rate * np.eye(3))
    return point.pressure[0]


def test_concrete_is_crushed_and_locked():
    point = Point(HJC_EOS, HJC, density=2440.0)
    assert hydrostat(point, 0.001) == pytest.approx(16e6, rel=1e-9)
    x = np.roots([208e9, -171e9, 85e9, -0.8e9])
    full = 0.10 + 1.10 * float(x[np.argmin(np.abs(x))].real)
    assert hydrostat(point, full) == pytest.approx(0.8e9, rel=1e-9)
    assert hydrostat(point, 0.15) == pytest.approx(
        sum(k * (0.05 / 1.1) ** n for n, k in enumerate((85e9, -171e9, 208e9), 1)), rel=1e-9
    )


def test_crushed_concrete_unloads_along_a_stiffer_line():
    point = Point(HJC_EOS, HJC, density=2440.0)
    loaded = hydrostat(point, 0.05)
    unloaded = hydrostat(point, 0.049)
    full = 0.10 + 1.10 * 0.0096
    share = 0.049 / (full - 0.001)
    assert (loaded - unloaded) / 0.001 == pytest.approx((1.0 - share) * 16e9 + share * 85e9, rel=1e-2)
    assert hydrostat(point, 0.05) == pytest.approx(loaded, rel=1e-9)


def test_strength_of_concrete():
    whole = plain(Concrete.yield_stress, {"FAILS": False})

    def strength(pressure, rate, damage):
        return whole(*astuple(HJC), pressure, rate, damage)

    assert strength(0.0, 1.0, 0.0) == pytest.approx(0.79 * 48e6)
    assert strength(48e6, 1.0, 0.0) == pytest.approx((0.79 + 1.6) * 48e6)
    assert strength(48e6, 1e3, 0.0) == pytest.approx((0.79 + 1.6) * (1.0 + 0.007 * math.log(1e3)) * 48e6)
    assert strength(48e6, 1.0, 1.0) == pytest.approx(1.6 * 48e6)
    assert strength(5e9, 1.0, 0.0) == pytest.approx(7.0 * 48e6)
    assert strength(-2e6, 1.0, 0.0) == pytest.approx(0.5 * 0.79 * 48e6)
    assert strength(-4e6, 1.0, 0.0) == strength(-1e6, 1.0, 1.0) == 0.0


def test_shear_wears_concrete_out_and_leaves_friction():
    """Held at a pressure, the damage grows by equal steps to 1: at a strain of 0.04 (p* + T*)."""
    point = Point(HJC_EOS, HJC, density=2440.0)
    pressure = hydrostat(point, 0.0008)
    worn = 0.04 * (pressure + 4e6) / 48e6
    start = point.plastic_strain[0]
    while point.accumulated_damage[0] < 1.0:
        point.strain(1.0, 1e-5 * (SHEAR + SHEAR.T))
        point.density[:] = 2440.0 * 1.0008
    assert point.plastic_strain[0] - start == pytest.approx(max(worn, 0.01), rel=0.01)
    point.strain(1.0, 1e-5 * (SHEAR + SHEAR.T))
    friction = 1.6 * (pressure / 48e6) ** 0.61 * 48e6
    assert von_mises(point.deviator[0]) == pytest.approx(friction, rel=0.01)


def test_concrete_cracks_in_tension_and_carries_again_when_the_crack_is_closed():
    failure = PrincipalStress(3.6e6, 80.0, None)
    point, peak = Point(HJC_EOS, HJC, 2440.0, failure, spacing=5e-3), 0.0
    while point.damage[0] < 1.0:
        point.strain(1.0, 2e-6 * TENSION)
        peak = max(peak, point.normal_stress[0])
    assert peak == pytest.approx(3.6e6, rel=0.01)
    assert 2440.0 / point.density[0] - 1.0 == pytest.approx(2.0 * 80.0 / (3.6e6 * WIDTH * 5e-3), rel=0.07)
    assert abs(point.normal_stress[0]) < 1.0
    for _ in range(5000):
        point.strain(1.0, -2e-6 * TENSION)
    assert point.pressure[0] > 5e6
    assert von_mises(point.deviator[0]) > 5e6
