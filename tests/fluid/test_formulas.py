"""The fluid's formulas at single points, against thermodynamics, exact waves and symmetries."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from distfsi.device.emit import plain
from distfsi.fluid.formulas import limiters
from distfsi.fluid.formulas import riemann as riemann_solvers
from distfsi.fluid.formulas import six_equation as two_phase
from distfsi.laws.sources.gravity import Gravity
from distfsi.scene import thermodynamics
from fluids import AIR, MATERIALS, PAIRS, TNT, TRACE, WATER, model_of

SINGLE = tuple((name,) for name in ("air", "water", "tnt"))
FLUIDS = SINGLE + PAIRS
DENSITIES = {"air": (0.05, 200.0), "helium": (0.05, 200.0), "water": (700.0, 1500.0), "tnt": (0.5, 2200.0)}
CASES = [(fluid, dimensions) for fluid in FLUIDS for dimensions in (1, 2, 3)]
some = settings(max_examples=25, deadline=None, derandomize=True)


SOLVERS = ("hllc", "hll", "rusanov", "adaptive")
JUMP = 1e6  # of the pressure along the face [Pa], for the solver that looks at it


@cache
def formula(name, fluid, dimensions, riemann="hllc"):
    return model_of(*fluid, dimensions=dimensions, riemann=riemann).formula(name)


def logarithmic(low, high):
    return st.floats(math.log(low), math.log(high)).map(math.exp)


fractions = st.one_of(st.floats(0.01, 0.99), logarithmic(TRACE, 0.1), logarithmic(TRACE, 0.1).map(lambda a: 1.0 - a))


@st.composite
def primitive(draw, fluid, dimensions, speed=3000.0):
    """An admissible primitive state: warmer than the cold curve of each phase."""
    densities = [draw(logarithmic(*DENSITIES[name])) for name in fluid]
    cold = max(MATERIALS[name].cold_curve(rho)[0] for name, rho in zip(fluid, densities, strict=True))
    pressure = max(cold, 0.0) + draw(logarithmic(1e3, 1e10))
    velocity = [draw(st.floats(-speed, speed)) for _ in range(dimensions)]
    fraction = [draw(fractions)] if len(fluid) == 2 else []
    return (*densities, *velocity, pressure, *fraction)


def split(W, phases, dimensions):
    """(fractions, densities, velocity, pressure) of a primitive state."""
    shares = (1.0,) if phases == 1 else (W[-1], 1.0 - W[-1])
    return shares, W[:phases], W[phases : phases + dimensions], W[phases + dimensions]


def physical_flux(fluid, W, dimensions):
    """Flux along the first axis, from the definitions; and the size of its terms."""
    shares, densities, velocity, p = split(W, len(fluid), dimensions)
    u, masses = velocity[0], [a * rho for a, rho in zip(shares, densities, strict=True)]
    parts = zip(fluid, masses, densities, strict=True)
    energies = [m * thermodynamics.energy(MATERIALS[name], rho, p) for name, m, rho in parts]
    rho, squared = sum(masses), sum(v * v for v in velocity)
    flux = [m * u for m in masses]
    flux += [rho * u * v + (p if d == 0 else 0.0) for d, v in enumerate(velocity)]
    flux += [(sum(energies) + 0.5 * rho * squared + p) * u]
    if len(fluid) == 2:
        flux += [shares[0] * u, *(e * u for e in energies), u]
    speed = max(abs(v) for v in velocity) + formula("sound_speed", fluid, dimensions)(W)
    size = [rho * speed] * len(fluid) + [rho * speed**2] * dimensions
    size += [(sum(map(abs, energies)) + rho * speed**2) * speed]
    return flux, size + [speed, size[-1], size[-1], speed] if len(fluid) == 2 else size


def close(values, expected, size, relative):
    assert all(abs(a - b) <= relative * s for a, b, s in zip(values, expected, size, strict=True)), (values, expected)


def mirrored(W, phases):
    return tuple(-w if v == phases else w for v, w in enumerate(W))


# ---- states ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("fluid", "dimensions"), CASES)
def test_primitives_undo_conserved(fluid, dimensions):
    @some
    @given(primitive(fluid, dimensions))
    def check(W):
        back = formula("primitives", fluid, dimensions)(formula("conserved", fluid, dimensions)(W))
        shares, densities, velocity, p = split(W, len(fluid), dimensions)
        _, size = physical_flux(fluid, W, dimensions)
        speed = max(map(abs, velocity)) + formula("sound_speed", fluid, dimensions)(W)
        energy = size[len(fluid) + dimensions] / speed
        omegas = [MATERIALS[name].grueneisen(rho)[0] for name, rho in zip(fluid, densities, strict=True)]
        weakest = sum(a / omega for a, omega in zip(shares, omegas, strict=True))
        expected = [
            *(rho / a for rho, a in zip(densities, shares, strict=True)),
            *[speed] * dimensions,
            energy / weakest,
        ]
        close(back, W, expected + [1.0] * (len(fluid) - 1), 1e-14)

    check()


@pytest.mark.parametrize("name", ["air", "water", "tnt"])
def test_reference_pressure_agrees_with_the_cold_curve(name):
    """p = reference + omega rho e is the same as p = p_cold + omega rho (e - e_cold); de_cold = p_cold/rho^2 drho."""
    eos = MATERIALS[name]
    for rho in map(float, np.geomspace(*DENSITIES[name], 20)):
        (reference, _), (omega, _), (p_cold, _) = eos.reference(rho), eos.grueneisen(rho), eos.cold_curve(rho)
        for energy in (1e5, 4.29e6):
            p = reference + omega * rho * energy
            assert p == pytest.approx(thermodynamics.pressure(eos, rho, energy), rel=1e-11, abs=1e-4)
        step = 1e-4 * rho
        slope = (eos.cold_curve(rho + step)[1] - eos.cold_curve(rho - step)[1]) / (2.0 * step)
        assert slope == pytest.approx(p_cold / rho**2, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("name", ["air", "water", "tnt"])
@pytest.mark.parametrize("quantity", ["reference_1", "grueneisen_1"])
def test_slopes_are_derivatives(name, quantity):
    value = model_of(name).formula(quantity)
    for rho in np.geomspace(*DENSITIES[name], 30):
        step = 1e-20 * rho
        derivative = np.imag(value(complex(rho, step))[0]) / step  # complex step: no cancellation
        assert value(float(rho))[1] == pytest.approx(derivative, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", ["air", "water", "tnt"])
def test_sound_speed_is_the_slope_of_the_isentrope(name):
    """dp/drho where de = p/rho^2 drho, by a central difference along the isentrope."""
    eos = MATERIALS[name]

    @some
    @given(primitive((name,), 1))
    def check(W):
        rho, _, p = W
        energy, h = thermodynamics.energy(eos, rho, p), 1e-4 * rho

        def on_isentrope(dr):
            bulk = rho * thermodynamics.sound_speed_squared(eos, rho, p)
            middle = p + 0.5 * dr * bulk / rho  # second order, as p/rho^2 at the mean
            return thermodynamics.pressure(eos, rho + dr, energy + middle / (rho * (rho + dr)) * dr)

        slope = (on_isentrope(h) - on_isentrope(-h)) / (2.0 * h)
        assert formula("sound_speed", (name,), 1)(W) ** 2 == pytest.approx(slope, rel=1e-5)

    check()


@pytest.mark.parametrize("fluid", PAIRS)
def test_frozen_sound_speed_weighs_the_phases_by_mass(fluid):
    @some
    @given(primitive(fluid, 2))
    def check(W):
        (a1, a2), (rho1, rho2), _, p = split(W, 2, 2)
        squares = [formula("sound_speed", (n,), 1)((r, 0.0, p)) ** 2 for n, r in zip(fluid, (rho1, rho2), strict=True)]
        expected = (a1 * rho1 * squares[0] + a2 * rho2 * squares[1]) / (a1 * rho1 + a2 * rho2)
        assert formula("sound_speed", fluid, 2)(W) ** 2 == pytest.approx(expected, rel=1e-12)

    check()


# ---- the face flux ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("fluid", "dimensions"), CASES)
def test_flux_of_one_state_is_the_physical_flux(fluid, dimensions):
    @some
    @given(primitive(fluid, dimensions), st.sampled_from(SOLVERS))
    def check(W, riemann):
        flux = formula("face_flux", fluid, dimensions, riemann)(W, W, JUMP)
        close(flux, *physical_flux(fluid, W, dimensions), 1e-12)

    check()


@pytest.mark.parametrize(("fluid", "dimensions"), CASES)
def test_flux_is_symmetric_to_reflection(fluid, dimensions):
    """All fluxes change their sign, but for the normal momentum's."""
    phases = len(fluid)

    @some
    @given(primitive(fluid, dimensions), primitive(fluid, dimensions), st.sampled_from(SOLVERS))
    def check(left, right, riemann):
        flux = formula("face_flux", fluid, dimensions, riemann)
        there = flux(left, right, JUMP)
        back = flux(mirrored(right, phases), mirrored(left, phases), JUMP)
        size = np.maximum(physical_flux(fluid, left, dimensions)[1], physical_flux(fluid, right, dimensions)[1])
        close([f if v == phases else -f for v, f in enumerate(back)], there, size, 1e-8)

    check()


@pytest.mark.parametrize(("fluid", "dimensions"), CASES)
def test_no_mass_and_no_energy_crosses_a_wall(fluid, dimensions):
    """Exactly none: a closed box keeps its mass and energy to the bit."""
    phases = len(fluid)

    @some
    @given(primitive(fluid, dimensions), st.sampled_from(SOLVERS))
    def check(W, riemann):
        flux = formula("face_flux", fluid, dimensions, riemann)(W, mirrored(W, phases), JUMP)
        nothing = [v for v in range(len(flux)) if v != phases]
        assert all(flux[v] == 0.0 for v in nothing)
        assert math.isfinite(flux[phases])

    check()


@pytest.mark.parametrize("fluid", FLUIDS)
def test_a_contact_moves_with_the_flow_and_feels_no_pressure_step(fluid):
    """Equal pressure and velocity, another density, fraction and tangential velocity: the upwind physical flux."""

    @some
    @given(primitive(fluid, 2), st.floats(-500.0, 500.0), st.floats(0.7, 1.4), fractions)
    def check(left, u, part, fraction):
        phases = len(fluid)
        left = (*left[:phases], u, 10.0, left[phases + 2] * 2.0, *left[phases + 3 :])
        right = (*(part * rho for rho in left[:phases]), u, -20.0, left[phases + 2], *[fraction] * (phases - 1))
        upwind = left if u >= 0.0 else right
        size = np.maximum(physical_flux(fluid, left, 2)[1], physical_flux(fluid, right, 2)[1])
        close(formula("face_flux", fluid, 2)(left, right, 0.0), physical_flux(fluid, upwind, 2)[0], size, 1e-11)

    check()


@pytest.mark.parametrize("fluid", FLUIDS)
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_supersonic_flow_takes_the_upwind_flux(fluid, direction):
    @some
    @given(primitive(fluid, 2, speed=100.0), primitive(fluid, 2, speed=100.0))
    def check(left, right):
        phases = len(fluid)
        fastest = max(formula("sound_speed", fluid, 2)(W) for W in (left, right)) + 200.0
        left, right = ((*W[:phases], W[phases] + direction * 3.0 * fastest, *W[phases + 1 :]) for W in (left, right))
        upwind = left if direction > 0.0 else right
        close(formula("face_flux", fluid, 2)(left, right, 0.0), *physical_flux(fluid, upwind, 2), 1e-14)

    check()


@pytest.mark.parametrize("riemann", ["hll", "rusanov"])
@pytest.mark.parametrize("fluid", FLUIDS)
def test_hll_is_the_mean_state_between_two_waves(fluid, riemann):
    """Written as HLLC with smeared contacts, it is the textbook's flux of all that is conserved."""
    phases, conserved = len(fluid), len(fluid) + 3

    @some
    @given(primitive(fluid, 2), primitive(fluid, 2))
    def check(left, right):
        c_l, c_r = (formula("sound_speed", fluid, 2)(W) for W in (left, right))
        (a_l, rhos_l, u_l, _), (a_r, rhos_r, u_r, _) = split(left, phases, 2), split(right, phases, 2)
        rho_l, rho_r = np.dot(a_l, rhos_l), np.dot(a_r, rhos_r)
        speeds = riemann_solvers.einfeldt_speeds if riemann == "hll" else riemann_solvers.rusanov_speeds
        s_l, s_r = speeds(rho_l, u_l[0], c_l, rho_r, u_r[0], c_r)
        s_l, s_r = min(s_l, 0.0), max(s_r, 0.0)
        (F_l, size_l), (F_r, size_r) = (physical_flux(fluid, W, 2) for W in (left, right))
        U_l, U_r = (np.array(formula("conserved", fluid, 2)(W), dtype=float)[:conserved] for W in (left, right))
        F_l, F_r = np.array(F_l[:conserved]), np.array(F_r[:conserved])
        expected = (s_r * F_l - s_l * F_r + s_l * s_r * (U_r - U_l)) / (s_r - s_l)
        found = formula("face_flux", fluid, 2, riemann)(left, right, 0.0)[:conserved]
        close(found, expected, np.maximum(size_l, size_r)[:conserved], 1e-9)

    check()


@pytest.mark.parametrize("fluid", FLUIDS)
def test_shear_along_shocks_leaves_all_but_slip_alone(fluid):
    """Only tangential momentum and its work differ from HLLC; the stress opposes the slip, and grows with the jump up
    to a strong shock's."""

    @some
    @given(primitive(fluid, 2), primitive(fluid, 2))
    def check(left, right):
        sharp, nothing, *viscous = (
            np.array(formula("face_flux", fluid, 2, name)(left, right, jump))
            for name, jump in (
                ("hllc", 0.0),
                ("adaptive", 0.0),
                ("adaptive", 1e3),
                ("adaptive", 1e14),
                ("adaptive", 1e15),
            )
        )
        tangential, energy = len(fluid) + 1, len(fluid) + 2
        slip, mean = right[tangential] - left[tangential], 0.5 * (right[tangential] + left[tangential])
        assert np.array_equal(sharp, nothing)
        assert np.array_equal(viscous[1], viscous[2])
        stress = [(sharp - flux)[tangential] for flux in viscous]
        assert 0.0 <= stress[0] * np.sign(slip) <= stress[1] * np.sign(slip)
        size = np.abs(sharp).max() + np.abs(viscous[1]).max()
        assert (sharp - viscous[1])[energy] == pytest.approx(stress[1] * mean, abs=1e-12 * size)
        others = [v for v in range(len(sharp)) if v not in (tangential, energy)]
        assert np.array_equal(sharp[others], viscous[1][others])

    check()


def test_strong_water_air_tube_starts_in_the_right_direction():
    """1 GPa water | 1 bar air: exact p* = 14.19 MPa, u* = 482.6 m/s; linear estimates lie within a small factor."""
    left, right = (1000.0, 50.0, 0.0, 1e9, 1.0 - TRACE), (1000.0, 50.0, 0.0, 1e5, TRACE)
    flux = formula("face_flux", ("water", "air"), 1)(left, right, 0.0)
    u = flux[-1]
    pressure = flux[2] - (flux[0] + flux[1]) * u
    assert 482.6 / 2.0 < u < 482.6 * 2.0
    assert 14.19e6 / 5.0 < pressure < 14.19e6 * 5.0
    assert flux[0] > 0.0


def test_einfeldt_speeds_bound_a_strong_shock():
    """A shock of Mach 10 into air at rest: the fastest wave is the shock itself."""
    gamma, mach = 1.4, 10.0
    rho_r, p_r = 1.0, 1.0
    c_r = math.sqrt(gamma * p_r / rho_r)
    p_l = p_r * (1.0 + 2.0 * gamma / (gamma + 1.0) * (mach**2 - 1.0))
    rho_l = rho_r * (gamma + 1.0) * mach**2 / ((gamma - 1.0) * mach**2 + 2.0)
    u_l = mach * c_r * (1.0 - rho_r / rho_l)
    c_l = math.sqrt(gamma * p_l / rho_l)
    _, fastest = riemann_solvers.einfeldt_speeds(rho_l, u_l, c_l, rho_r, 0.0, c_r)
    assert mach * c_r <= fastest * (1.0 + 1e-12)
    assert riemann_solvers.contact_speed(rho_l, u_l, p_l, -99.0, rho_r, 0.0, p_r, mach * c_r) == pytest.approx(u_l)


@pytest.mark.parametrize("eos", [AIR, WATER, TNT])
def test_energy_behind_a_wave_lies_on_the_hugoniot(eos):
    """e* - e = (p + p*)/2 (1/rho - 1/rho*), as long as the compression is not near the limit."""
    name = next(n for n, material in MATERIALS.items() if material is eos)

    @some
    @given(primitive((name,), 1), st.floats(0.6, 0.98))
    def check(W, part):
        rho, _, p = W
        omega, _ = eos.grueneisen(rho)
        limit = (2.0 + omega) / omega
        for chi in (part, 1.0 + (limit - 1.0) * (1.0 - part)):
            y = 1.0 / chi
            if y - 0.5 * omega * (1.0 - y) <= 0.1 * y:
                continue
            (before, _), (after, _) = (eos.reference(r) for r in (rho, rho * chi))
            (omega, _), (omega_behind, _) = (eos.grueneisen(r) for r in (rho, rho * chi))
            excess = omega_behind / omega * (p - before)
            density_energy = two_phase.energy_behind_wave(p, chi, excess, after, omega_behind)
            e, e_behind = thermodynamics.energy(eos, rho, p), density_energy / (rho * chi)
            p_behind = thermodynamics.pressure(eos, rho * chi, e_behind)
            work = 0.5 * (p + p_behind) * (1.0 / rho - 1.0 / (rho * chi))
            size = abs(e) + abs(e_behind) + abs(p_behind) / rho + abs(after) / rho
            assert abs(e_behind - e - work) <= 1e-11 * size

    check()


# ---- one stage -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("fluid", "dimensions"), CASES)
def test_a_uniform_state_stays_to_the_bit(fluid, dimensions):
    model = model_of(*fluid, dimensions=dimensions)
    updated, nothing = model.formula("updated"), (0.0,) * model.constants["FLUXES"]

    @some
    @given(primitive(fluid, dimensions), st.sampled_from([None, TRACE, 1.0 - TRACE]))
    def check(W, fraction):
        if len(fluid) == 2 and fraction is not None:
            W = (*W[:-1], fraction)
        U = tuple(map(float, formula("conserved", fluid, dimensions)(W)))
        W = formula("primitives", fluid, dimensions)(U)
        for b in (1.0, 0.25, 2.0 / 3.0):
            assert updated(U, U, W, nothing, b, 1e-6)[: len(U)] == U

    check()


@pytest.mark.parametrize(("fluid", "dimensions"), CASES)
def test_a_stage_changes_conserved_values_by_its_fluxes_and_forces(fluid, dimensions):
    gravity = (1.5, -2.5, 3.5)[:dimensions]
    model = model_of(*fluid, dimensions=dimensions, sources=(Gravity(gravity),))
    updated, phases = model.formula("updated"), len(fluid)

    @some
    @given(primitive(fluid, dimensions), primitive(fluid, dimensions), st.floats(-0.05, 0.05))
    def check(W_n, W, part):
        U_n, U = (formula("conserved", fluid, dimensions)(w) for w in (W_n, W))
        flux, size = physical_flux(fluid, W, dimensions)
        dt = part / size[0] * (U[0] + (U[1] if phases == 2 else 0.0))
        D = tuple(dt * f for f in flux)
        b, rho = 0.25, sum(U[:phases])
        work = sum(g * m for g, m in zip(gravity, U[phases:], strict=False))
        force = [0.0] * phases + [g * rho for g in gravity] + [work]
        new = updated(U_n, U, formula("primitives", fluid, dimensions)(U), D, b, dt)
        for v in range(model.conserved):
            expected = (1.0 - b) * U_n[v] + b * (U[v] - D[v] + dt * force[v])
            terms = abs(U_n[v]) + abs(U[v]) + abs(D[v]) + abs(dt * force[v])
            assert abs(new[v] - expected) <= 1e-14 * terms

    check()


# ---- limiters --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("limiter", [limiters.minmod, limiters.van_leer, limiters.first_order])
@some
@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9))
def test_limited_slopes_are_symmetric_and_never_overshoot(limiter, a, b):
    slope = limiter(a, b)
    assert slope == limiter(b, a) == -limiter(-a, -b)
    assert abs(slope) <= 2.0 * min(abs(a), abs(b)) * (1.0 + 1e-15)
    assert slope == 0.0 if a * b <= 0.0 else slope * a >= 0.0


def test_limiters_keep_a_straight_line():
    assert limiters.minmod(3.0, 3.0) == limiters.van_leer(3.0, 3.0) == 3.0
    assert limiters.minmod(1.0, 3.0) == 1.0
    assert limiters.van_leer(1.0, 3.0) == pytest.approx(1.5)
    assert plain(limiters.first_order, {})(1.0, 3.0) == 0.0
