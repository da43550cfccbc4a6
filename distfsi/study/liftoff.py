"""A shock lifts a cylinder off the floor: where its centre is, at three resolutions, beside others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from distfsi.mesh.communicator import Communicator
from distfsi.output.charts import Chart, Curve, draw_charts
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.study.references import LIFTOFF
from distfsi.study.tracks import Measure, Tracks, follow, write_tracks

INPUT = Path(__file__).parents[2] / "inputs" / "liftoff.toml"
DIRECTORY = Path("out/study_liftoff")
CELLS_ACROSS = (20, 40, 80)  # the channel, which is 0.2 high; twice as many particles
STEPS_BETWEEN_SAMPLES = 5


def measure_of(simulation: Simulation) -> Measure:
    """Centre and velocity of the cylinder."""

    def measure() -> Mapping[str, float]:
        body = simulation.solid.body_totals(0)
        (x, y), (u, v) = body["center"], body["momentum"] / body["mass"]
        return {"x": float(x), "y": float(y), "u": float(u), "v": float(v)}

    return measure


def run(communicator: Communicator, cells: int, overrides: Sequence[str]) -> Tracks:
    """The tracks of a run with so many cells across the channel; its fields are in DIRECTORY. Collective."""
    size = [f"domain.cells=[{5 * cells},{cells}]", f"solid.bodies.cylinder.spacing={0.1 / cells!r}"]
    scene = load(INPUT, [*size, f'output.directory="{DIRECTORY / str(cells)}"', *overrides])
    times = [instant.time for instant in LIFTOFF]
    return follow(scene, communicator, measure_of, STEPS_BETWEEN_SAMPLES, times)


def centres(tracks: Tracks) -> list[tuple[float, float]]:
    """(x, y) at the times of the references; NaN where the run does not reach them."""
    latest = tracks["time"][-1] * (1.0 + 1e-9)
    return [
        tuple(float(np.interp(r.time, tracks["time"], tracks[axis])) if r.time <= latest else np.nan for axis in "xy")
        for r in LIFTOFF
    ]


def row(name: str, places: Sequence[tuple[float, float]]) -> str:
    """A line of the table."""
    return f"{name:>24}" + "".join(f"   {x:8.4f} {y:8.4f}" for x, y in places)


def draw(runs: Mapping[int, Tracks]) -> None:
    """Paths of the centre, and its height over time; references as dots."""
    time, x, y = (np.array([getattr(r, name) for r in LIFTOFF]) for name in ("time", "x", "y"))
    paths = [Curve(t["x"], t["y"], f"h = {0.2 / cells:g}") for cells, t in runs.items()]
    heights = [Curve(t["time"], t["y"], f"h = {0.2 / cells:g}") for cells, t in runs.items()]
    charts = [
        Chart("path of the centre", "x", "y", [*paths, Curve(x, y, "others", "ko")]),
        Chart("its height", "time", "y", [*heights, Curve(time, y, "others", "ko")]),
    ]
    draw_charts(DIRECTORY / "tracks.png", charts, columns=2)


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Coarse cells until the first time."""
    _study(communicator, CELLS_ACROSS[:1], [f"time.end={LIFTOFF[0].time}", *overrides])


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """All resolutions; print the places of the centre, leave tracks, charts and fields in DIRECTORY."""
    _study(communicator, CELLS_ACROSS, overrides)


def _study(communicator: Communicator, sizes: Sequence[int], overrides: Sequence[str]) -> None:
    runs = {cells: run(communicator, cells, overrides) for cells in sizes}
    if communicator.rank > 0:
        return
    for cells, tracks in runs.items():
        write_tracks(DIRECTORY / f"tracks_{cells}.csv", tracks)
    draw(runs)
    print(f"{'centre (x, y) at':>24}" + "".join(f"   t = {r.time:<14g}" for r in LIFTOFF))
    print(row("others", [(r.x, r.y) for r in LIFTOFF]))
    for cells, tracks in runs.items():
        print(row(f"h = {0.2 / cells:g}", centres(tracks)))
    print(f"tracks, charts and fields in {DIRECTORY}", flush=True)
