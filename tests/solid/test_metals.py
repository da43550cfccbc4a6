"""Whole solids against exact and agreed answers, coarse here, fine in the full tier (values: study/solids.py)."""

import numpy as np
import pytest

from distfsi.solid import solid as solid_part
from distfsi.study import frontier, solids, stability_solid


def missed(problem, spacing, *settings):
    """The figures that do not hold."""
    simulation = problem.start(spacing, settings)
    return [(f.name, f"{f.found:.6g}", f"{f.error:+.2%}") for f in problem.measure(simulation) if not f.held]


FORMS = ("solid.form=total_lagrangian", "solid.form=updated_lagrangian")


@pytest.mark.parametrize("form", FORMS)
def test_an_elastic_plastic_piston(form):
    assert missed(solids.PISTON, 1e-4, form) == []


@pytest.mark.full
@pytest.mark.parametrize("form", FORMS)
def test_an_elastic_plastic_piston_finely(form):
    assert missed(solids.PISTON, 2.5e-5, form) == []


@pytest.mark.parametrize("form", FORMS)
def test_copper_plates(form):
    assert missed(solids.FLYER, 1e-4, form) == []


@pytest.mark.parametrize("impact", [50.0, 500.0])
@pytest.mark.parametrize("form", FORMS)
def test_nothing_swings_behind_a_weak_shock(form, impact):
    """The plateau is at rest within a hundredth of the plates' speed [m/s]."""
    speeds = [f"solid.bodies.{side}.velocity={sign * 0.5 * impact}" for side, sign in (("left", 1), ("right", -1))]
    simulation = solids.FLYER.start(1e-4, [form, *speeds])
    while not simulation.done:
        simulation.step()
    columns = simulation.solid.columns
    plateau = np.abs(np.abs(columns["position"][:, 0]) - 2.5e-3) < 1.5e-3
    assert np.abs(columns["velocity"][plateau, 0]).max() < 0.01 * 0.5 * impact


@pytest.mark.parametrize("form", FORMS)
def test_an_imploding_shell_stops_where_its_plastic_work_says(form):
    assert missed(solids.VERNEY, 4e-3, form) == []


@pytest.mark.full
@pytest.mark.parametrize("form", FORMS)
def test_an_imploding_shell_finely(form):
    assert missed(solids.VERNEY, 2e-3, form) == []


@pytest.mark.full
@pytest.mark.parametrize("packing", ["rings", "lattice"])
def test_a_taylor_bar(packing):
    assert missed(solids.TAYLOR, 1.07e-3, f"solid.bodies.bar.packing={packing}") == []


@pytest.mark.full
def test_the_cantilever_swings_with_timoshenkos_period():
    assert missed(solids.CANTILEVER, 1e-3) == []


# ---- the studies -----------------------------------------------------------------------------------------------------


def test_the_frontier_keeps_what_nothing_beats():
    def outcome(variant, seconds, error):
        return frontier.Outcome(variant, 1.0, 1, 1, seconds, (solids.Figure("a", 1.0 + error, 1.0, 0.1),))

    found = [
        outcome("slow", 3.0, 0.1),
        outcome("fast", 1.0, 0.3),
        outcome("beaten", 2.0, 0.4),
        outcome("best", 4.0, 0.01),
    ]
    found.append(frontier.Outcome("failed", 1.0, 1, 1, float("nan"), (), "diverged"))
    assert [o.variant for o in frontier.front(found)] == ["fast", "slow", "best"]


def test_stretched_plates_stay_whole_with_bonds_alone():
    bonds, updated = (stability_solid.FORMS[name] for name in ("total Lagrangian", "updated Lagrangian"))
    assert stability_solid.stretched(bonds, 0.6, 1.0) == (stability_solid.SURVIVED, "")
    verdict, why = stability_solid.stretched(updated, 0.6, 1.0)
    assert (verdict, why.endswith("pieces")) == (stability_solid.BROKEN, True)


@pytest.mark.parametrize("angle", [pytest.param(0.0, marks=pytest.mark.full), 40.0])
def test_discs_of_copper_at_1_km_s_do_not_get_into_each_other(monkeypatch, angle):
    """As the study of stability judges; without contact it finds that they do."""
    bonds = stability_solid.FORMS["total Lagrangian"]
    assert stability_solid.oblique(bonds, 1000.0, angle) == (stability_solid.SURVIVED, "")
    monkeypatch.setattr(solid_part, "contacts_of", lambda *_: [])
    assert stability_solid.oblique(bonds, 1000.0, angle)[0] == stability_solid.PASSED
