"""A shock lifts a cylinder off the floor: where its centre is, at three resolutions, beside others.

And away from the floor, where it flies along x only, beside computations on meshes fitted to its wall."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.charts import Chart, Curve, draw_charts
from distfsi.scene import load
from distfsi.scene.shipped import shipped_inputs
from distfsi.simulation import Simulation
from distfsi.study import fitted_cylinder, fitted_liftoff
from distfsi.study.references import LIFTOFF
from distfsi.study.tracks import Measure, Tracks, record_tracks, write_tracks

INPUT = shipped_inputs() / "liftoff.toml"
DIRECTORY = Path("out/study_liftoff")
CELLS_ACROSS = (20, 40, 80)  # the channel, which is 0.2 high; twice as many particles
STEPS_BETWEEN_SAMPLES = 5
CYLINDER_CELLS = (10, 20, 40)  # across the cylinder away from the floor
FITTED_CELLS = 100  # around half of it
QUICK_CELLS = 25  # the same of a quick look
RAISED, RAISED_CELLS = 0.01, 50  # height above the floor of one that starts in gas, and cells around half of it


class Surroundings(NamedTuple):
    """What is around a cylinder whose axis lies on the low side: the domain's corners, what its high side is, and
    the mesh of the other computation. Long enough that nothing comes back from the ends."""

    lower: tuple[float, float]
    upper: tuple[float, float]
    high_side: str
    mesh: Callable[[int], np.ndarray]


SURROUNDINGS = {
    "unbounded gas": Surroundings((-0.1, 0.0), (1.0, 0.35), "outflow", fitted_cylinder.unbounded),
    "half a channel": Surroundings((-0.6, 0.0), (1.2, 0.1), "wall", fitted_cylinder.channel),
}


def measure_of(simulation: Simulation) -> Measure:
    """Centre and velocity of the cylinder."""
    solid = present(simulation.solid)

    def measure() -> Mapping[str, float]:
        body = solid.body_totals(0)
        (x, y), (u, v) = body["center"], body["momentum"] / body["mass"]
        return {"x": float(x), "y": float(y), "u": float(u), "v": float(v)}

    return measure


def run(communicator: Communicator, cells: int, overrides: Sequence[str]) -> Tracks:
    """The tracks of a run with so many cells across the channel; its fields are in DIRECTORY. Collective."""
    size = [f"domain.cells=[{5 * cells},{cells}]", f"solid.bodies.cylinder.spacing={0.1 / cells!r}"]
    scene = load(INPUT, [*size, f'output.directory="{DIRECTORY / str(cells)}"', *overrides])
    times = [instant.time for instant in LIFTOFF]
    return record_tracks(scene, communicator, measure_of, STEPS_BETWEEN_SAMPLES, times)


def run_raised(communicator: Communicator, cells: int, overrides: Sequence[str]) -> Tracks:
    """As `run`, of a cylinder that starts above the floor. Collective."""
    x, y = fitted_liftoff.START + (0.0, RAISED)
    names = [f"solid.bodies.cylinder.shape.center=[{x},{y}]", f'output.directory="{DIRECTORY / f"raised_{cells}"}"']
    return run(communicator, cells, [*names, *overrides])


def lift_raised(end: float, cells: int = RAISED_CELLS) -> Tracks:
    """The same by the other computation, with so many cells around half the cylinder."""
    (body,) = present(load(INPUT).solid).bodies
    return fitted_liftoff.lift(RAISED, body.density, end, cells)._asdict()


def throw(communicator: Communicator, around: Surroundings, cells: int, overrides: Sequence[str] = ()) -> Tracks:
    """The tracks of the upper half of a cylinder with so many cells across, which flies along x. Collective."""
    h = 0.1 / cells
    (left, low), (right, high) = around.lower, around.upper
    settings = [
        f"domain.lower=[{left},{low}]",
        f"domain.upper=[{right},{high}]",
        f"domain.cells=[{round((right - left) / h)},{round((high - low) / h)}]",
        f'domain.y=["symmetry","{around.high_side}"]',
        f"fluid.regions.1.shape.lower=[{left},{low}]",
        f"fluid.regions.1.shape.upper=[{fitted_cylinder.SHOCK_START},{high}]",
        f"solid.bodies.cylinder.shape.center=[{fitted_cylinder.CENTRE},{low}]",
        f"solid.bodies.cylinder.spacing={0.5 * h!r}",
        f'output.directory="{DIRECTORY / f"thrown_{cells}"}"',
    ]
    return record_tracks(load(INPUT, [*settings, *overrides]), communicator, measure_of, STEPS_BETWEEN_SAMPLES)


def flight(around: Surroundings, end: float, cells: int = FITTED_CELLS) -> Tracks:
    """The same by the other computation, with so many cells around half the cylinder."""
    (body,) = present(load(INPUT).solid).bodies
    return fitted_cylinder.fly(around.mesh(cells), body.density, end)._asdict()


def centres(tracks: Tracks) -> list[tuple[float, float]]:
    """(x, y) at the times of the references; NaN where the run does not reach them."""
    latest = tracks["time"][-1] * (1.0 + 1e-9)
    times = [r.time if r.time <= latest else np.nan for r in LIFTOFF]
    x, y = (np.interp(times, tracks["time"], tracks[axis]) for axis in "xy")
    return list(zip(x.tolist(), y.tolist(), strict=True))


def row(name: str, positions: Sequence[tuple[float, float]]) -> str:
    """A line of the table."""
    return f"{name:>24}" + "".join(f"   {x:8.4f} {y:8.4f}" for x, y in positions)


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
    """Coarse cells and fitted meshes until the first time."""
    until = f"time.end={LIFTOFF[0].time}"
    _study(communicator, CELLS_ACROSS[:1], [until, *overrides], QUICK_CELLS)
    _compare(communicator, CYLINDER_CELLS[:1], [until, *overrides], QUICK_CELLS)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """All resolutions; print the places of the centre, leave tracks, charts and fields in DIRECTORY."""
    _study(communicator, CELLS_ACROSS, overrides, RAISED_CELLS)
    _compare(communicator, CYLINDER_CELLS, overrides, FITTED_CELLS)


def _study(communicator: Communicator, sizes: Sequence[int], overrides: Sequence[str], fitted: int) -> None:
    runs = {cells: run(communicator, cells, overrides) for cells in sizes}
    raised = {cells: run_raised(communicator, cells, overrides) for cells in sizes[:2]}
    if communicator.rank > 0:
        return
    for cells, tracks in runs.items():
        write_tracks(DIRECTORY / f"tracks_{cells}.csv", tracks)
    draw(runs)
    print(f"{'centre (x, y) at':>24}" + "".join(f"   t = {r.time:<14g}" for r in LIFTOFF))
    print(row("others", [(r.x, r.y) for r in LIFTOFF]))
    for cells, tracks in runs.items():
        print(row(f"h = {0.2 / cells:g}", centres(tracks)))
    print(f"{'raised by ' + format(RAISED, 'g'):>24}")
    print(row("fitted mesh", centres(lift_raised(runs[sizes[0]]["time"][-1], fitted))))
    for cells, tracks in raised.items():
        print(row(f"h = {0.2 / cells:g}", centres(tracks)))
    print(f"tracks, charts and fields in {DIRECTORY}", flush=True)


def _compare(communicator: Communicator, sizes: Sequence[int], overrides: Sequence[str], fitted: int) -> None:
    """Print how far the cylinder has come away from the floor, and its velocity, at the times of the references."""
    for name, around in SURROUNDINGS.items():
        runs = {f"{n} cells across": throw(communicator, around, n, overrides) for n in sizes}
        if communicator.rank > 0:
            continue
        end = next(iter(runs.values()))["time"][-1]
        runs = {"fitted mesh": flight(around, end, fitted), **runs}
        times = [r.time for r in LIFTOFF if r.time <= end * (1.0 + 1e-9)]
        print(f"{name + ': path, speed at':>24}" + "".join(f"   t = {time:<14g}" for time in times))
        for label, t in runs.items():
            found = (
                (np.interp(time, t["time"], t["x"]) - t["x"][0], np.interp(time, t["time"], t["u"])) for time in times
            )
            print(row(label, list(found)), flush=True)
