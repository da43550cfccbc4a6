"""Tracks of waves and interfaces through a run, measured in memory every few steps, and what is made of them."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.diagnostics.sampling import FluidSampler
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.fields import FieldWriter
from distfsi.output.progress import Progress
from distfsi.scene.description import Scene
from distfsi.simulation import Simulation

Tracks = dict[str, np.ndarray]  # by name, one value per sample; "time" [s] among them
Measure = Callable[[], Mapping[str, float]]


class Line:
    """Equidistant points between two places in the fluid, and the fluid there.

    distance: (points,) [m] from the start
    """

    def __init__(self, simulation: Simulation, start: Sequence[float], end: Sequence[float], points: int):
        positions = np.linspace(start, end, points)
        self.distance = np.linalg.norm(positions - positions[0], axis=1)
        self._sampler = FluidSampler(present(simulation.fluid), simulation.coupling, positions)

    def values(self) -> dict[str, np.ndarray]:
        """Collective. Pressure, density, velocity components and volume fraction of the first phase at the points."""
        names = [column.split(" ")[0] for column in self._sampler.columns]
        return dict(zip(names, self._sampler.values().T, strict=True))


def crossing(position: np.ndarray, values: np.ndarray, level: float) -> float:
    """Where `values`, linear between points, first pass `level`, in the order of the points; NaN: nowhere."""
    above = values > level
    passed = np.flatnonzero(above[1:] != above[:-1])
    if not len(passed):
        return np.nan
    i = passed[0]
    share = (level - values[i]) / (values[i + 1] - values[i])
    return float(position[i] + share * (position[i + 1] - position[i]))


def velocity(time: np.ndarray, position: np.ndarray, window: tuple[float, float]) -> float:
    """Slope of the straight line fitted to a track within a window of time; NaN when the run ends before its middle."""
    inside = (time >= window[0]) & (time <= window[1]) & np.isfinite(position)
    covered = inside.any() and time[-1] >= window[0] + 0.5 * (window[1] - window[0])
    return float(np.polyfit(time[inside], position[inside], 1)[0]) if covered and inside.sum() > 2 else np.nan


def record_tracks(
    scene: Scene,
    communicator: Communicator,
    measure_of: Callable[[Simulation], Measure],
    every: int,
    pictures: Sequence[float] = (),
) -> Tracks:
    """Run the scene; what `measure_of(simulation)` measures at the start, after `every` so many steps and at the end.

    Field files are written into the scene's output directory at the times `pictures` [s]. Collective. Raises Diverged.
    """
    samples, waiting = [], sorted(pictures)
    with closing(Progress(scene.time.end, communicator)) as progress, threadpool_limits(1):
        simulation = Simulation.of(scene, communicator)
        measure = measure_of(simulation)
        files = FieldWriter(Path(scene.output.directory), simulation.blocks, communicator)
        while True:
            if simulation.steps % every == 0 or simulation.done:
                samples.append({"time": simulation.time, **measure()})
            if waiting and simulation.time >= waiting[0]:
                files.write(len(pictures) - len(waiting), simulation.time, *simulation.outputs())
                waiting.pop(0)
            if simulation.done:
                break
            simulation.step()
            progress.update(simulation.steps, simulation.time, simulation.dt, simulation.limited_by)
    return {name: np.array([sample[name] for sample in samples]) for name in samples[0]}


def write_tracks(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of equal length as CSV with five digits."""
    with path.open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(columns)
        rows.writerows([f"{value:.5g}" for value in row] for row in zip(*columns.values(), strict=True))
