"""Gauges in a run: when each samples, the files that its samples go to, and how it goes on after a restart. What it
samples is a matter of its kind (gauges/)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from distfsi.diagnostics.sampling import FluidSampler
from distfsi.diagnostics.watched import Watched
from distfsi.errors import InputError
from distfsi.gauges import Gauge, Layer, LayerProbe, Particles, TableProbe
from distfsi.mesh.blocks import Snapshot
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.fields import FieldWriter, field_faults
from distfsi.output.history import History, history_faults
from distfsi.output.schedule import Every
from distfsi.output.storage import Storage, on_root, storage


class SampledRun:
    """A simulation as gauges see it (gauges.Run)."""

    def __init__(self, simulation: Watched):
        self._simulation = simulation
        self.communicator, self.blocks = simulation.communicator, simulation.blocks
        solid = simulation.scene.solid
        self.bodies: Sequence[str] = [body.name for body in solid.bodies] if solid else []

    @property
    def dt(self) -> float:
        return self._simulation.dt

    @property
    def time(self) -> float:
        return self._simulation.time

    @property
    def ambient_pressure(self) -> float | None:
        return self._simulation.scene.ambient_pressure

    @property
    def particles(self) -> Particles:
        return present(self._simulation.solid)

    def fluid_points(self, positions: np.ndarray) -> FluidSampler:
        return FluidSampler(present(self._simulation.fluid), self._simulation.coupling, positions)

    def fluid_fields(self, chosen: np.ndarray) -> dict[str, np.ndarray]:
        coupling = self._simulation.coupling
        return present(self._simulation.fluid).outputs(coupling.covered if coupling else None, chosen)


class TableFile:
    """Samples of a probe as rows of PATH.csv."""

    def __init__(self, path: Path, probe: TableProbe, communicator: Communicator):
        self._path, self._probe, self._communicator = path.with_suffix(".csv"), probe, communicator
        self._columns = ["time [s]", *probe.columns]
        self._file: History | None = None

    def faults(self, until: float) -> list[str]:
        """What keeps the file from being continued after `until` [s]."""
        return history_faults(self._path, self._columns, until)

    def open(self, until: float) -> None:
        """Collective. Begin the file, or go on after `until` [s]."""
        self._file = History(self._path, self._columns, self._communicator, until)

    def write(self, run: SampledRun, time: float) -> None:
        """Collective. Add a sample."""
        rows = self._probe.rows(run)
        if self._file is None:
            self.open(time)
        present(self._file).extend(np.column_stack([np.full(len(rows), time), rows]).tolist())


class LayerFiles:
    """Samples of a probe as field files in the folder PATH, numbered."""

    def __init__(self, path: Path, probe: LayerProbe, communicator: Communicator, files: Storage):
        self._path, self._probe, self._communicator, self._storage = path, probe, communicator, files
        self._writer: FieldWriter | None = None
        self.number = 0

    def faults(self, until: float) -> list[str]:
        """What keeps the files from being continued after `until` [s]."""
        return field_faults(self._path, until)

    def open(self, until: float) -> None:
        """Collective. Begin the files, or go on after `until` [s]."""
        layer: Layer = self._probe.layer
        self._writer = FieldWriter(self._path, layer, self._communicator, self._storage, until)

    def write(self, run: SampledRun, time: float) -> None:
        """Collective. Add a sample."""
        fields = self._probe.fields(run)
        if self._writer is None:
            self.open(time)
        present(self._writer).write(self.number, time, fields, None)
        self.number += 1


class LayerAndTable(LayerFiles):
    """Samples of a probe as field files in the folder PATH, and rows of PATH.csv."""

    def __init__(self, path: Path, probe: LayerProbe, communicator: Communicator, files: Storage):
        super().__init__(path, probe, communicator, files)
        self._table = TableFile(path, present(probe.table), communicator)

    def faults(self, until: float) -> list[str]:
        return super().faults(until) + self._table.faults(until)

    def open(self, until: float) -> None:
        super().open(until)
        self._table.open(until)

    def write(self, run: SampledRun, time: float) -> None:
        super().write(run, time)
        self._table.write(run, time)


class GaugeRecorder:
    """Samples a run at the first step at or after each multiple of its interval; the samples are in files at once."""

    def __init__(self, name: str, gauge: Gauge, simulation: Watched):
        """Collective, when the simulation has not begun."""
        self.name = f"gauge {name}"
        self._run = SampledRun(simulation)
        self._probe = gauge.probe(self._run)
        self._directory, self._communicator = Path(simulation.scene.output.directory), simulation.communicator
        path, communicator = self._directory / "gauges" / name, self._communicator
        if isinstance(self._probe, TableProbe):
            self._files: TableFile | LayerFiles = TableFile(path, self._probe, communicator)
        elif isinstance(self._probe, LayerProbe):
            files = storage(simulation.scene.output.hdf5, communicator)
            kind = LayerAndTable if self._probe.table else LayerFiles
            self._files = kind(path, self._probe, communicator, files)
        interval = gauge.interval(simulation.scene.time.end)
        self._each_step, self._schedule, self._last = interval == 0.0, Every(interval), 0.0
        self._goes_on = False

    def check(self) -> None:
        """Collective. Raise InputError on all ranks when the files of a restored gauge cannot be continued."""
        faults = on_root(self._communicator, self._directory, lambda: self._files.faults(self._last))
        if self._goes_on and faults:
            raise InputError(faults)

    def after_step(self, simulation: Watched) -> None:
        """Collective. Sample the state after a step, or the one at the start, if it is time."""
        if self._goes_on:
            self._files.open(self._last)
            self._goes_on = False
        self._probe.see(self._run)
        if self._each_step or self._schedule.due(simulation.time):
            self._last = simulation.time
            self._files.write(self._run, simulation.time)

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        number = {"number": np.array([self._files.number])} if isinstance(self._files, LayerFiles) else {}
        return {"values": {"last": np.array([self._last]), **number, **self._probe.kept()}}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot; with the next step samples later than it are dropped."""
        values = snapshot["values"]
        self._last = float(values["last"][0])
        self._schedule.due(self._last)
        self._probe.bring_back(values)
        if isinstance(self._files, LayerFiles):
            self._files.number = int(values["number"][0])
        self._goes_on = True
