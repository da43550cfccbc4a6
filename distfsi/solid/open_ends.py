"""Ends of the domain through which bodies leave: `outflow` and `inflow`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.rows import Rows
from distfsi.scene.description import Domain
from distfsi.solid.kernels import motion

DRIVERS = (motion.mark_beyond,)
MARGIN = 2.0  # how far beyond an end particles are out of reach, in their own


class OpenEnds:
    """Finds the particles that have left: those out of reach beyond an open end, with all that bonds hold to them."""

    def __init__(self, kernels: SimpleNamespace, device: Device, communicator: Communicator, domain: Domain):
        self._kernels, self._device, self._communicator = kernels, device, communicator
        self._rows, open_ends = Rows(device, kernels), np.isin(np.array(domain.boundaries), ("outflow", "inflow"))
        self.there = bool(open_ends.any())
        self._ends = np.where(open_ends, np.stack([domain.lower, domain.upper], axis=1), [-np.inf, np.inf])

    def passed(self, columns: Columns, reach: float) -> np.ndarray:
        """The rows (n,) of this rank's particles that are out of `reach` [m] beyond an open end."""
        (position,) = columns.read("position")
        ends = self._device.array((self._ends + MARGIN * reach * np.array([-1.0, 1.0])).ravel())
        mark = self._device.empty(position.shape[0], np.int8)
        self._device.run(self._kernels.mark_beyond, position.shape[0], position, ends, mark)
        return self._device.download(self._rows.marked(mark)[1])

    def left(self, columns: Columns, passed: np.ndarray) -> np.ndarray:
        """Collective. Of the rows that have `passed` an end those (n,) that have left."""
        if "piece" not in columns:
            return passed
        piece, behind = columns["piece"], np.ones(len(columns["id"]), dtype=bool)
        behind[passed] = False
        leaving = self._communicator.concatenate(np.unique(piece[passed]))
        held = np.unique(piece[behind & (piece >= 0) & np.isin(piece, leaving)])
        return passed[~np.isin(piece[passed], self._communicator.concatenate(held))]
