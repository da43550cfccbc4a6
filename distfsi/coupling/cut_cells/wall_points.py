"""The points whose smoothed volumes make the wall: the particles, and more where bonds hold a stretched body."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.particles import SolidParticles
from distfsi.mesh.rows import Rows

FARTHEST = 1.25  # between points, in units of half a cell or of the particles' spacing, if that is more
LONGEST = 6  # points along each axis of a particle
PER_PARTICLE = LONGEST**3


class WallPoints:
    """A particle that bonds hold fills its cube of the reference state as it is deformed: there are points along the
    principal axes of its deformation, so many that no gap shows in a body that is whole. Any other particle is one.

    Only particles that are stretched so far come to the host.
    """

    def __init__(self, particles: SolidParticles, rows: Rows, kernels: SimpleNamespace, cell: float):
        """`cell` [m]: the size of cells."""
        self._particles, self._rows, self._device = particles, rows, rows.device
        self._kernels, self._cell = kernels, cell

    def stretched(self) -> Any:
        """The rows (n,) of this rank's particles that are more than one point."""
        mark, bonds = self._device.zeros(self._particles.count, np.int8), self._particles.bonds
        if bonds:
            count = mark.shape[0]
            self._device.run(self._kernels.mark_stretched, count, self._cell, FARTHEST, *bonds, mark)
        return self._rows.marked(mark)[1]

    def volumes(self) -> Any:
        """Of this rank's particles (own, 1) [m^D], none of lone ones."""
        p = self._particles
        volume = self._device.empty((p.count, 1))
        self._device.run(self._kernels.find_volumes, p.count, p.read("lone"), p.mass, p.density, volume)
        return volume

    def of(self, stretched: Any) -> tuple[Any, Any, np.ndarray]:
        """Position (n, D) [m] and volume (n, 1) [m^D], on the device, and number (n,) of the points of this rank's
        particles, of which the `stretched` ones are split."""
        position, volume, own = self._particles.position, self.volumes(), self._particles.count
        number, bonds = self._particles.id * PER_PARTICLE, self._particles.bonds
        if stretched.shape[0] == 0 or bonds is None:
            return position, volume, number
        whole = (position, volume, bonds.volume, bonds.deformation)
        points = self._split(*(self._device.download(self._rows.taken(array, stretched)) for array in whole))
        rows = self._device.download(stretched)
        others = np.delete(np.arange(own), rows)
        chosen = self._device.array(np.concatenate([others, own + np.arange(len(points[0]))]))
        position, volume = (
            self._rows.taken(all, chosen, self._device.array(new))
            for all, new in zip((position, volume), points[:2], strict=True)
        )
        parent, rank = points[2:]
        return position, volume, np.concatenate([number[others], number[rows][parent] + rank])

    def _split(
        self, position: np.ndarray, volume: np.ndarray, reference: np.ndarray, deformation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Positions (m, D) and volumes (m, 1) of the points of particles (n, …) whose volume was `reference`; which of
        them each point is of, and its rank among the particle's."""
        # how long a particle is along its principal axes
        n, D = position.shape
        side = reference ** (1.0 / D)
        farthest = FARTHEST * np.maximum(0.5 * self._cell, side)
        F = deformation.reshape(-1, D, D)
        stretches, axes = np.linalg.eigh((F[:, :, None, :] * F[:, None, :, :]).sum(axis=-1))
        length = side[:, None] * np.sqrt(np.maximum(stretches, 0.0))
        # how many points there are along each
        count = np.clip(np.ceil(length / farthest[:, None]), 1, LONGEST).astype(np.int64)
        step = axes * (np.minimum(length, LONGEST * farthest[:, None]) / count)[:, None, :]
        points = count.prod(axis=1)
        parent = np.repeat(np.arange(n), points)
        rank = np.arange(len(parent)) - np.repeat(np.cumsum(points) - points, points)
        # where they are
        point, rest = position[parent], rank
        for axis in range(D):
            along = rest % count[parent, axis] - 0.5 * (count[parent, axis] - 1)
            point = point + along[:, None] * step[parent, :, axis]
            rest = rest // count[parent, axis]
        return point, (volume / points[:, None])[parent], parent, rank
