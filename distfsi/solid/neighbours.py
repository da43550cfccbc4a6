"""Which particles are near which: a table of neighbours, found with a search grid."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Device
from distfsi.mesh import search
from distfsi.mesh.kernels import rows as row_kernels
from distfsi.mesh.particles import GhostPlan
from distfsi.mesh.rows import Rows
from distfsi.solid.kernels import neighbours as kernels
from distfsi.solid.kernels.records import Neighbours, Particles

Components = tuple[tuple[int, ...], ...]  # of each component the axes whose reflection changes its sign: a parity

DRIVERS = (*search.DRIVERS, kernels.find_neighbours, kernels.scatter_neighbours, row_kernels.find_largest)


@dataclass
class Near:
    """A rank's own particles, then ghosts, then images, as a step finds them; arrays are the device's.

    plan      how values of own particles get to the ghosts and images
    position  (count, D) [m]
    state     (count, 4 + D) packed, with the columns of solid/kernels/records.py
    support   how far the widest kernel of all ranks reaches [m]
    payload   what the solid's form wants to know of ghosts and images besides
    flags     the largest of each of the form's flags over all ranks
    """

    plan: GhostPlan
    position: Any
    state: Any
    support: float
    payload: list[Any]
    flags: np.ndarray

    @property
    def own(self) -> int:
        """How many particles are this rank's own."""
        return self.plan.own

    @property
    def particles(self) -> Particles:
        """Positions and states, for kernels."""
        return Particles(self.position, self.state)

    @property
    def vector(self) -> Components:
        """How the components of a vector change in an image."""
        return tuple((a,) for a in range(self.position.shape[1]))

    @property
    def matrix(self) -> Components:
        """How the components of a matrix, row by row, change in an image."""
        axes = range(self.position.shape[1])
        return tuple((a, b) for a in axes for b in axes)

    @property
    def tensor(self) -> Components:
        """How the components of a symmetric tensor change in an image."""
        axes = range(self.position.shape[1])
        return tuple((a, a) for a in axes) + tuple((a, b) for a in axes for b in axes if a < b)


class NeighbourSearch:
    """Finds neighbours with a grid of search cells from the corner `lower` to `upper` [m], the same on all ranks."""

    def __init__(self, kernels: SimpleNamespace, device: Device, lower: tuple[float, ...], upper: tuple[float, ...]):
        """`kernels` holds DRIVERS."""
        self._kernels, self._device, self._rows = kernels, device, Rows(device, kernels)
        self._cells = search.CellSort(kernels, device, lower, upper)
        self._width = 4 * 6 ** (len(lower) - 1)
        self._table = device.empty((0, self._width), np.int32)  # kept, as fresh memory costs more than the search

    def find(self, own: int, particles: Particles, key: Any, size: float) -> Neighbours:
        """The neighbours of the first `own` particles, closer than h_i + h_j, search cell by search cell of `size` [m],
        in the order of their keys. The table (own, width) int32 of the device lasts until the next call.
        """
        cell, cells = self._cells.sort(particles.position, key, size)
        across = self._cells.strides[1 : particles.position.shape[1]]  # rows of three cells lie along x
        rows = np.array([np.dot(step, across) for step in product((-1, 0, 1), repeat=len(across))], dtype=np.int64)
        near = (particles, cell, cells.start, cells.order, self._device.array(np.sort(rows)))
        count = self._device.empty(own, np.int64)
        while True:
            if self._table.shape != (own, self._width):
                self._table = self._device.empty((own, self._width), np.int32)
            found = Neighbours(self._table, count)
            self._device.run(self._kernels.find_neighbours, own, *near, found)
            maximum = self._rows.largest(count, 0)
            if maximum <= self._width:
                return found
            self._width = int(1.2 * maximum)

    def find_among(self, rows: Any, own: int, particles: Particles, key: Any, size: float) -> Neighbours:
        """As find(), of the particles `rows` (ascending, on the device) alone, of which the first are among the `own`;
        the others have no neighbours."""
        chosen = int(np.searchsorted(self._device.download(rows), own))
        position, state, key = (self._rows.taken(array, rows) for array in (*particles, key))
        among = self.find(chosen, Particles(position, state), key, size)
        found = Neighbours(self._device.empty((own, self._width), np.int32), self._device.zeros(own, np.int64))
        self._device.run(self._kernels.scatter_neighbours, chosen, rows, among, found)
        return found
