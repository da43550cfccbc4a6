"""Ends of the domain of kind "wall" hold bodies: rigid planes without friction."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.scene.description import Domain
from distfsi.solid.kernels import walls as kernels
from distfsi.solid.neighbours import Near

DRIVERS = (kernels.press_walls, kernels.heat_walls)
UNKNOWN = -1e300  # nearer than can be: wherever a particle is first, it may stay


class Walls:
    """Contact of particles with the walls, as with their mirror images.

    widening       0: they look at no other particles
    wall_touching  (n,) distance from a wall, in half spacings, at which it begins to press: a column of the solid. Less
                   than 1: the particle has been so near since the start
    """

    widening = 0.0

    def __init__(self, kernels: SimpleNamespace, device: Device, domain: Domain):
        walled = np.array(domain.boundaries) == "wall"
        ends = np.where(walled, np.stack([domain.lower, domain.upper], axis=1), [-np.inf, np.inf])
        self._kernels, self._device, self._ends = kernels, device, device.array(ends.ravel())
        self._force: Any = None  # of the last accelerate()

    def bind(self, columns: Columns) -> None:
        """Add the column."""
        columns["wall_touching"] = np.full(len(columns["id"]), UNKNOWN)

    def accelerate(self, columns: Columns, near: Near, acceleration: Any) -> None:
        """Add the `acceleration` (own, D) [m/s2] by the walls."""
        self._force = self._device.empty(acceleration.shape)
        given = (near.particles, self._ends, *columns.write("wall_touching"), self._force, acceleration)
        self._device.run(self._kernels.press_walls, near.own, *given)

    def heat(self, columns: Columns, near: Near, dt: float, velocity: Any) -> None:
        """Advance the energy by the work against the walls in `dt` [s], with the new `velocity` (count, D) [m/s]."""
        given = (near.particles, self._force, velocity, *columns.write("energy"))
        self._device.run(self._kernels.heat_walls, near.own, dt, *given)
