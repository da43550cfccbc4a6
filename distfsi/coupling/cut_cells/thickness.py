"""Thin bodies are thickened: as which balls their particles count is kept until these have moved."""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.device.interface import Columns
from distfsi.mesh.particles import GhostPlan
from distfsi.mesh.search import SearchCells

STALE = 0.1  # of a cell that a particle may go until balls are found anew: less than they are larger than must be


class Thickness:
    """A column "ball" of the particles (coupling/cut_cells/kernels/wall_distance.py: thicken). How thick bodies are
    changes no faster than particles move, so most steps of slow bodies only read it.

    way  [m] that a particle may have gone along an axis since the column was found; infinite if it is to be found
    """

    def __init__(self, columns: Columns, wall: WallGeometry, cell: float):
        """`cell` [m]: the size of cells."""
        self._wall, self._farthest, self.way = wall, STALE * cell, np.inf
        self._D = wall.blocks.grid.dimensions
        columns["ball"] = np.zeros((len(columns["id"]), 2 + self._D))

    def balls(self, c: Columns, plan: GhostPlan, position: Any, volume: Any, bins: SearchCells, split: bool) -> Any:
        """Collective. Balls (count, 2 + D) of a plan's particles, own ones with the columns `c` first, or of the points
        into which they are `split`: those are found in each step."""
        vector = tuple((axis,) for axis in range(self._D))
        (own,) = c.read("ball")
        if split or self.way > self._farthest:
            given = (self._wall.coarse_order(position, plan.key.device), position, volume, bins)
            (filled,) = plan.exchange([(self._wall.fill(plan.own, *given), ((), *vector))])
            own = self._wall.thicken(plan.own, filled, *given)
            self.way = np.inf if split else 0.0
            if not split:
                c.adopt("ball", own)
        (ball,) = plan.exchange([(own, ((), (), *vector))])
        return ball
