"""Blocks that change hands while a run goes on: how busy each rank is, and a state in the hands of its new owners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.mesh.blocks import Blocks, Snapshot
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.curve import deal

BY_BLOCK = ("cells", "sums")  # kinds of arrays whose rows follow the blocks; particles find their owners themselves


class Balance:
    """Watches the parts of a run: each has `device.seconds`, how long it has computed on this rank, and `workload()`,
    how much there is to do on each local block, in a unit of its own.

    imbalance  computing time of the busiest rank over the mean of all, between the last two calls of `watch`
    """

    def __init__(self, parts: Sequence[Any], blocks: Blocks):
        self._parts, self._blocks = list(parts), blocks
        self._seconds = self._clocks()
        self.imbalance = 1.0

    def watch(self, limit: float) -> np.ndarray | None:
        """Collective. The cost (count,) of each block in seconds, when blocks should change hands, else None.

        They should when the imbalance is above `limit` and another deal would take a third of the excess away or more.
        A block costs what all ranks together have needed per work of each kind.
        """
        clocks = self._clocks()
        spent, self._seconds = clocks - self._seconds, clocks
        communicator = self._blocks.communicator
        every = communicator.concatenate(spent[None])  # (ranks, parts)
        busy = every.sum(axis=1)
        self.imbalance = float(busy.max() / busy.mean()) if busy.mean() > 0.0 else 1.0
        work = communicator.concatenate(np.stack([part.workload() for part in self._parts], axis=1))  # (count, parts)
        total = work.sum(axis=0)
        costs = work @ np.divide(every.sum(axis=0), total, out=np.zeros_like(total), where=total > 0.0)
        if self.imbalance <= limit or not costs.sum() > 0.0:
            return None
        now, then = (
            _excess(costs, owners, communicator.size)
            for owners in (self._blocks.owners, deal(costs, communicator.size))
        )
        return costs if then <= now * 2.0 / 3.0 else None

    def _clocks(self) -> np.ndarray:
        return np.array([part.device.seconds for part in self._parts])


def _excess(costs: np.ndarray, owners: np.ndarray, ranks: int) -> float:
    """By how much the costs of the busiest rank exceed the mean, relative to it."""
    shares = np.bincount(owners, costs, ranks)
    return shares.max() / shares.mean() - 1.0


class Handover:
    """The state of a run that goes on with other owners of its blocks: a restart file that never was.

    time [s], step: of the state; path: the last restart file, or None.
    """

    def __init__(self, time: float, step: int, path: Path | None, snapshots: Mapping[str, Snapshot]):
        """Keeps copies of the snapshots, so that the parts may be thrown away."""
        self.time, self.step, self.path = time, step, path
        self._kept = {
            part: {kind: {name: np.array(array) for name, array in named.items()} for kind, named in snapshot.items()}
            for part, snapshot in snapshots.items()
        }

    def restore(self, parts: Mapping[str, Any], blocks: Blocks, communicator: Communicator) -> None:
        """Collective. Bring back the parts that were kept, each rank the rows of its blocks."""
        for part, snapshot in self._kept.items():
            present = parts[part].snapshot()
            parts[part].restore(
                {
                    kind: {
                        name: communicator.resliced(array, len(present[kind][name])) if kind in BY_BLOCK else array
                        for name, array in named.items()
                    }
                    for kind, named in snapshot.items()
                }
            )
