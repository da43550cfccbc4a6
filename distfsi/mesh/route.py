"""Rows that go from rank to rank, each rank telling the others how many it sends."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

from distfsi.device.interface import Device
from distfsi.mesh.communicator import Communicator


class Route:
    """Who sends how many rows to whom: found once, then used for any number of transfers."""

    def __init__(self, communicator: Communicator, ranks: np.ndarray, givers: np.ndarray | None = None) -> None:
        """`ranks` (n,) ascending: where each of the rows to come goes; never this rank. `givers` (m,), too: where each
        of the rows that arrive comes from; collective without them."""
        self._world = communicator.world
        leaving = np.bincount(ranks, minlength=communicator.size)
        if givers is None:
            arriving = np.empty_like(leaving)
            self._world.Alltoall(leaving, arriving)
        else:
            arriving = np.bincount(givers, minlength=communicator.size)
        self._leaving, self._arriving = self._slices(leaving), self._slices(arriving)
        self.leaving, self.arriving = len(ranks), int(arriving.sum())

    @staticmethod
    def _slices(counts: np.ndarray) -> list[tuple[int, int, int]]:
        ends = np.cumsum(counts)
        return [(int(r), int(ends[r] - counts[r]), int(ends[r])) for r in np.flatnonzero(counts)]

    def transfer(self, rows: Any, arrived: Any, width: int) -> None:
        """Send flat `rows` of so many values each; those from all others arrive in rank order, of the same type. One
        message per pair. Memory of a device must be at rest."""
        parts = partial(self._parts, width=width)
        requests = [self._world.Irecv(part, rank) for rank, part in parts(arrived, self._arriving)]
        requests += [self._world.Isend(part, rank) for rank, part in parts(rows, self._leaving)]
        MPI.Request.Waitall(requests)

    def carry(self, device: Device, width: int, real: np.dtype, pack: Callable[[Any], None]) -> tuple[Any, Any]:
        """As transfer(), from and to the memory of a device: pack(rows) writes the flat rows, of so many values
        each, that leave. Returns those that arrive, on the device, and the memory that it may still read them from."""
        leaving, arriving = (device.message_memory(n * width, real) for n in (self.leaving, self.arriving))
        packed, arrived = device.staging_array(leaving), device.staging_array(arriving)
        with device.asynchronous():
            pack(packed)
            device.download_to(leaving, packed)
        device.finish_asynchronous()
        self.transfer(leaving, arriving, width)
        with device.asynchronous():
            device.upload(arrived, arriving)
        device.join_asynchronous()
        return arrived, arriving

    @staticmethod
    def _parts(rows: Any, slices: list[tuple[int, int, int]], width: int) -> list[tuple[int, Any]]:
        return [(rank, rows[first * width : end * width]) for rank, first, end in slices]

    def brought(self, columns: dict[str, np.ndarray]) -> np.ndarray:
        """Send the rows (n, …) of all columns as one structured array; those that arrive, as another."""
        dtype = [(name, column.dtype, column.shape[1:]) for name, column in columns.items()]
        rows, arrived = np.empty(self.leaving, dtype), np.empty(self.arriving, dtype)
        for name, column in columns.items():
            rows[name] = column
        self.transfer(rows.view(np.uint8), arrived.view(np.uint8), rows.itemsize)
        return arrived
