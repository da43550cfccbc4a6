"""Ends of the domain of kind "wall" hold bodies: rigid planes, with friction or without."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.mesh.rows import Rows
from distfsi.scene.description import Domain
from distfsi.solid.kernels import walls as kernels
from distfsi.solid.neighbours import Near

DRIVERS = (kernels.press_walls, kernels.load_walls, kernels.heat_walls)
UNKNOWN = -1e300  # nearer than can be: wherever a particle is first, it may stay


class Walls:
    """Contact of particles with the walls, as with their mirror images.

    widening       0: they look at no other particles
    wall_touching  (n,) distance from a wall, in half spacings, at which it begins to press: a column of the solid. Less
                   than 1: the particle has been so near since the start
    impulse        (local blocks, 2 D D) impulse [N s] on each wall, low and high across each axis, since the start
    """

    widening = 0.0

    def __init__(self, kernels: SimpleNamespace, device: Device, rows: Rows, domain: Domain, local_blocks: int):
        walled = np.array(domain.boundaries) == "wall"
        ends = np.where(walled, np.stack([domain.lower, domain.upper], axis=1), [-np.inf, np.inf])
        self._kernels, self._device, self._rows, self._ends = kernels, device, rows, device.array(ends.ravel())
        self.impulse = np.zeros((local_blocks, 2 * domain.dimensions**2))
        self._force = self._mark = device.empty(0)  # of the last accelerate()

    def bind(self, columns: Columns) -> None:
        """Add the column."""
        columns["wall_touching"] = np.full(len(columns["id"]), UNKNOWN)

    def accelerate(self, columns: Columns, near: Near, acceleration: Any) -> None:
        """Add the `acceleration` (own, D) [m/s2] by the walls."""
        own, D = acceleration.shape
        self._force, self._mark = self._device.empty((own, D * D)), self._device.empty(own, np.int8)
        given = (near.particles, self._ends, *columns.write("wall_touching"), self._force, self._mark, acceleration)
        self._device.run(self._kernels.press_walls, own, *given)

    def account(self, dt: float, sums: Callable[[Any], np.ndarray]) -> None:
        """After accelerate(). Add the impulse of `dt` [s]; `sums` gives those of values (own, k) by block (local
        blocks, k)."""
        if self._rows.any(self._mark):
            own = self._force.shape[0]
            load = self._device.empty((own, self.impulse.shape[1]))
            self._device.run(self._kernels.load_walls, own, dt, self._force, load)
            self.impulse += sums(load)

    def heat(self, columns: Columns, near: Near, dt: float, velocity: Any) -> None:
        """Advance the energy by the work against the walls in `dt` [s], with the new `velocity` (count, D) [m/s]."""
        given = (near.particles, self._force, velocity, *columns.write("energy"))
        self._device.run(self._kernels.heat_walls, near.own, dt, *given)
