"""Rows of arrays that lie on the device: reductions to one number, lists of those that are marked, gathering."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Device

CHUNK = 128  # rows that one thread reduces
FEW = 64  # chunks that are not worth sharing among threads


class Rows:
    """What a part asks of the rows of its arrays; only numbers per chunk of rows get to the host."""

    def __init__(self, device: Device, kernels: SimpleNamespace):
        """`kernels`: the drivers of mesh/kernels/rows.py as built by the device."""
        self.device, self._kernels = device, kernels

    def largest(self, values: Any, floor: float) -> float:
        """The largest of `values` (n,) and `floor`; NaN if there is one."""
        found = self.device.empty(chunks(values.shape[0]), values.dtype)
        self.reduce(self._kernels.find_largest, values.shape[0], values, found)
        return np.max(self.device.download(found), initial=floor)

    def minimum(self, values: Any) -> tuple[float, int]:
        """The smallest of `values` (n,) and its first index, n > 0; a NaN is less than anything."""
        count = values.shape[0]
        smallest, index = self.device.empty(chunks(count), values.dtype), self.device.empty(chunks(count), np.int64)
        self.reduce(self._kernels.find_minimum, count, values, smallest, index)
        values, indices = self.device.download(smallest), self.device.download(index)
        chunk = np.argmin(values)
        return values[chunk], int(indices[chunk])

    def bounds(self, values: Any) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest of each column (k,) of `values` (n, k), without NaN: of no values inf and -inf."""
        count, width = values.shape
        found = self.device.empty((chunks(count), 2 * width))
        self.reduce(self._kernels.find_bounds, count, values.reshape(-1), width, found)
        low, high = np.split(self.device.download(found), 2, axis=1)
        return np.fmin.reduce(low, axis=0, initial=np.inf), np.fmax.reduce(high, axis=0, initial=-np.inf)

    def marked(self, mark: Any) -> tuple[int, Any]:
        """How many of the marks (n,) are not 0, and their rows (count,), ascending, on the device."""
        counts = self._counts(mark)
        count = int(counts.sum())
        rows = self.device.empty(count, np.int64)
        if count:
            first = self.device.array(np.cumsum(counts) - counts)
            self.reduce(self._kernels.list_marked, mark.shape[0], mark, first, rows)
        return count, rows

    def any(self, mark: Any) -> bool:
        """Whether any of the marks (n,) is not 0."""
        return bool(self._counts(mark).any())

    def _counts(self, mark: Any) -> np.ndarray:
        counts = self.device.empty(chunks(mark.shape[0]), np.int64)
        self.reduce(self._kernels.count_marked, mark.shape[0], mark, counts)
        return self.device.download(counts)

    def reduce(self, kernel: Any, rows: int, *arguments: Any) -> None:
        """Run a kernel that takes the number of rows in a chunk first and does a chunk at a time."""
        count = chunks(rows)
        run = self.device.run if count > FEW else self.device.run_few
        run(kernel, count, CHUNK, *arguments)

    def taken(self, values: Any, rows: Any, others: Any = None) -> Any:
        """The `rows` (m,) of `values` (n, …) and, behind them, of `others` of the same type."""
        shape = (rows.shape[0], *values.shape[1:])
        width = int(np.prod(shape[1:]))
        taken, own = self.device.empty(shape, values.dtype), values.shape[0]
        others = self.device.empty(0, values.dtype) if others is None else others
        flat = (values.reshape(-1), others.reshape(-1), taken.reshape(-1))
        self.device.run(self._kernels.take_rows, shape[0], rows, own, width, *flat)
        return taken


class Groups:
    """Sums over groups of rows, the same whatever else there is: in each group by runs of CHUNK rows.

    rows  those of all groups, on the device
    """

    def __init__(self, device: Device, kernels: SimpleNamespace, sizes: np.ndarray, rows: np.ndarray | None = None):
        """`sizes` (groups,): how many `rows` each group has, one group after the other; by default all as they lie."""
        self._device, self._kernels, self._count = device, kernels, len(sizes)
        runs = -(-sizes // CHUNK)
        self._group = np.repeat(np.arange(len(sizes)), runs)
        number = np.arange(len(self._group)) - np.repeat(np.cumsum(runs) - runs, runs)
        first = (np.cumsum(sizes) - sizes)[self._group] + CHUNK * number
        self._first = device.array(np.append(first, sizes.sum()))
        self.rows = device.array(np.arange(sizes.sum()) if rows is None else rows)

    def sums(self, values: Any) -> np.ndarray:
        """Sums (groups, k) of the rows of `values` (n, k); k is 1 for values (n,)."""
        runs, width = len(self._group), values.shape[1] if len(values.shape) > 1 else 1
        sums = self._device.empty((runs, width))
        self._device.run(self._kernels.add_rows, runs, self._first, self.rows, width, values.reshape(-1), sums)
        columns = self._device.download(sums).T
        return np.stack([np.bincount(self._group, column, self._count) for column in columns], axis=1)


def chunks(rows: int) -> int:
    """How many chunks so many rows are."""
    return -(-rows // CHUNK)
