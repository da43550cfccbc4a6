"""The studies of the fluid's methods at their quick size, and what they stand on."""

import csv
from dataclasses import dataclass

import numpy as np
import pytest

from distfsi.commands.line import main
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.mesh.communicator import Communicator
from distfsi.output.scatter import Point, draw_scatter
from distfsi.study import choices, exact_cases, frontier_fluid, stability_fluid
from distfsi.study.exact import PureState
from distfsi.study.problems import EXPLOSION, PROBLEMS, SOD
from distfsi.study.radial import cylindrical_explosion
from distfsi.study.references import UNDEX_2D, WATER


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_choices_are_those_of_the_schema():
    found = choices.choices()
    assert found["fluid.riemann"][0] == choices.default()["fluid.riemann"]
    assert {"hllc", "hll", "rusanov", "adaptive"} <= set(found["fluid.riemann"])
    assert {"rk2", "rk3"} == set(found["time.scheme"])
    assert len(list(choices.varied_alone())) == sum(len(words) - 1 for words in found.values())
    assert choices.exists({"fluid.riemann": "hll"}) and not choices.exists({"fluid.riemann": "nothing"})
    assert choices.name_of({"fluid.riemann": "hll", "fluid.switch": "true", "time.other": "false"}) == (
        "hll switch no other"
    )


@dataclass(frozen=True)
class Result:
    seconds: float
    error: float
    errors: object = ()


def test_the_front_holds_what_nothing_beats_in_both():
    a, b, c, failed = Result(1.0, 0.5), Result(2.0, 0.6), Result(3.0, 0.1), Result(0.1, np.nan, None)
    assert frontier_fluid.front([c, b, a, failed]) == [a, c]


def test_radial_computation_agrees_with_an_independent_one():
    """Rings of 2 mm: radii within 0.2 %, plateaus within 0.5 % of the table."""
    for reference in (r for r in UNDEX_2D if r.points):
        sides = PureState(1630.0, 7.81e9), PureState(1000.0, 1e5), StiffenedGas(1.4, 0.0), WATER
        rings = cylindrical_explosion(*sides, reference.charge, 1.0, reference.time, 2e-3)
        gas = round(reference.charge / 2e-3)
        assert rings.edges[gas] == pytest.approx(reference.interface, rel=1e-3)
        shock = rings.edges[1 + np.flatnonzero(rings.pressure > 1.5e9)[-1]]
        assert shock == pytest.approx(reference.shock, rel=2e-3)
        for radius, pressure, velocity, _ in reference.points:
            if abs(radius - reference.interface) < 0.15 and pressure > 1e9:
                _, u, p = rings.sample(np.array([radius]))
                assert (p[0], u[0]) == (pytest.approx(pressure, rel=5e-3), pytest.approx(velocity, rel=5e-3))


def test_rings_keep_mass_and_energy():
    sides = PureState(1630.0, 7.81e9), PureState(1000.0, 1e5), StiffenedGas(1.4, 0.0), WATER
    before, after = (cylindrical_explosion(*sides, 0.5, 1.0, time, 1e-2) for time in (0.0, 1e-4))
    energies = []
    for rings in (before, after):
        gamma, p_inf = (np.where(np.arange(100) < 50, a, b) for a, b in ((1.4, 4.4), (0.0, 6e8)))
        area = 0.5 * np.diff(rings.edges**2)
        inner = (rings.pressure + gamma * p_inf) / (gamma - 1.0)
        energies.append(np.sum(area * (inner + 0.5 * rings.density * rings.velocity**2)))
        assert np.sum(area * rings.density) == pytest.approx(0.125 * 1630.0 + 0.375 * 1000.0, rel=1e-13)
    assert energies[1] == pytest.approx(energies[0], rel=1e-13)


def test_points_are_drawn(tmp_path):
    points = [Point(1.0, 0.1, "a", "one", True), Point(2.0, 0.01, "b", "two", True), Point(3.0, 1.0, "c", "two")]
    path = draw_scatter(tmp_path / "s.png", "t", "x", "y", points, points[:1], [(1.5, "peer")])
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.full
def test_frontier(tmp_path, monkeypatch, capsys):
    """Every problem has a front, finer is better, and first order is worse than the default in every problem."""
    monkeypatch.setattr(frontier_fluid, "DIRECTORY", tmp_path)
    frontier_fluid.quick(Communicator(), [])
    rows = rows_of(tmp_path / "frontier.csv")
    for problem in PROBLEMS:
        assert (tmp_path / f"{problem.name}.png").exists()
        mine = {row["method"]: row for row in rows if row["problem"] == problem.name}
        assert any(row["on the front"] == "yes" for row in mine.values())
        assert float(mine["first_order"]["error"]) > 1.5 * float(mine["default"]["error"])
        assert all(row["failure"] == "" and float(row["seconds"]) > 0.0 for row in mine.values())
    assert capsys.readouterr().out.count("front:") == len(PROBLEMS)


def test_a_variant_that_fails_says_why():
    variant = frontier_fluid.Variant("none", "none", {"fluid.riemann": "none"})
    outcome = frontier_fluid.measure(SOD, variant, 20, [])
    assert np.isnan(outcome.error) and "riemann" in outcome.failure


def test_errors_fall_with_cells_on_the_explosion():
    errors = []
    for cells in (20, 40):
        outcome = frontier_fluid.measure(EXPLOSION, frontier_fluid.Variant("", "", {}), cells, [])
        errors.append(outcome.error)
    assert errors[1] < 0.7 * errors[0]


def test_stability(tmp_path, monkeypatch):
    """The ends of the maps with the default method: no failure up to a CFL number of 0.9."""
    monkeypatch.setattr(stability_fluid, "DIRECTORY", tmp_path)
    stability_fluid.quick(Communicator(), [])
    rows = rows_of(tmp_path / "stability.csv")
    assert len(rows) == 4 * len(stability_fluid.MAPS)
    assert all(row["verdict"] != "failed" for row in rows if float(row["CFL number"]) <= 0.9)
    for shown in stability_fluid.MAPS:
        assert (tmp_path / f"{shown.name}.png").exists()


@pytest.mark.full
def test_exact_cases(capsys):
    """The quick size: a line for each case, the shock in Sod's tube within a cell, none broken up but HLLC's."""
    exact_cases.quick(Communicator(), [])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 + len(exact_cases.TUBES) + len(exact_cases.BLASTS) + 4
    assert abs(float(lines[2].split()[1])) < 1.0
    adaptive, hllc = (float(line.split()[-2]) for line in lines[-2:])
    assert adaptive < 1e-5 < 1e-1 < hllc


@pytest.mark.full
def test_the_default_has_no_failed_field():
    """All maps whole up to a CFL number of 0.9."""
    for shown in stability_fluid.MAPS:
        for row in shown.rows:
            for column in shown.columns:
                if shown.cfl_of(column) <= 0.9:
                    verdict = stability_fluid.judge(shown.tube(row, column), shown.cfl_of(column), {})
                    assert verdict.number != stability_fluid.FAILED, (shown.name, row, column, verdict.why)


@pytest.mark.parametrize("words", [["study", "frontier"], ["study", "nothing", "at", "all"]])
def test_an_unknown_study_is_refused(words):
    with pytest.raises(Exception, match="no such study"):
        main(words)
