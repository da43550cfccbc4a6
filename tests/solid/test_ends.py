"""Ends of the domain: bodies leave through open ones."""

import numpy as np
import pytest

from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.scene.description import Ball
from mpi_solid import body, solid, step

FORMS = ("total_lagrangian", "updated_lagrangian")
SOFT_EOS, SOFT = LinearEos(833.3333), Elastic(384.6154)  # of density 1000: longitudinal waves at 1.16 m/s


def disc(center, velocity):
    return body(Ball(center, 0.2), 0.04, 1000.0, velocity, SOFT_EOS, SOFT)


def whole(part):
    """Momentum and energy, with what has left."""
    totals = part.totals()
    momentum, energy = totals["momentum"] - part.boundary_impulse(), totals["kinetic"] + totals["internal"]
    return np.array([*momentum, energy - part.gravity_work()])


@pytest.mark.parametrize("form", FORMS)
def test_a_body_that_leaves_is_computed_no_longer(form):
    """A disc whose bonds hold goes as a whole, one without them particle by particle; what is left is as if alone."""
    kept = disc((-0.5, 0.0), (0.0, 0.05))
    part = solid([disc((0.7, 0.1), (1.0, 0.3)), kept], (-1.0, -1.0), (1.0, 1.0), form=form)
    before, first, counts = whole(part), int((part.columns["body"] == 0).sum()), set()
    while part.count > first:
        step(part)
        counts.add(part.count)
    assert len(counts) == 2 or form == "updated_lagrangian"
    assert (part.columns["body"] == 1).all()
    assert part.boundary_impulse()[0] == pytest.approx(-before[0], rel=1e-12)
    assert np.abs(whole(part) - before).max() < 1e-12 * before[-1]
    assert np.isnan(part.body_totals(0)["center"]).all() and part.body_totals(0)["mass"] == 0.0
    assert part.columns["velocity"] == pytest.approx(np.tile([0.0, 0.05], (first, 1)), abs=1e-12)


def test_what_hangs_on_stays():
    """Half of a disc is beyond the end, out of reach, and the other half holds it."""
    part = solid([disc((0.75, 0.0), (1.0, 0.0))], (-1.0, -1.0), (1.0, 1.0), form="total_lagrangian")
    count, farthest = part.count, 0.0
    while farthest < 1.3:
        step(part)
        farthest = part.columns["position"][:, 0].max()
    assert farthest - 2.0 * 2.0 * 1.3 * 0.04 > 1.0
    assert part.count == count
