"""What every equation of state of a fluid must show, at points, against a Material that knows nothing of it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from distfsi.coupling.formulas import moving_wall
from distfsi.device.emit import plain
from distfsi.fluid.formulas import relaxation, six_equation
from distfsi.fluid.kernels.rows import HALVINGS
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load, thermodynamics
from distfsi.simulation import Simulation
from distfsi.study.problems import centers, fields
from fluids import AIR, TRACE, model_of
from independent import Material


def check_law(law, material, states):
    """The formulas of a law at `states`, pairs of density and pressure."""
    for rho, p in states:
        _check_point(law, material, rho, p)
        _check_waves(law, material, rho, p)
        check_relaxation(law, material, rho, p)
        _check_wall(law, material, rho, p)


def formula(model, function):
    """A formula of the package with the numbers of a model, in plain Python."""
    return plain(function, model.constants, model.bindings)


def _check_point(law, material, rho, p):
    """Pressure, energy, slopes, the cold curve, and the speed of sound of each model."""
    e = material.energy(rho, p)
    (reference, _), (omega, _) = law.reference(rho), law.grueneisen(rho)
    size = abs(reference) + abs(p)
    assert reference + omega * rho * e == pytest.approx(p, abs=1e-12 * size)
    assert thermodynamics.pressure(law, rho, e) == pytest.approx(p, abs=1e-12 * size)
    assert thermodynamics.energy(law, rho, p) == pytest.approx(e, abs=1e-12 * size / (omega * rho))

    model, step = model_of(law), 1e-20 * rho
    for name in ("reference_1", "grueneisen_1"):
        value = model.formula(name)
        derivative = np.imag(value(complex(rho, step))[0]) / step
        assert value(rho)[1] == pytest.approx(derivative, rel=1e-12, abs=1e-300)

    p_cold, e_cold = law.cold_curve(rho)
    h = 1e-5 * rho
    slope = (law.cold_curve(rho + h)[1] - law.cold_curve(rho - h)[1]) / (2.0 * h)
    assert slope == pytest.approx(p_cold / rho**2, rel=1e-5, abs=1e-9)
    assert material.pressure(rho, e_cold) == pytest.approx(p_cold, abs=1e-11 * size)

    beyond = 1.01 * law.maximum_density
    if np.isfinite(beyond):
        with np.errstate(invalid="ignore"):
            assert np.isnan(model.formula("primitives")((beyond, 0.0, beyond * e))[2])

    c = material.sound_speed(rho, p)
    assert thermodynamics.sound_speed_squared(law, rho, p) == pytest.approx(c**2, rel=1e-12)
    assert model.formula("sound_speed")((rho, 0.0, p)) == pytest.approx(c, rel=1e-12)
    for method in ("six_equation", "five_equation"):
        pure = model_of(law, AIR, model=method).formula("sound_speed")((rho, 1.0, 0.0, p, 1.0 - 1e-13))
        assert pure == pytest.approx(c, rel=1e-9)


def _check_waves(law, material, rho, p):
    """Isentropes by integration, shocks by their jump conditions."""
    for p_end in (0.5 * p, 2.0 * p):
        path = solve_ivp(
            lambda p, y: [1.0 / thermodynamics.sound_speed_squared(law, y[0], p)],
            (p, p_end),
            [rho],
            "DOP853",
            rtol=1e-12,
            atol=1e-12 * rho,
        )
        assert path.y[0, -1] == pytest.approx(material.isentrope(rho, p, p_end)[1, -1], rel=1e-10)
    for factor in (1.1, 3.0):
        behind = material.behind_shock(rho, p, factor * p)
        (before, _), (after, _) = law.reference(rho), law.reference(behind)
        (omega, _), (omega_behind, _) = law.grueneisen(rho), law.grueneisen(behind)
        excess = omega_behind / omega * (p - before)
        energy = six_equation.energy_behind_wave(p, behind / rho, excess, after, omega_behind)
        size = abs(after) + factor * p
        assert after + omega_behind * energy == pytest.approx(factor * p, abs=1e-9 * size)
    behind_wave = formula(model_of(law, AIR), six_equation.behind_wave)
    for u_face in (-500.0, 500.0, 990.0, 999.0):  # up to compressions that no gas can have
        assert np.all(np.isfinite(behind_wave((rho, 1.0, 0.0, p, 0.5), 1000.0, u_face)))


def check_relaxation(law, material, rho, p):
    """The law and air under another pressure: each keeps e - e0 + p (1/rho - 1/rho0) = 0 up to their common pressure.
    And a uniform state stays to the bit."""
    model = model_of(law, AIR)
    before, change_of, range_of, halved = (
        formula(model, getattr(relaxation, name))
        for name in ("phases_before", "relaxed_fraction_change", "range_of_change", "halved_range")
    )
    air = Material(lambda rho, e: 0.4 * rho * e, lambda rho, p: p / (0.4 * rho))

    def density_on_path(material, rho0, p0, p):
        e0, growth = material.energy(rho0, p0), 1.02 if p > p0 else 1.0 / 1.02

        def excess(rho):
            return material.energy(rho, p) - e0 + p * (1.0 / rho - 1.0 / rho0)

        rho = rho0
        while excess(rho) * (p - p0) > 0.0:
            rho *= growth
        return brentq(excess, *sorted((rho, rho0)), xtol=1e-15) if p != p0 else rho0

    for a1 in (0.02, 0.6):
        a2, p_air, rho_air = 1.0 - a1, 1.5 * p, 2.0
        lowest = min(p, p_air)
        (G1, _), (G2, _) = law.reference(rho), AIR.reference(rho_air)
        phases = before(lowest, a1, 0.0, a1 * rho, a2 * rho_air, G1, G2, a1 * (p - lowest), a2 * (p_air - lowest))
        change, settled = change_of(phases)
        if settled < 0.0:
            low, high = range_of(phases)
            for _ in range(HALVINGS):
                low, high = halved(phases, low, high)
            change = 0.5 * (low + high)

        def missing(p_common, a1=a1, a2=a2, p_air=p_air, rho_air=rho_air):
            volumes = a1 * rho / density_on_path(material, rho, p, p_common)
            return volumes + a2 * rho_air / density_on_path(air, rho_air, p_air, p_common) - 1.0

        common = brentq(missing, p, p_air, rtol=1e-14)
        exact = a1 * rho / density_on_path(material, rho, p, common) - a1
        assert change == pytest.approx(exact, rel=1e-6, abs=1e-9 * min(a1, a2))

    nothing = (0.0,) * model.constants["FLUXES"]
    conserved, primitives, updated = (model.formula(name) for name in ("conserved", "primitives", "updated"))
    for a1 in (TRACE, 0.3, 1.0 - TRACE):
        U = tuple(map(float, conserved((rho, 2.0, 30.0, p, a1))))
        assert updated(U, U, primitives(U), nothing, 0.25, 1e-6)[: len(U)] == U


def _check_wall(law, material, rho, p):
    """A wall that the fluid approaches or leaves: shock or fan, of any strength where the formula is exact."""
    model = model_of(law)
    wall_pressure = formula(model, moving_wall.wall_pressure)
    W = (rho, 0.0, p)
    U, c = model.formula("conserved")(W), material.sound_speed(rho, p)
    for factor in (0.7, 0.99, 1.01, 3.0) if law.closed_form else (0.99, 1.01):
        p_wall = factor * p
        if p_wall < p:
            approach = material.isentrope(rho, p, p_wall)[2, -1]
        else:
            behind = material.behind_shock(rho, p, p_wall)
            approach = np.sqrt((p_wall - p) * (1.0 / rho - 1.0 / behind))
        tolerance = 1e-8 * rho * c * abs(approach) if law.closed_form else 0.02 * abs(p_wall - p)
        assert wall_pressure(U, W, approach) == pytest.approx(p_wall, abs=tolerance + 1e-8 * p)


def check_tube(path, exact, interface, limits):
    """Two states that meet at `interface` in the input at `path`, at its end: the errors of density, velocity and
    pressure, each over its range, stay below `limits` and halve with the cells as those of shocks and contacts do."""
    errors = []
    for cells in (100, 200):
        simulation = Simulation.of(load(path, [f"domain.cells={cells}"]), Communicator(), 1)
        while not simulation.done:
            simulation.step()
        found, x = fields(simulation), centers(simulation)[0]
        values = found["density"][0, 0], found["velocity"][0, 0, :, 0], found["pressure"][0, 0]
        expected = exact.sample((x - interface) / simulation.time)
        errors.append([np.abs(a - b).mean() / np.ptp(b) for a, b in zip(values, expected, strict=True)])
    assert np.all(np.array(errors[1]) < limits), errors
    assert np.all(np.array(errors[1]) < 0.7 * np.array(errors[0])), errors
