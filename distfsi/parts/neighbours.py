"""Which particles are near which: a table of neighbours, found with a search grid."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from types import SimpleNamespace

import numpy as np

from distfsi.device.cpu import Team
from distfsi.mesh.particles import GhostPlan, Parity
from distfsi.parts.search import sort_particles


@dataclass
class Near:
    """A rank's own particles, then ghosts, then images, as a step finds them.

    plan      how values of own particles get to the ghosts and images
    position  (count, D) [m]
    state     (count, 4 + D) the columns of kernels/solid.py
    support   how far the widest kernel of all ranks reaches [m]
    told      what the solid's form wants to know of ghosts and images besides
    flags     the largest of each of the form's flags over all ranks
    """

    plan: GhostPlan
    position: np.ndarray
    state: np.ndarray
    support: float
    told: list[np.ndarray]
    flags: np.ndarray

    @property
    def own(self) -> int:
        return self.plan.own

    @property
    def vector(self) -> Parity:
        """How the components of a vector change in an image."""
        return tuple((a,) for a in range(self.position.shape[1]))

    @property
    def matrix(self) -> Parity:
        """How the components of a matrix, row by row, change in an image."""
        axes = range(self.position.shape[1])
        return tuple((a, b) for a in axes for b in axes)


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

    def find_among(
        self, rows: np.ndarray, own: int, position: np.ndarray, state: np.ndarray, key: np.ndarray, size: float
    ) -> None:
        """As find(), of the particles `rows` (ascending) alone; the other particles have no neighbours."""
        chosen = int(np.searchsorted(rows, own))
        self.find(chosen, position[rows], state[rows], key[rows], size)
        table, count = np.zeros((own, self.table.shape[1]), dtype=np.int32), np.zeros(own, dtype=np.int64)
        inside = np.arange(self.table.shape[1]) < self.count[:, None]
        table[rows[:chosen]] = rows[np.where(inside, self.table, 0)] if chosen else 0
        count[rows[:chosen]] = self.count
        self.table, self.count = table, count
