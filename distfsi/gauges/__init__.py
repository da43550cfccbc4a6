"""What a gauge is: a frozen dataclass in a file of this folder, named by the word that chooses it in the input.

Its fields carry unit, range and meaning as those of a law (laws/law.py); table, schema and reference of the input
follow from them. When a run begins `probe` gives what samples it; when samples are due, the files they go to, and
restarts are the same for all kinds (diagnostics/gauges.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from distfsi.laws.law import Law, quantity

AXES = "xyz"
Kept = Mapping[str, np.ndarray]


def each_step() -> Any:
    """The field `every` of a gauge that samples each step unless the input says otherwise."""
    return quantity("s", "time between samples; default each step", default=None, above=0.0)


def each_hundredth() -> Any:
    """The field `every` of a gauge that by default takes a hundred samples."""
    return quantity("s", "time between samples; default a hundredth of the run", default=None, above=0.0)


def per_extent(unit: str, extents: int) -> str:
    """A unit of what has fewer than three extents: per metre, or per square metre, of the others."""
    return unit + ("/m2", "/m", "")[extents - 1]


class Gauge(Law):
    """A gauge of any kind.

    needs     what it samples: "fluid" or "solid"
    per_step  whether it samples each step where the input does not say how often; else a hundredth of the run
    every     time between samples [s], or None
    """

    folder = "gauges"
    needs: ClassVar[str] = "fluid"
    per_step: ClassVar[bool] = True
    every: float | None

    def interval(self, end: float) -> float:
        """Time between samples [s] in a run until `end` [s]; 0: each step."""
        return self.every or (0.0 if self.per_step else end / 100)

    def positions(self) -> Mapping[str, Mapping[int, float]]:
        """Keys of positions in the fluid, each with its coordinate [m] by axis."""
        return {}

    def location(self, axes: str = AXES) -> str:
        """Where it is, in words: "x = 1 m"; `axes`: their names."""
        words = []
        for key, position in self.positions().items():
            values = [f"{x:g}" for x in position.values()]
            words.append(f"{key} ({', '.join(values)}) m" if len(values) > 1 else f"{key} {_one(position, axes)} m")
        return " ".join(words).removeprefix("position ")

    def walls(self) -> Mapping[str, tuple[int, int]]:
        """Keys of ends of the domain that must be walls, each with axis and side (0: low, 1: high)."""
        return {}

    def faults(self, dimensions: int, bodies: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Keys whose values do not fit into a scene, each with what is wrong with it."""
        yield from ()

    def probe(self, run: Run) -> Probe:
        """Collective. What samples the run, which begins."""
        raise NotImplementedError


def _one(position: Mapping[int, float], axes: str) -> str:
    ((axis, x),) = position.items()
    return f"{axes[axis]} = {x:g}"


class FluidPoints(Protocol):
    """The fluid at fixed points; `columns` are names with units."""

    columns: list[str]

    def values(self) -> np.ndarray:
        """Collective. The values (n, columns) at the points now, on every rank; NaN in covered cells."""


class PressureRecord:
    """What a blast does at some points: overpressure and its impulse, from sample to sample by the trapezoidal rule.

    Overpressure counts from the ambient pressure of the run or, where fluid lies at rest in layers, from what is there
    at first; time without a value (nan), in a body, does not count.
    """

    columns = ("overpressure [Pa]", "impulse [Pa s]")

    def __init__(self, points: int):
        self._time, self._ambient = np.zeros(1), np.full(points, np.nan)
        self._before, self._impulse = np.zeros(points), np.zeros(points)

    def of(self, run: Run, pressures: np.ndarray) -> np.ndarray:
        """Overpressure and impulse (n, 2) at the points, whose pressures (n,) [Pa] are sampled now."""
        if run.ambient_pressure is not None:
            self._ambient[:] = run.ambient_pressure
        self._ambient = np.where(np.isnan(self._ambient), pressures, self._ambient)
        overpressure = pressures - self._ambient
        now = np.nan_to_num(overpressure)
        self._impulse = self._impulse + 0.5 * (run.time - self._time) * (self._before + now)
        self._before, self._time = now, np.array([run.time])
        return np.stack([overpressure, self._impulse], axis=1)

    def kept(self) -> Kept:
        """What a restart needs."""
        return {"at": self._time, "ambient": self._ambient, "before": self._before, "impulse": self._impulse}

    def bring_back(self, kept: Kept) -> None:
        """Go on from what was kept."""
        self._time, self._ambient = kept["at"], kept["ambient"]
        self._before, self._impulse = kept["before"], kept["impulse"]


class Particles(Protocol):
    """The particles of this rank."""

    dimensions: int

    @property
    def columns(self) -> Mapping[str, np.ndarray]:
        """What is known of each."""

    def outputs(self, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """The fields of the rows that are `chosen`, vectors with three components."""

    def body_totals(self, body: int) -> dict[str, np.ndarray]:
        """Collective. mass [kg], center of mass, momentum of a body, and the fluid's impulse on it in the last step."""

    def wall_impulse(self) -> np.ndarray:
        """Collective. Impulse (D, 2, D) [N s] that bodies have given to each wall of the domain, by axis and side."""


class Run(Protocol):
    """What a gauge may ask of a run.

    communicator  all ranks
    blocks        the fluid's cells: `grid`, `block_cells`, and the global index `origin` (own blocks, 3) of the first
                  cell of each
    bodies        names of the bodies
    """

    communicator: Any
    blocks: Any
    bodies: Sequence[str]

    @property
    def time(self) -> float:
        """[s] now."""

    @property
    def ambient_pressure(self) -> float | None:
        """[Pa] that overpressure counts from; None: from the pressure that is at a place when the run begins."""

    @property
    def dt(self) -> float:
        """[s] of the last step; 0 before the first."""

    @property
    def particles(self) -> Particles:
        """Of the solid."""

    def fluid_points(self, positions: np.ndarray) -> FluidPoints:
        """The fluid at positions (n, D) [m]."""

    def fluid_fields(self, chosen: np.ndarray) -> dict[str, np.ndarray]:
        """Collective. The fields of cells, as they are written, of local blocks that are `chosen`."""


class Probe:
    """Samples a run for one gauge."""

    def see(self, run: Run) -> None:
        """Collective. Look at the state after each step, and at that at the start, before it may be sampled."""

    def kept(self) -> Kept:
        """What a restart needs of it, by name."""
        return {}

    def bring_back(self, kept: Kept) -> None:
        """Go on from what was kept."""


class TableProbe(Probe):
    """Samples are rows of a table; `columns` are names with units, without the time."""

    columns: list[str]

    def rows(self, run: Run) -> np.ndarray:
        """Collective. Rows (n, columns) of the present state, on rank 0 at least."""
        raise NotImplementedError


@dataclass(frozen=True)
class Layer:
    """Cells of a grid, as blocks for the output."""

    grid: Any
    block_cells: tuple[int, ...]
    origin: np.ndarray


class LayerProbe(Probe):
    """Samples are fields of some cells: those of a `layer`."""

    layer: Layer
    table: TableProbe | None = None  # of what goes into a table besides

    def fields(self, run: Run) -> dict[str, np.ndarray]:
        """Collective. The fields of the layer's blocks now."""
        raise NotImplementedError
