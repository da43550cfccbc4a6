"""Which particles are near which: a table of neighbours, found with a search grid."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

import numpy as np

from distfsi.device.cpu import Team


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
        cells = self._fill_cells(position, key, size)
        self.count = np.empty(own, dtype=np.int64)
        width = self.table.shape[1]
        while width > 0:
            self.table = np.empty((own, width), dtype=np.int32)
            self._team.run(self._kernels.find_neighbours, own, position, state, *cells, self.table, self.count)
            most = self.count.max(initial=0)
            width = int(1.2 * most) if most > width else 0

    def _fill_cells(self, position: np.ndarray, key: np.ndarray, size: float) -> tuple[np.ndarray, ...]:
        """Search cell of each particle, start of each cell, particles by cell and key, offsets of the cells around one.

        Only a window of the grid around the particles is held, with an empty cell on each side.
        """
        last = np.ceil((self._upper - self._lower) / size)
        lowest = np.fmin.reduce(position, axis=0, initial=np.inf)
        highest = np.fmax.reduce(position, axis=0, initial=-np.inf)
        low, high = np.clip(np.floor((np.stack([lowest, highest]) - self._lower) / size), -1.0, last)
        window = np.maximum(high - low, 0.0).astype(np.int64) + 3
        strides = np.cumprod([1, *window[:-1]])
        cell, order = np.empty((2, len(position)), dtype=np.int64)
        start = np.zeros(window.prod() + 1, dtype=np.int64)
        run, kernels = self._team.run, self._kernels
        run(kernels.find_cells, len(position), position, self._lower, size, low, high, strides, cell)
        kernels.fill_cells(cell, start, order)
        run(kernels.order_cells, len(start) - 1, start, order, key)
        rows = [np.dot(offset, strides[:0:-1]) for offset in product((-1, 0, 1), repeat=len(strides) - 1)]
        return cell, start, order, np.array(rows, dtype=np.int64)
