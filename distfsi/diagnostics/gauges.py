"""Gauges: what is sampled during a run, each at its own times, in a form that does not depend on the ranks."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import singledispatch
from pathlib import Path

import numpy as np

from distfsi.diagnostics.sampling import AXES, FluidSampler
from distfsi.laws.registry import column_units
from distfsi.mesh.blocks import Grid, Snapshot
from distfsi.output.fields import FieldWriter
from distfsi.output.history import History
from distfsi.output.schedule import Every
from distfsi.output.storage import storage
from distfsi.scene import description

STRESSES = ("xx", "yy", "zz", "xy", "yz", "xz")
UNITS = {
    "position": "m",
    "velocity": "m/s",
    "density": "kg/m3",
    "pressure": "Pa",
    "energy": "J/kg",
    "von_mises": "Pa",
    "stress": "Pa",
    **column_units(),
}


class Gauge(ABC):
    """Samples a run at the first step at or after each multiple of its interval; the samples are in files at once."""

    def __init__(self, gauge: description.Gauge, simulation):
        self.name = f"gauge {gauge.name}"
        self.path = Path(simulation.scene.output.directory) / "gauges" / gauge.name
        self._each_step = gauge.every == 0.0
        self._schedule = Every(gauge.every)
        self._last = 0.0

    def after_step(self, simulation) -> None:
        """Collective. Sample the state after a step, or the one at the start, if it is time."""
        if self._each_step or self._schedule.due(simulation.time):
            self._last = simulation.time
            self.sample(simulation)

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        return {"values": {"last": np.array([self._last])}}

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot; samples later than it are dropped."""
        self._last = float(snapshot["values"]["last"][0])
        self._schedule.due(self._last)
        self.go_on(self._last)

    @abstractmethod
    def sample(self, simulation) -> None:
        """Collective. Write the present state."""

    @abstractmethod
    def go_on(self, time: float) -> None:
        """Collective. Continue the files of an earlier run after `time` [s]."""


class TableGauge(Gauge):
    """A gauge whose samples are rows of NAME.csv."""

    def __init__(self, gauge: description.Gauge, simulation, columns: list[str]):
        super().__init__(gauge, simulation)
        self._columns, self._communicator = ["time [s]", *columns], simulation.communicator
        self._file: History | None = None

    def _open(self, until: float | None = None) -> History:
        return History(self.path.with_suffix(".csv"), self._columns, self._communicator, until)

    @abstractmethod
    def rows(self, simulation) -> np.ndarray:
        """Collective. Rows (n, columns but the time) of the present state, on rank 0 at least."""

    def sample(self, simulation) -> None:
        rows = self.rows(simulation)
        self._file = self._file or self._open()
        self._file.extend(np.column_stack([np.full(len(rows), simulation.time), rows]).tolist())

    def go_on(self, time: float) -> None:
        self._file = self._open(time)


class PointGauge(TableGauge):
    """The fluid at a point."""

    def __init__(self, gauge: description.PointGauge, simulation):
        self._sampler = FluidSampler(simulation.fluid, simulation.coupling, np.array([gauge.position]))
        super().__init__(gauge, simulation, self._sampler.columns)

    def rows(self, simulation) -> np.ndarray:
        return self._sampler.values()


class LineGauge(TableGauge):
    """The fluid at points of a line: a row per point, which begins with its position."""

    def __init__(self, gauge: description.LineGauge, simulation):
        self._positions = np.linspace(gauge.start, gauge.end, gauge.points)
        self._sampler = FluidSampler(simulation.fluid, simulation.coupling, self._positions)
        columns = [f"{axis} [m]" for axis in AXES[: self._positions.shape[1]]]
        super().__init__(gauge, simulation, columns + self._sampler.columns)

    def rows(self, simulation) -> np.ndarray:
        return np.hstack([self._positions, self._sampler.values()])


class ParticleGauge(TableGauge):
    """A particle of a body, wherever it goes; velocities are those of half a step before."""

    def __init__(self, gauge: description.ParticleGauge, simulation):
        solid = simulation.solid
        c = solid.columns
        distance = np.where(c["body"] == gauge.body, ((c["position"] - gauge.position) ** 2).sum(axis=1), np.inf)
        near = np.lexsort((c["id"], distance))[:1]
        candidates = simulation.communicator.concatenate(np.column_stack([distance[near], c["id"][near]]))
        self._id = int(candidates[np.lexsort(candidates.T[::-1])[0], 1])
        # The columns are those of the output, whatever a solid has.
        names = [part for name, array in self._fields(solid, near[:0]).items() for part in self._parts(name, array)]
        super().__init__(gauge, simulation, names)

    def rows(self, simulation) -> np.ndarray:
        fields = self._fields(simulation.solid, np.flatnonzero(simulation.solid.columns["id"] == self._id))
        own = np.column_stack(list(fields.values())).astype(np.float64)
        return simulation.communicator.concatenate(own)

    @staticmethod
    def _fields(solid, chosen: np.ndarray) -> dict[str, np.ndarray]:
        """The output of some particles, without what never changes, vectors with one component per dimension."""
        fields = {name: array for name, array in solid.outputs(chosen).items() if name not in ("id", "body")}
        return fields | {name: fields[name][:, : solid.dimensions] for name in ("position", "velocity")}

    @staticmethod
    def _parts(name: str, array: np.ndarray) -> list[str]:
        """Names and units of the columns of a field."""
        unit = f" [{UNITS[name]}]" if name in UNITS else ""
        if array.ndim == 1:
            return [name + unit]
        return [f"{name}_{part}{unit}" for part in (STRESSES if name == "stress" else AXES[: array.shape[1]])]

    def snapshot(self) -> Snapshot:
        return {"values": {**super().snapshot()["values"], "id": np.array([self._id])}}

    def restore(self, snapshot: Snapshot) -> None:
        super().restore(snapshot)
        self._id = int(snapshot["values"]["id"][0])


class BodyGauge(TableGauge):
    """A body as a whole: the fluid's mean force in the last step, velocity and displacement of its center of mass."""

    def __init__(self, gauge: description.BodyGauge, simulation):
        quantities = {"force": "N", "velocity": "m/s", "displacement": "m", "momentum": "N s"}
        axes = AXES[: simulation.solid.dimensions]
        super().__init__(gauge, simulation, [f"{name}_{a} [{unit}]" for name, unit in quantities.items() for a in axes])
        self._body = gauge.body
        self._start = simulation.solid.body_totals(self._body)["center"]

    def rows(self, simulation) -> np.ndarray:
        totals = simulation.solid.body_totals(self._body)
        force = totals["impulse"] / simulation.dt if simulation.dt > 0.0 else np.full_like(self._start, np.nan)
        velocity = totals["momentum"] / totals["mass"]
        return np.concatenate([force, velocity, totals["center"] - self._start, totals["momentum"]])[None]

    def snapshot(self) -> Snapshot:
        return {"values": {**super().snapshot()["values"], "start": self._start}}

    def restore(self, snapshot: Snapshot) -> None:
        super().restore(snapshot)
        self._start = snapshot["values"]["start"]


@dataclass(frozen=True)
class Layer:
    """One layer of cells of a grid, as blocks for the output."""

    grid: Grid
    block_cells: tuple[int, ...]
    origin: np.ndarray


class PlaneGauge(Gauge):
    """A layer of cells as field files in the folder NAME."""

    def __init__(self, gauge: description.PlaneGauge, simulation):
        super().__init__(gauge, simulation)
        self._blocks, self._axis = simulation.blocks, gauge.axis
        grid, axis = self._blocks.grid, gauge.axis
        cell = math.floor((gauge.position - grid.lower[axis]) / grid.spacing[axis])
        cell = min(max(cell, 0), grid.cells[axis] - 1)
        first, self._cell = cell - cell % self._blocks.block_cells[axis], cell % self._blocks.block_cells[axis]
        self._chosen = np.flatnonzero(self._blocks.origin[:, axis] == first)
        origin = self._blocks.origin[self._chosen].copy()
        origin[:, axis] = 0
        lower = self._with(grid.lower, grid.lower[axis] + cell * grid.spacing[axis])
        thin = replace(grid, cells=self._with(grid.cells, 1), lower=lower)
        self._layer = Layer(thin, self._with(self._blocks.block_cells, 1), origin)
        self._communicator = simulation.communicator
        self._storage = storage(simulation.scene.output.hdf5, simulation.communicator)
        self._writer: FieldWriter | None = None
        self._number = 0

    def _with(self, values: tuple, value: float) -> tuple:
        """`values` per axis, with `value` for the axis that the plane is normal to."""
        return tuple(value if axis == self._axis else v for axis, v in enumerate(values))

    def _open(self, until: float | None = None) -> FieldWriter:
        return FieldWriter(self.path, self._layer, self._communicator, self._storage, until)

    def go_on(self, time: float) -> None:
        self._writer = self._open(time)

    def snapshot(self) -> Snapshot:
        return {"values": {**super().snapshot()["values"], "number": np.array([self._number])}}

    def restore(self, snapshot: Snapshot) -> None:
        super().restore(snapshot)
        self._number = int(snapshot["values"]["number"][0])

    def sample(self, simulation) -> None:
        covered = simulation.coupling.covered if simulation.coupling else None
        fields = simulation.fluid.outputs(covered, self._chosen)
        thin = {name: np.take(field, [self._cell], axis=3 - self._axis) for name, field in fields.items()}
        self._writer = self._writer or self._open()
        self._writer.write(self._number, simulation.time, thin, None)
        self._number += 1


@singledispatch
def gauge_of(gauge: description.Gauge, simulation) -> Gauge:
    """Collective. The gauge that a scene describes, for the parts of `simulation`."""
    raise TypeError(f"no gauge for {gauge}")


for described, kind in (
    (description.PointGauge, PointGauge),
    (description.LineGauge, LineGauge),
    (description.PlaneGauge, PlaneGauge),
    (description.ParticleGauge, ParticleGauge),
    (description.BodyGauge, BodyGauge),
):
    gauge_of.register(described, kind)
