"""Rows that go from rank to rank, each rank telling the others how many it sends."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from distfsi.mesh.communicator import Communicator


class Route:
    """Who sends how many rows to whom: found once, then used for any number of transfers."""

    def __init__(self, communicator: Communicator, ranks: np.ndarray) -> None:
        """Collective. `ranks` (n,) ascending: where each of the rows to come goes; never this rank."""
        self._world = communicator.world
        leaving = np.bincount(ranks, minlength=communicator.size)
        arriving = np.empty_like(leaving)
        self._world.Alltoall(leaving, arriving)
        self._leaving, self._arriving = self._slices(leaving), self._slices(arriving)
        self.leaving, self.arriving = len(ranks), int(arriving.sum())

    @staticmethod
    def _slices(counts: np.ndarray) -> list[tuple[int, slice]]:
        ends = np.cumsum(counts)
        return [(int(r), slice(ends[r] - counts[r], ends[r])) for r in np.flatnonzero(counts)]

    def transfer(self, rows: np.ndarray, arrived: np.ndarray) -> None:
        """Send `rows` (n, …); those from all others arrive in rank order, of the same type. One message per pair."""
        requests = [self._world.Irecv(arrived[part].view(np.uint8), rank) for rank, part in self._arriving]
        requests += [self._world.Isend(rows[part].view(np.uint8), rank) for rank, part in self._leaving]
        MPI.Request.Waitall(requests)

    def brought(self, columns: dict[str, np.ndarray]) -> np.ndarray:
        """Send the rows (n, …) of all columns as one structured array; those that arrive, as another."""
        dtype = [(name, column.dtype, column.shape[1:]) for name, column in columns.items()]
        rows, arrived = np.empty(self.leaving, dtype), np.empty(self.arriving, dtype)
        for name, column in columns.items():
            rows[name] = column
        self.transfer(rows, arrived)
        return arrived
