"""Plates that meet at any angle to the axes, with slip and without."""

import math

import numpy as np
import pytest

from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.scene.composed import Similarity, placed
from distfsi.scene.description import Box
from distfsi.scene.turns import rotation
from mpi_solid import body, solid, step

LENGTH, SPEED, DENSITY, YOUNG = 0.1, 10.0, 7850.0, 207e9
SOUND = math.sqrt(YOUNG / DENSITY)  # Poisson's ratio is 0, so that free sides do not matter
STRESS = 0.5 * DENSITY * SOUND * SPEED


def stresses(angle, slip):
    """Normal and shear stress (n,) over the exact normal one behind both waves, of plates turned by an angle [rad] that
    meet without friction and slip past each other [m/s]."""
    turn = rotation(2, angle)
    normal, along = turn.T
    eos, strength, motion = LinearEos(YOUNG / 3.0), Elastic(YOUNG / 2.0), Similarity.about((0.0, 0.0), turn)
    bodies = [
        body(placed(Box((low, -0.02), (high, 0.02)), motion), 0.0025, DENSITY, velocity, eos, strength)
        for low, high, velocity in ((-LENGTH, 0.0, SPEED * normal + slip * along), (5e-6, LENGTH, (0.0, 0.0)))
    ]
    part, time = solid(bodies, (-0.2, -0.2), (0.2, 0.2), form="total_lagrangian", viscosity=(0.5, 1.0)), 0.0
    while time < 0.6 * LENGTH / SOUND:
        time += step(part)[0]
    c = part.columns
    x, y = np.abs(c["position"] @ normal), np.abs(c["position"] @ along)
    behind = (x > 0.1 * LENGTH) & (x < 0.4 * LENGTH) & (y < 0.012)
    (xx, yy, xy), p = c["deviator"][behind].T, c["pressure"][behind]
    tensor = np.array([[xx - p, xy], [xy, yy - p]])
    order = np.argsort(c["id"][behind])
    pressing, shear = (np.einsum("i,ijk,j->k", normal, tensor, way)[order] / STRESS for way in (normal, along))
    return -pressing, shear


def test_no_angle_and_no_slip_changes_the_stress():
    """Plates across the axes bear it within 1 % (test_contact.py); here free sides are nearer."""
    straight, shear = stresses(0.0, 0.0)
    assert straight.mean() == pytest.approx(1.0, abs=0.02)
    turned, _ = stresses(0.3, 0.0)
    assert turned == pytest.approx(straight, abs=1e-3)
    slipping, rubbed = stresses(math.pi / 4.0, 2.0 * SPEED)
    assert slipping.mean() == pytest.approx(straight.mean(), abs=0.005)
    assert np.sqrt(np.mean((slipping - straight) ** 2)) < 0.02
    assert np.sqrt(np.mean((rubbed - shear) ** 2)) < 0.02
