"""The shock that hits a cylinder of helium (paper, Sec. 5.1): tracks, velocities, pictures, speed.

The input is without dimensions: lengths in mm, pressure and density of the air at rest are one. Here velocities are in
m/s and times in us after the shock has met the bubble, as in the experiment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt
from pathlib import Path

import numpy as np

from distfsi.fluid.fluid import Fluid
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import of_kind, present
from distfsi.output.charts import Chart, Curve, Picture, draw_charts, draw_pictures
from distfsi.output.fields import read_cells, series
from distfsi.scene import load
from distfsi.scene.description import Ball, HalfSpace, Scene
from distfsi.scene.shipped import shipped_inputs
from distfsi.simulation import Simulation
from distfsi.study.references import SHOCK_BUBBLE
from distfsi.study.tracks import Line, Measure, Tracks, crossing, record_tracks, velocity, write_tracks

INPUT = shipped_inputs() / "shock_bubble.toml"
DIRECTORY = Path("out/study_shock_bubble")
GASES = {
    "pure": (),
    "contaminated": ("fluid.regions.2.density=0.182", "fluid.phases.helium.gamma=1.648"),  # Haas and Sturtevant
}

SOUND_SPEED = 343.3  # of the experiment's air [m/s]
METRES_PER_SECOND = SOUND_SPEED / sqrt(1.4)  # a unit of velocity of the input
MICROSECONDS = 1e3 / METRES_PER_SECOND  # a unit of time of the input
MAP_TIMES = (67.6, 180.4)  # pictures of the paper's Fig. 6 [us]
SCHLIEREN_TIMES = (62.0, 82.0, 245.0, 257.0)  # and Fig. 7
STEPS_BETWEEN_SAMPLES = 5
FRONT = 1.1  # pressure that marks a shock, above the 1 of the air at rest
SCHLIEREN_CONTRAST = 15.0
PICTURED = (100.0, 275.0)  # from where to where along x [mm]

NOTE = """The experiment's helium held 28 % of air by mass: compare it with "contaminated". The paper took pure helium.
Its Table 1 mixes up two names: V_di is the downstream interface, V_j the jet, which is the upstream interface on the
axis. Its shock is one of Mach 1.22, not 1.5, and its helium at the pressure of the air, not at 10.8 times that.
VR and Vj need more than 100 cells across the bubble; Vs, VT and Vdi do not."""


def bubble_of(scene: Scene) -> tuple[float, float]:
    """Upstream and downstream edge of the bubble at the start [mm]."""
    ball = of_kind(Ball, present(scene.fluid).regions[-1].shape)
    return ball.center[0] + ball.radius, ball.center[0] - ball.radius


def arrival_of(scene: Scene) -> float:
    """When the incident shock meets the bubble [units of time of the input], exact."""
    outer, inner = present(scene.fluid).regions[:2]
    rest, shocked, edge = outer.state, inner.state, of_kind(HalfSpace, inner.shape)
    speed = shocked.density * abs(shocked.velocity[0]) / (shocked.density - rest.density)
    return (edge.point[0] - bubble_of(scene)[0]) / speed


def measure_of(simulation: Simulation) -> Measure:
    """What is followed: shocks on the axis and at the wall, where helium begins and ends on the axis and anywhere."""
    domain, fluid = simulation.scene.domain, present(simulation.fluid)
    (left, right), (low, high) = zip(domain.lower, domain.upper, strict=True)
    h, middle = domain.spacing, 0.5 * (low + high)
    edges, points = (left + 0.5 * h[0], right - 0.5 * h[0]), domain.cells[0]
    axis = Line(simulation, (edges[0], middle), (edges[1], middle), points)
    wall = Line(simulation, (edges[0], low + 0.5 * h[1]), (edges[1], low + 0.5 * h[1]), points)
    x = edges[0] + axis.distance

    def measure() -> Mapping[str, float]:
        on_axis, at_wall = axis.values(), wall.values()
        helium = 1.0 - on_axis["volume_fraction"]
        anywhere = _rearmost(fluid) if fluid.blocks.local_count else -np.inf
        return {
            "incident shock at the wall": crossing(x, at_wall["pressure"], FRONT),
            "shock on the axis": crossing(x, on_axis["pressure"], FRONT),
            "upstream interface": crossing(x[::-1], helium[::-1], 0.5),
            "downstream interface": crossing(x, helium, 0.5),
            "rearmost helium": float(simulation.communicator.maximum(np.array([anywhere]))[0]),
        }

    return measure


def _rearmost(fluid: Fluid) -> float:
    """Largest x of the centers of this rank's cells that are half helium or more; -inf if none is."""
    largest = -np.inf
    for block in range(fluid.blocks.local_count):
        columns = np.flatnonzero((fluid.cells(block)[-1] <= 0.5).any(axis=(0, 1)))
        if len(columns):
            largest = max(largest, fluid.blocks.cell_centers(block)[0][columns[-1]])
    return largest


def in_microseconds(tracks: Tracks, scene: Scene) -> Tracks:
    """The same tracks with times in us after the shock's arrival at the bubble; positions in mm."""
    return tracks | {"time": (tracks["time"] - arrival_of(scene)) * MICROSECONDS}


def velocities(tracks: Tracks, scene: Scene) -> dict[str, float]:
    """Velocities towards the bubble's far side [m/s] by their usual names, fitted in the usual windows [us].

    NaN where the run does not reach far enough into a window.
    """
    time = tracks["time"]
    out = np.flatnonzero(tracks["shock on the axis"] < bubble_of(scene)[1])
    leaves = float(time[out[0]]) if len(out) else np.inf
    windows = {
        "Vs": ("incident shock at the wall", 0.0, 50.0),
        "VR": ("shock on the axis", 5.0, min(leaves, 52.0)),
        "VT": ("shock on the axis", leaves + 10.0, 250.0),
        "Vui": ("upstream interface", 0.0, 50.0),
        "Vdi": ("downstream interface", leaves + 10.0, 250.0),
        "Vj": ("upstream interface", 100.0, 250.0),
        "Vuf": ("rearmost helium", 600.0, 1000.0),
    }
    return {name: -1e3 * velocity(time, tracks[track], (start, end)) for name, (track, start, end) in windows.items()}


def run_gas(communicator: Communicator, gas: str, overrides: Sequence[str]) -> tuple[Scene, Tracks]:
    """Run the input with one of the GASES; the scene, and the tracks in us and mm."""
    settings = (*GASES[gas], f'output.directory="{DIRECTORY / gas}"', "output.schlieren=true", *overrides)
    scene = load(INPUT, settings)
    start = arrival_of(scene)
    pictures = [start + time / MICROSECONDS for time in MAP_TIMES + SCHLIEREN_TIMES]
    tracks = record_tracks(scene, communicator, measure_of, STEPS_BETWEEN_SAMPLES, pictures)
    return scene, in_microseconds(tracks, scene)


# ---- what is shown ---------------------------------------------------------------------------------------------------


def table(found: Mapping[str, Mapping[str, float]]) -> str:
    """Velocities of each gas beside the references, a line per velocity."""
    lines = ["[m/s]" + "".join(f"{name:>14}" for name in (*found, *(r.source for r in SHOCK_BUBBLE)))]
    for name in next(iter(found.values())):
        values = [velocities[name] for velocities in found.values()] + [getattr(r, name) for r in SHOCK_BUBBLE]
        lines.append(f"{name:5}" + "".join(f"{'-' if v is None or np.isnan(v) else f'{v:.0f}':>14}" for v in values))
    return "\n".join(lines)


def tracks_chart(gas: str, tracks: Tracks) -> Chart:
    """The x-t diagram of a run (paper, Fig. 8)."""
    curves = [Curve(positions, tracks["time"], name) for name, positions in tracks.items() if name != "time"]
    return Chart(f"{gas} helium", "x [mm]", "time after the shock has met the bubble [us]", curves)


Shown = tuple[str, Mapping[str, np.ndarray], tuple[float, float, float, float]]


def pictures_at(scene: Scene, times: Sequence[float]) -> list[Shown]:
    """Title, fields and extent [mm] of the field files nearest to `times` [us] of a run that got that far."""
    start, found = arrival_of(scene), list[Shown]()
    files = [((time - start) * MICROSECONDS, path) for time, path in series(Path(scene.output.directory), "cells")]
    for wanted in times:
        near = [(time, path) for time, path in files if abs(time - wanted) < 1.0]
        for time, path in near[:1]:
            _, fields, lower, h = read_cells(path)
            first, last = (round((x - lower[0]) / h[0]) for x in PICTURED)
            shown = {name: field[0, :, first:last] for name, field in fields.items()}
            ny = fields["pressure"].shape[1]
            found.append((f"{time:.1f} us", shown, (*PICTURED, lower[1], lower[1] + ny * h[1])))
    return found


def draw(gas: str, scene: Scene) -> None:
    """Draw pressure and density (paper, Fig. 6) and numerical schlieren (Fig. 7) of a run."""
    maps = [
        Picture(f"{gas} helium, {name} / that of air at rest, {when}", fields[name], extent, colors, label="")
        for when, fields, extent in pictures_at(scene, MAP_TIMES)
        for name, colors in (("pressure", "viridis"), ("density", "cividis"))
    ]
    shadows = [
        Picture(f"{gas} helium, {when}", np.exp(-SCHLIEREN_CONTRAST * fields["schlieren"]), extent, "gray", (0.0, 1.0))
        for when, fields, extent in pictures_at(scene, SCHLIEREN_TIMES)
    ]
    for name, pictures in (("maps", maps), ("schlieren", shadows)):
        if pictures:
            draw_pictures(DIRECTORY / f"{name}_{gas}.png", pictures, columns=2, unit="mm")


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run both gases; print velocities beside the references; leave tracks and pictures in DIRECTORY."""
    scenes, runs = {}, {}
    for gas in GASES:
        scenes[gas], runs[gas] = run_gas(communicator, gas, overrides)
    if communicator.rank > 0:
        return
    for gas, tracks in runs.items():
        columns = {"time [us]": tracks["time"]} | {f"{k} [mm]": x for k, x in tracks.items() if k != "time"}
        write_tracks(DIRECTORY / f"tracks_{gas}.csv", columns)
        draw(gas, scenes[gas])
    draw_charts(DIRECTORY / "tracks.png", [tracks_chart(gas, tracks) for gas, tracks in runs.items()], columns=2)
    print(table({gas: velocities(tracks, scenes[gas]) for gas, tracks in runs.items()}))
    print(f"{NOTE}\ntracks and pictures in {DIRECTORY}", flush=True)


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The same on fewer cells."""
    main(communicator, ["domain.cells=[325,89]", "time.end=95", *overrides])
