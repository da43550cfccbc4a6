"""Which particles are near which: a table of neighbours, found with a search grid."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

import numpy as np

from distfsi.device.cpu import Team
from distfsi.parts.search import sort_particles


class NeighbourSearch:
    """Finds neighbours with a grid of search cells from the corner `lower` to `upper` [m], the same on all ranks.

    table  (own, width) int32: the neighbours of each particle, search cell by search cell, in the order of their keys
    count  (own,): how many there are
    """

    def __init__(self, kernels: SimpleNamespace, team: Team, lower: tuple[float, ...], upper: tuple[float, ...]):
        self._kernels, self._team = kernels, team
        self._lower, self._upper = np.array(lower), np.array(upper)
        self.table = np.empty((0, 4 * 6 ** (len(lower) - 1)), dtype=np.int32)
        self.count = np.empty(0, dtype=np.int64)

    def find(self, own: int, position: np.ndarray, state: np.ndarray, key: np.ndarray, size: float) -> None:
        """Find the neighbours, closer than h_i + h_j, of the first `own` particles, with search cells of `size` [m]."""
        cell, cells = sort_particles(self._kernels, self._team, position, key, self._lower, self._upper, size)
        across = cells.strides[1 : position.shape[1]]  # rows of three cells lie along x
        rows = np.array([np.dot(step, across) for step in product((-1, 0, 1), repeat=len(across))], dtype=np.int64)
        search = (position, state, cell, cells.start, cells.order, np.sort(rows))
        self.count = np.empty(own, dtype=np.int64)
        width = self.table.shape[1]
        while width > 0:
            self.table = np.empty((own, width), dtype=np.int32)
            self._team.run(self._kernels.find_neighbours, own, *search, self.table, self.count)
            most = self.count.max(initial=0)
            width = int(1.2 * most) if most > width else 0
