"""Whole solids against exact and agreed answers, coarse here, fine in the full tier (values: study/solids.py)."""

import pytest

from distfsi.study import solids


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


def test_copper_plates():
    assert missed(solids.FLYER, 1e-4) == []


def test_an_imploding_shell_stops_where_its_plastic_work_says():
    assert missed(solids.VERNEY, 4e-3) == []


@pytest.mark.full
@pytest.mark.parametrize("settings", [FORMS[:1], (FORMS[1], "solid.viscosity_alpha=0")])
def test_an_imploding_shell_finely(settings):
    assert missed(solids.VERNEY, 2e-3, *settings) == []


@pytest.mark.full
def test_the_cantilever_swings_with_timoshenkos_period():
    assert missed(solids.CANTILEVER, 1e-3) == []
