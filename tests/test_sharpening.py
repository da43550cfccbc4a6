"""Interfaces that are kept sharp: more exact, as wide after any way, and pressure and velocity do not feel it."""

import numpy as np
import pytest

from distfsi.scene.description import Ball, Box, FluidState, Region
from fluids import AIR, TNT, WATER
from test_tubes import TUBES
from tubes import PERIODIC, advance, fields, scene_of, start

SHARP = {"reconstruction": "van_leer", "sharpening": True}


def test_water_against_dense_air():
    """1000 cells: the error of the density is halved, those of velocity and pressure are no larger."""
    tube = TUBES["water | dense air"]
    smeared, sharp = (tube.run(1000, reconstruction="van_leer", sharpening=on).errors() for on in (False, True))
    assert (sharp <= smeared * (0.5, 1.0, 1.0)).all()


@pytest.mark.parametrize("eos", [(WATER, AIR), (TNT, AIR)], ids=["water-air", "products-air"])
@pytest.mark.parametrize("speed", [0.0, 1000.0])
def test_an_interface_keeps_its_balance_and_its_width(eos, speed):
    """Twice around a periodic domain: velocity and pressure stay uniform, and an interface takes at most four cells."""
    regions = (
        Region(FluidState(1, 1.2, 1e5, (speed,)), None),
        Region(FluidState(0, 1000.0 if eos[0] is WATER else 1.0, 1e5, (speed,)), Box((0.3,), (0.7,))),
    )
    scene = scene_of(eos, regions, (0.0,), (1.0,), (100,), 2e-3 if speed else 2e-4, (PERIODIC,), **SHARP)
    simulation = advance(start(scene))
    found = fields(simulation)
    assert np.abs(found["velocity"][..., 0] - speed).max() <= 1e-10 * max(speed, 1.0)
    stiff = 4.4 * 6e8 if eos[0] is WATER else 1e5
    assert np.abs(found["pressure"] - 1e5).max() <= 1e-12 * max(1000.0 * speed**2, stiff) * np.sqrt(simulation.steps)
    mixed = (found["volume_fraction"] > 0.01) & (found["volume_fraction"] < 0.99)
    assert np.count_nonzero(mixed) <= 2 * 4


def test_a_disc_moves_along_the_diagonal():
    """Once around: less than half of the error in shape without sharpening, velocity and pressure uniform."""
    speed, errors = 1000.0, []
    for on in (False, True):
        disc = Region(FluidState(0, 1000.0, 1e5, (speed,) * 2), Ball((0.5, 0.5), 0.25))
        regions = (Region(FluidState(1, 1.2, 1e5, (speed,) * 2), None), disc)
        method = {"reconstruction": "van_leer", "sharpening": on}
        scene = scene_of((WATER, AIR), regions, (0.0,) * 2, (1.0,) * 2, (32, 32), 1e-3, (PERIODIC,) * 2, **method)
        simulation = start(scene)
        before = fields(simulation)["volume_fraction"]
        found = fields(advance(simulation))
        errors.append(np.abs(found["volume_fraction"] - before).sum() / before.sum())
        assert np.abs(found["velocity"][..., :2] - speed).max() <= 1e-10 * speed
        assert np.abs(found["pressure"] - 1e5).max() <= 1e-12 * 4.4 * 6e8 * np.sqrt(simulation.steps)
    assert errors[1] < 0.5 * errors[0]
