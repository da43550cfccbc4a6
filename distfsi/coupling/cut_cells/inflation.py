"""Thin bodies are inflated: as which spheres their particles count is kept until these have moved."""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.kernels.interpolation import Cloud
from distfsi.coupling.particles import SolidParticles
from distfsi.mesh.particles import GhostPlan

STALE = 0.1  # of a cell that a particle may go until spheres are found anew: less than they are larger than must be


class ThinBodies:
    """A column "inflation" of the particles: their spheres (coupling/cut_cells/kernels/inflation.py). How thick bodies
    are changes no faster than particles move, so most steps of slow bodies only read it.

    drift  [m] that a particle may have gone along an axis since the column was found; infinite if it is to be found
    """

    def __init__(self, particles: SolidParticles, wall: WallGeometry, cell: float):
        """`cell` [m]: the size of cells."""
        self._particles, self._wall, self._farthest, self.drift = particles, wall, STALE * cell, np.inf
        self._D = wall.blocks.grid.dimensions
        particles.attach("inflation", np.zeros((particles.count, 2 + self._D)))

    def spheres(self, plan: GhostPlan, points: Cloud, split: bool) -> Any:
        """Collective. Spheres (count, 2 + D) of a plan's particles, own ones first, or of the points into which they
        are `split`: those are found in each step. Values of the points: their volumes."""
        vector = tuple((axis,) for axis in range(self._D))
        own = self._particles.read("inflation")
        if split or self.drift > self._farthest:
            chosen = self._wall.coarse_order(points.position, plan.key.device)
            (filled,) = plan.exchange([(self._wall.fill(plan.own, chosen, points), ((), *vector))])
            own = self._wall.inflate(plan.own, filled, chosen, points)
            own = self._wall.spare_thick(points.position, own)
            self.drift = np.inf if split else 0.0
            if not split:
                self._particles.adopt("inflation", own)
        (sphere,) = plan.exchange([(own, ((), (), *vector))])
        return sphere
