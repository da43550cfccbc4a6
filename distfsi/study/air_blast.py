"""TNT in air beside the curves of Kingery and Bulmash: a sphere in free air, a hemisphere on the ground, a wall."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np

from distfsi.air_blast import FREE_AIR, SURFACE, AirBlast, Burst, air_blast
from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output.charts import Chart, Curve, Picture, draw_charts, draw_pictures
from distfsi.output.fields import read_layer, series
from distfsi.output.history import read_history
from distfsi.scene import load
from distfsi.scene.description import Scene
from distfsi.scene.shipped import shipped_inputs

DIRECTORY = Path("out/study_air_blast")
ARRIVED = 0.02  # of the peak overpressure
DISTANCES = (0.4, 12.0)  # m/kg^(1/3), of the curves
NO_AFTERBURN = "fluid.afterburn.law.energy=1"  # J/kg
HEADER = ("case", "cells", "distance [m]", "arrival [s]", "peak [Pa]", "impulse [Pa s]", "duration [s]")
NAMES = ("arrival", "peak", "impulse")
Z_AXIS = "lg Z [m/kg$^{1/3}$]"


@dataclass(frozen=True)
class Blast:
    """What a gauge has seen: distance [m], arrival [s], highest overpressure [Pa], impulse [Pa s] and end [s] of the
    positive phase, up to where the overpressure is first zero again."""

    distance: float
    arrival: float
    peak: float
    impulse: float
    end: float

    @classmethod
    def of(cls, distance: float, table: Path) -> Blast:
        """From a gauge's table."""
        rows = read_history(table)
        time, over = (np.asarray(rows[name], dtype=float) for name in ("time [s]", "overpressure [Pa]"))
        top = int(over.argmax())
        start = int(np.flatnonzero(over > ARRIVED * over[top])[0])
        below = np.flatnonzero(over[top:] <= 0.0)
        end = top + int(below[0]) if len(below) else len(over) - 1
        impulse = float(np.trapezoid(over[start : end + 1], time[start : end + 1]))
        return cls(distance, float(time[start]), float(over[top]), impulse, float(time[end]))


@dataclass(frozen=True)
class Case:
    """A scene to run, the mass [kg] and kind of its burst, and whether its gauges are at a wall."""

    name: str
    file: str
    mass: float
    burst: Burst
    at_wall: bool = False

    def expected(self, distance: float) -> tuple[float, float, float]:
        """Arrival, peak and impulse by the curves, at a distance [m]."""
        blast: AirBlast = air_blast(self.mass, distance, self.burst)
        if self.at_wall:
            return blast.arrival, blast.reflected_pressure, blast.reflected_impulse
        return blast.arrival, blast.incident_pressure, blast.incident_impulse


SPHERE = Case("sphere", "airblast_far.toml", 1.0, FREE_AIR)
GROUND = Case("ground", "surface_burst.toml", 10.0, SURFACE)
WALL = Case("wall", "wall_blast.toml", 5.0, SURFACE, at_wall=True)


def blasts(case: Case, name: str, communicator: Communicator, overrides: Sequence[str]) -> list[Blast]:
    """Runs a case into DIRECTORY/name; what its gauges at points have seen, the nearest first."""
    directory = DIRECTORY / name
    scene = load(shipped_inputs() / case.file, [f'output.directory="{directory}"', *overrides])
    run(scene, communicator, 1)
    return sorted(
        (
            Blast.of(float(np.linalg.norm(list(position.values()))), path / "gauges" / f"{gauge}.csv")
            for part, path in _parts(scene)
            for gauge, given in part.gauges.items()
            for key, position in given.positions().items()
            if key == "position" and len(position) == part.domain.dimensions
        ),
        key=lambda blast: blast.distance,
    )


def _parts(scene: Scene) -> Iterator[tuple[Scene, Path]]:
    """A scene and its stages, with their output directories."""
    for part in (*scene.stages, scene):
        yield part, Path(part.output.directory)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Runs, tables, charts and the map of the wall; overrides are for all of them."""
    _study(communicator, overrides, (10, 20), (160, 320), (80,))


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The same on few cells, and no wall."""
    _study(communicator, overrides, (5,), (40,), ())


def _study(
    communicator: Communicator,
    overrides: Sequence[str],
    radial: Sequence[int],
    ground: Sequence[int],
    wall: Sequence[int],
) -> None:
    """Spheres with so many cells to their radius, the other cases with so many cells along x."""
    if communicator.size > 1:
        raise InputError(["study air_blast: runs on one rank"])
    DIRECTORY.mkdir(parents=True, exist_ok=True)
    found: dict[str, list[Blast]] = {}
    with (DIRECTORY / "air_blast.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(HEADER)

        def measure(case: Case, label: str, cells: str, settings: Sequence[str]) -> None:
            start = process_time()
            found[label] = blasts(case, label.replace(" ", "_"), communicator, [*settings, *overrides])
            seconds = process_time() - start
            print(f"{label}, {cells}: {seconds:.0f} s of one core", flush=True)
            for blast in found[label]:
                writer.writerow([label, cells, blast.distance, blast.arrival, blast.peak, blast.impulse, blast.end])
                print(_line(case, blast), flush=True)

        for number in radial:
            cells = [f"stages.0.domain.cells={round(65.2 * number)}", f"domain.cells={115 * number}"]
            for label, more in (("sphere", [NO_AFTERBURN]), ("sphere with afterburn", [])):
                measure(SPHERE, f"{label} {number}", f"{number} cells per radius", [*cells, *more])
        for n in ground:
            measure(GROUND, f"ground {n}", f"{n} x {3 * n // 4} cells", [f"domain.cells=[{n},{3 * n // 4}]"])
        for n in wall:
            across = 3 * n // 5
            measure(WALL, f"wall {n}", f"{n} x {across} x {across} cells", [f"domain.cells=[{n},{across},{across}]"])
    paths = [_draw_curves(found), *(_draw_wall(n) for n in wall)]
    print("\n".join(map(str, [DIRECTORY / "air_blast.csv", *paths])))


def _line(case: Case, blast: Blast) -> str:
    """Off the curves, in percent."""
    off = zip((blast.arrival, blast.peak, blast.impulse), case.expected(blast.distance), strict=True)
    parts = (f"{name} {100.0 * (a / b - 1.0):+6.1f} %" for name, (a, b) in zip(NAMES, off, strict=True))
    z = blast.distance / case.mass ** (1.0 / 3.0)
    return f"  Z {z:6.3f}: {', '.join(parts)}"


def _draw_curves(found: dict[str, list[Blast]]) -> Path:
    """The spheres' arrival, peak and impulse over lg Z: as lg beside the curves, and as parts of these."""
    z = np.geomspace(*DISTANCES, 100)
    curves = np.array([SPHERE.expected(float(each)) for each in z])
    runs = {label: table for label, table in found.items() if label.startswith(SPHERE.name)}
    absolute, relative = [], []
    for number, title in enumerate(("arrival [s]", "incident overpressure [Pa]", "incident impulse [Pa s]")):
        lines = [Curve(np.log10(z), np.log10(curves[:, number]), "Kingery and Bulmash")]
        parts = [Curve(np.log10(z), np.ones_like(z), "Kingery and Bulmash")]
        for (label, table), style in zip(runs.items(), ("o", "s", "x", "+", "^", "v"), strict=False):
            values = np.array([(blast.arrival, blast.peak, blast.impulse)[number] for blast in table])
            expected = np.array([SPHERE.expected(blast.distance)[number] for blast in table])
            at = np.log10([blast.distance for blast in table])
            lines.append(Curve(at, np.log10(values), f"{label} cells", style))
            parts.append(Curve(at, values / expected, f"{label} cells", f"{style}-"))
        absolute.append(Chart(title, Z_AXIS, f"lg {title}", lines))
        relative.append(Chart(f"{title.partition(' [')[0]} over the curve", Z_AXIS, "", parts))
    return draw_charts(DIRECTORY / "sphere.png", [*absolute, *relative], columns=3)


def _draw_wall(cells: int) -> Path:
    """Peak overpressure and impulse on the wall, of the run with so many cells along x."""
    directory = DIRECTORY / f"wall_{cells}" / "gauges" / "wall"
    _, fields, (low, high) = read_layer(series(directory, "cells")[-1][1], normal=0)
    pictures = [
        Picture(
            name,
            fields[key] / size,
            (low[1], high[1], low[2], high[2]),
            "inferno",
            label=unit,
        )
        for name, key, unit, size in (
            ("highest overpressure", "peak_overpressure", "kPa", 1e3),
            ("impulse", "impulse", "Pa s", 1.0),
        )
    ]
    return draw_pictures(DIRECTORY / "wall.png", pictures, columns=2, unit="m", axes_names="yz")
