"""Periodic ends carry bodies round: what is beyond one comes in at the other."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.rows import Rows
from distfsi.scene.description import Domain


class PeriodicEnds:
    """What bonds hold together goes as a whole, once the middle of it is beyond an end: so no bond ever changes. Other
    particles go one by one."""

    def __init__(self, kernels: SimpleNamespace, device: Device, communicator: Communicator, domain: Domain):
        """`kernels` holds the DRIVERS of solid/open_ends.py."""
        self._kernels, self._device, self._communicator = kernels, device, communicator
        self._rows = Rows(device, kernels)
        self._lower, self._upper = np.array(domain.lower), np.array(domain.upper)
        self._axes = [axis for axis, ends in enumerate(domain.boundaries) if "periodic" in ends]
        self.there = bool(self._axes)
        periodic = np.isin(np.arange(domain.dimensions), self._axes)
        ends = np.stack([np.where(periodic, self._lower, -np.inf), np.where(periodic, self._upper, np.inf)], axis=1)
        self._ends = device.array(ends.ravel())

    def passed(self, columns: Columns) -> bool:
        """Collective. Whether a particle is beyond an end."""
        (position,) = columns.read("position")
        mark = self._device.empty(position.shape[0], np.int8)
        self._device.run(self._kernels.mark_beyond, position.shape[0], position, self._ends, mark)
        return bool(self._communicator.maximum(np.array([float(self._rows.any(mark))]))[0])

    def carry(self, columns: Columns) -> None:
        """Collective, after passed(), with the labels of the pieces up to date. Set back what has gone round."""
        name, x = -1 - columns["id"], columns["position"]
        if "piece" in columns:
            name = np.where(columns["piece"] >= 0, columns["piece"], name)
        for axis in self._axes:
            lower, upper = self._lower[axis], self._upper[axis]
            beyond = (x[:, axis] < lower) | (x[:, axis] > upper)
            passing = np.unique(self._communicator.concatenate(np.unique(name[beyond])))
            rows = np.flatnonzero(np.isin(name, passing))
            low, high = self._extents(passing, name[rows], x[rows, axis])
            middle = 0.5 * (low + high)
            way = (upper - lower) * ((middle < lower).astype(float) - (middle > upper))
            x[rows, axis] += way[np.searchsorted(passing, name[rows])]
        columns.changed("position")

    def _extents(self, names: np.ndarray, name: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Collective. The least and the largest x [m] of each of the `names`, of particles that have a `name` (n,)."""
        ends, number = np.full((2, len(names)), -np.inf), np.searchsorted(names, name)
        np.maximum.at(ends[0], number, -x)
        np.maximum.at(ends[1], number, x)
        low, high = self._communicator.maximum(ends.ravel()).reshape(2, -1)
        return -low, high
