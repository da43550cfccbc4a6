"""Interfaces that are kept sharp: more exact, as wide after any way, and pressure and velocity do not feel it."""

import numpy as np
import pytest
from test_tubes import TUBES

from distfsi.scene.description import Ball, Box, FluidState, Performance, Region
from fluids import AIR, TNT, WATER
from tubes import PERIODIC, advance, fields, scene_of, start

WALLS = ("wall", "symmetry")
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


@pytest.mark.full
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


def test_three_layers_of_ghosts_give_the_same_bits_on_any_cut():
    """A blast in water beside walls, with WENO5: also in blocks that are no wider than their ghosts reach."""
    results = []
    for block, tile in (((24, 24), (24, 24)), ((7, 4), (3, 4))):
        hot = Region(FluidState(1, 100.0, 1e9, (0.0,) * 2), Ball((0.3, 0.2), 0.15))
        regions = (Region(FluidState(0, 1000.0, 1e5, (0.0,) * 2), None), hot)
        method = {"reconstruction": "weno5", "sharpening": True, "performance": Performance(block, tile)}
        scene = scene_of((WATER, AIR), regions, (0.0,) * 2, (1.0,) * 2, (24, 24), 2e-4, (WALLS, PERIODIC), **method)
        results.append(fields(advance(start(scene))))
    for name, values in results[0].items():
        assert np.array_equal(values, results[1][name]), name
