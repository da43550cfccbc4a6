"""What the output needs to know of the ranks and of the cut of the domain; `distfsi.mesh` provides both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from distfsi.coordinates import Coordinates

Fields = Mapping[str, np.ndarray]


class Origin(Protocol):
    """What a run goes on from: a state of this time [s] and step, and the last restart file, if there is one."""

    @property
    def time(self) -> float: ...

    @property
    def step(self) -> int: ...

    @property
    def path(self) -> Path | None: ...


class Simulation(Protocol):
    """The run, between two steps."""

    scene: Any
    time: float
    steps: int

    @property
    def communicator(self) -> Communicator: ...

    @property
    def blocks(self) -> FilledBlocks: ...

    @property
    def timers(self) -> Callable[[str], AbstractContextManager[object]]:
        """Count the time of a part, by its name."""

    def outputs(self) -> tuple[Fields | None, Fields | None]:
        """Collective. Fields of cells and of particles."""


class Table(Protocol):
    """Values of the run over time."""

    columns: list[str]


class Budget(Table, Protocol):
    """Those of the history."""

    def row(self, simulation: Any) -> Mapping[str, float | int | str]:
        """Collective. The values now, by column."""


class Performance(Table, Protocol):
    """Where the time goes."""

    def row(self, step: int, time: float) -> list[float]:
        """Collective. The values of all columns."""


class Communicator(Protocol):
    """The ranks of the run."""

    rank: int
    size: int
    world: Any  # what h5py's MPI driver takes

    def broadcast(self, value: Any) -> Any:
        """Rank 0's `value` on every rank."""

    def allgather(self, value: Any) -> list[Any]:
        """The values of all ranks, by rank, on every rank."""

    def bring(self, values: Sequence[Any], rank: int) -> list[Any]:
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

    @property
    def block_cells(self) -> tuple[int, ...]:
        """Cells of a whole block along x, y, z."""

    @property
    def origin(self) -> np.ndarray:
        """(own blocks, 3): global index x, y, z of a block's first cell."""


class FilledBlocks(Blocks, Protocol):
    """Blocks that may be filled in part."""

    @property
    def extent(self) -> np.ndarray:
        """(own blocks, 3): cells of each along x, y, z."""
