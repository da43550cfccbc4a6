"""The underwater explosion in the plane (paper, Sec. 5.2) beside a radial computation, on the axis and a diagonal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np

from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import of_kind, present
from distfsi.output.charts import Chart, Curve, Picture, draw_charts, draw_pictures
from distfsi.output.fields import read_cells, series
from distfsi.scene import load
from distfsi.scene.description import Ball, Scene
from distfsi.scene.shipped import shipped_inputs
from distfsi.simulation import Simulation
from distfsi.study.references import UNDEX_2D, RadialProfile
from distfsi.study.tracks import Line, Measure, Tracks, crossing, record_tracks, write_tracks

INPUT = shipped_inputs() / "undex_2d.toml"
DIRECTORY = Path("out/study_undex_2d")
RADII = (0.5, 0.4)  # the paper does not tell which [m]
DIRECTIONS = {"axis": (1.0, 0.0), "diagonal": (sqrt(0.5), sqrt(0.5))}
PICTURE_TIMES = (0.01e-3, 0.05e-3, 0.1e-3, 0.15e-3)  # times of the paper's Fig. 10 [s]
PROFILE_TIME = 0.1e-3  # and of its Figs. 11 to 13 [s]
FRONT = 1.5e9  # pressure that marks the shock, half of that behind it [Pa]
QUANTITIES = (("pressure", 1e-6, "MPa"), ("velocity", 1.0, "m/s"), ("density", 1.0, "kg/m3"))


@dataclass(frozen=True)
class Explosion:
    """A run: where shock and interface were in each direction, and profiles along the directions at PROFILE_TIME."""

    scene: Scene
    tracks: Tracks
    profiles: Mapping[str, Mapping[str, np.ndarray]]

    @property
    def spacing(self) -> float:
        """Size of a cell [m]."""
        return self.scene.domain.spacing[0]

    @property
    def references(self) -> list[RadialProfile]:
        """What the radial computation tells of this charge."""
        charge = of_kind(Ball, present(self.scene.fluid).regions[1].shape).radius
        return [reference for reference in UNDEX_2D if reference.charge == charge]

    def at(self, direction: str, quantity: str, radius: float) -> float:
        """A quantity at a radius [m] and PROFILE_TIME, linear between cells."""
        profile = self.profiles[direction]
        return float(np.interp(radius, profile["radius"], profile[quantity]))

    def radius(self, what: str, direction: str, time: float) -> float:
        """Radius of the "shock" or "interface" at a time, linear between samples [m]."""
        return float(np.interp(time, self.tracks["time"], self.tracks[f"{what} on the {direction}"]))


def explode(communicator: Communicator, charge: float, overrides: Sequence[str]) -> Explosion:
    """Run the input with a charge of radius `charge` [m]."""
    directory = DIRECTORY / f"radius_{charge:g}"
    settings = (f"fluid.regions.1.shape.radius={charge}", f'output.directory="{directory}"', *overrides)
    scene = load(INPUT, settings)
    profiles: dict[str, dict[str, np.ndarray]] = {}

    def measure_of(simulation: Simulation) -> Measure:
        return _measure(simulation, profiles)

    return Explosion(scene, record_tracks(scene, communicator, measure_of, 1, PICTURE_TIMES), profiles)


def _measure(simulation: Simulation, profiles: dict[str, dict[str, np.ndarray]]) -> Measure:
    """Shock and interface in each direction; the sample nearest to PROFILE_TIME is kept whole in `profiles`."""
    h = simulation.scene.domain.spacing[0]
    points = int((simulation.scene.domain.upper[0] - 0.5 * h) / (0.5 * h))
    lines = {
        name: Line(simulation, (0.0, 0.0), tuple(0.5 * h * points * e for e in unit), points + 1)
        for name, unit in DIRECTIONS.items()
    }

    def measure() -> Mapping[str, float]:
        found = {}
        for name, line in lines.items():
            values, r = line.values(), line.distance
            found[f"shock on the {name}"] = crossing(r[::-1], values["pressure"][::-1], FRONT)
            found[f"interface on the {name}"] = crossing(r, values["volume_fraction"], 0.5)
            if simulation.time <= PROFILE_TIME + 0.5 * simulation.dt:
                along = DIRECTIONS[name]
                values["velocity"] = along[0] * values["velocity_x"] + along[1] * values["velocity_y"]
                profiles[name] = {"radius": r, **values}
        return found

    return measure


# ---- what is shown ---------------------------------------------------------------------------------------------------


def table(explosion: Explosion) -> str:
    """The run beside the radial computation: radii, then pressure, velocity and density on the axis."""
    lines = [f"t [us] {'':9} {'radius [mm]':>12} {'radial':>8}   off, in cells: axis, diagonal"]
    for reference in explosion.references:
        for what in ("shock", "interface"):
            expected = getattr(reference, what)
            found = [explosion.radius(what, direction, reference.time) for direction in DIRECTIONS]
            off = "".join(f"{(radius - expected) / explosion.spacing:+8.2f}" for radius in found)
            when = f"{1e6 * reference.time:6.0f}"
            lines.append(f"{when} {what:9} {1e3 * found[0]:12.1f} {1e3 * expected:8.1f}   {off}")
    lines += [
        "",
        f"{'r [m]':>6}" + "".join(f"{f'{name} [{unit}]':>19}{'radial':>9}{'off':>9}" for name, _, unit in QUANTITIES),
    ]
    for radius, *expected in explosion.references[-1].points:
        columns = zip(QUANTITIES, expected, strict=True)
        cells = (_beside(explosion.at("axis", name, radius), value, size) for (name, size, _), value in columns)
        lines.append(f"{radius:6.1f}" + "".join(cells))
    return "\n".join(lines)


def _beside(found: float, expected: float, size: float) -> str:
    off = f"{100 * (found / expected - 1):+.1f} %" if expected else ""
    return f"{size * found:19.1f}{size * expected:9.1f}{off:>9}"


def profile_charts(explosion: Explosion) -> list[Chart]:
    """Pressure, velocity and density along the directions with the reference points (paper, Figs. 11 to 13)."""
    reference = explosion.references[-1]
    title = f"charge of {reference.charge:g} m, {1e6 * PROFILE_TIME:g} us"
    radius, *columns = np.array(reference.points).T
    charts = []
    for (name, size, unit), points in zip(QUANTITIES, columns, strict=True):
        curves = [
            Curve(profile["radius"], size * profile[name], direction, style)
            for (direction, profile), style in zip(explosion.profiles.items(), ("-", "--"), strict=True)
        ]
        curves.append(Curve(radius, size * points, "radial computation", "ok"))
        charts.append(Chart(title, "radius [m]", f"{name} [{unit}]", curves))
    return charts


def maps(explosion: Explosion) -> list[Picture]:
    """Pressure at the times of the paper's Fig. 10."""
    scene = explosion.scene
    (left, right), (bottom, top) = zip(scene.domain.lower, scene.domain.upper, strict=True)
    extent, limits = (left, right, bottom, top), (0.0, 1e-9 * present(scene.fluid).regions[1].state.pressure)
    pictures = []
    for time, path in series(Path(scene.output.directory), "cells"):
        pressure = 1e-9 * read_cells(path)[1]["pressure"][0]
        title = f"pressure [GPa], {1e6 * time:.0f} us"
        pictures.append(Picture(title, pressure, extent, limits=limits, label=""))
    return pictures


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run both charges; print them beside the radial computation; leave tracks and pictures in DIRECTORY."""
    explosions = {charge: explode(communicator, charge, overrides) for charge in RADII}
    if communicator.rank > 0:
        return
    charts = []
    for charge, explosion in explosions.items():
        print(f"\ncharge of {charge:g} m beside the radial computation\n{table(explosion)}")
        charts += profile_charts(explosion)
        write_tracks(DIRECTORY / f"tracks_{charge:g}.csv", explosion.tracks)
        draw_pictures(DIRECTORY / f"maps_{charge:g}.png", maps(explosion), columns=2, unit="m")
    draw_charts(DIRECTORY / "profiles.png", charts, columns=3)
    print(f"\ntracks and pictures in {DIRECTORY}", flush=True)


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The same on fewer cells."""
    main(communicator, ["domain.cells=[200,200]", *overrides])
