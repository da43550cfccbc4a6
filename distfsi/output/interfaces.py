"""What the output needs to know of the ranks and of the cut of the domain; `distfsi.mesh` provides both."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from distfsi.coordinates import Coordinates


class Origin(Protocol):
    """What a run goes on from: a state of this time [s] and step, and the last restart file, if there is one."""

    time: float
    step: int
    path: Path | None


class Communicator(Protocol):
    """The ranks of the run."""

    rank: int
    size: int
    world: Any  # what h5py's MPI driver takes

    def broadcast(self, value: Any) -> Any:
        """Rank 0's `value` on every rank."""

    def allgather(self, value: Any) -> list:
        """The values of all ranks, by rank, on every rank."""

    def bring(self, values: Sequence[Any], rank: int) -> list:
        """The `values` of one rank on rank 0; nothing elsewhere."""

    def write_at(self, path: Path, offsets: Sequence[int], arrays: Sequence[np.ndarray]) -> None:
        """Write each of this rank's arrays at its byte offset of an existing file; raises OSError on all ranks."""


class Grid(Protocol):
    """The cells of the domain; x, y, z in this order, one cell on unused axes."""

    @property
    def dimensions(self) -> int: ...

    @property
    def cells(self) -> tuple[int, int, int]: ...

    @property
    def lower(self) -> tuple[float, float, float]: ...

    @property
    def spacing(self) -> tuple[float, float, float]: ...

    @property
    def coordinates(self) -> Coordinates: ...


class Blocks(Protocol):
    """The blocks that the domain is cut into."""

    @property
    def grid(self) -> Grid: ...

    block_cells: tuple[int, int, int]
    origin: np.ndarray  # (own blocks, 3): global index x, y, z of a block's first cell
