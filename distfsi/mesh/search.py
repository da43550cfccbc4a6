"""Particles sorted into the cells of a search grid, in one order on any number of ranks."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Device
from distfsi.mesh.kernels import rows as row_kernels
from distfsi.mesh.kernels import search as kernels
from distfsi.mesh.kernels.search import Bins
from distfsi.mesh.rows import Rows

DRIVERS = (kernels.find_cells, kernels.fill_cells, kernels.order_cells, row_kernels.find_bounds)


class CellSort:
    """Sorts particles into the cells of grids from `lower` to `upper` (D,) [m]; those outside fall into the cells next
    to it.

    strides  (3,) those of the last window, on the host
    """

    def __init__(
        self, kernels: SimpleNamespace, device: Device, lower: Sequence[float], upper: Sequence[float]
    ) -> None:
        """`kernels` holds DRIVERS."""
        self._kernels, self._device, self._rows = kernels, device, Rows(device, kernels)
        self._lower, self._upper = np.array(lower), np.array(upper)
        self._corner = device.array(self._lower)
        self.strides = np.ones(3, dtype=np.int64)

    def sort(self, position: Any, key: Any, size: float) -> tuple[Any, Bins]:
        """The search cell of each particle, and the cells of `size` [m]; `position` (n, D) [m], `key` (n,)."""
        device, kernels, count = self._device, self._kernels, position.shape[0]
        last = np.ceil((self._upper - self._lower) / size)
        low, high = np.clip(np.floor((np.stack(self._rows.bounds(position)) - self._lower) / size), -1.0, last)
        window = np.maximum(high - low, 0.0).astype(np.int64) + 3
        self.strides = np.cumprod([1, *window[:-1], *[1] * (3 - len(window))])
        cell, order = device.empty(count, np.int64), device.empty(count, np.int64)
        start = device.empty(window.prod() + 1, np.int64)
        low, high, window, strides = (device.array(a) for a in (low, high, window, self.strides))
        device.run(kernels.find_cells, count, position, self._corner, size, low, high, strides, cell)
        device.run_few(kernels.fill_cells, 1, cell, start, order)
        device.run(kernels.order_cells, start.shape[0] - 1, start, order, key)
        return cell, Bins(start, order, self._corner, size, low, window, strides)
