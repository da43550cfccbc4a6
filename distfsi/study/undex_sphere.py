"""28 kg of TNT in water: its wave beside radial computations and Cole's similitude, and its bubble."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output.charts import Chart, Curve, draw_charts
from distfsi.output.fields import read_cells, series
from distfsi.output.history import read_history
from distfsi.scene import load
from distfsi.scene.shipped import shipped_inputs

DIRECTORY = Path("out/study_undex_sphere")
MASS, RADIUS, DEPTH = 28.0, 0.16, 500.0  # kg, m; m of the bubble
WATERS = {"gamma 4.4, 600 MPa": (4.4, 6e8), "gamma 7.15, 331 MPa": (7.15, 3.31e8)}
# Independent Lagrangian computations in a radius, 60 cells to that of the charge: arrival [s] and peak [Pa] by radii
RADIAL = {
    "gamma 4.4, 600 MPa": {2: (0.0557e-3, 1285.8e6), 5: (0.2823e-3, 375.2e6), 10: (0.7232e-3, 149.7e6)},
    "gamma 7.15, 331 MPa": {2: (0.0477e-3, 1347.5e6), 5: (0.2610e-3, 357.3e6), 10: (0.7039e-3, 134.9e6)},
}
ATMOSPHERE = 10.1  # m of water


def cole_peak(distance: float) -> float:
    """Peak overpressure [Pa] at a distance [m] (Cole, Underwater Explosions, 1948, with constants of TNT)."""
    return 52.4e6 * (MASS ** (1.0 / 3.0) / distance) ** 1.13


def cole_decay(distance: float) -> float:
    """Time [s] in which the overpressure falls to 1/e."""
    third = MASS ** (1.0 / 3.0)
    return 0.084e-3 * third * (third / distance) ** -0.23


def bubble_similitude() -> tuple[float, float]:
    """Period [s] and largest radius [m] of the bubble at DEPTH."""
    head = DEPTH + ATMOSPHERE
    return 2.11 * MASS ** (1.0 / 3.0) / head ** (5.0 / 6.0), 3.36 * (MASS / head) ** (1.0 / 3.0)


def wave(table: Path) -> tuple[float, float, float]:
    """Arrival at half the peak [s], peak overpressure [Pa], decay to 1/e [s] (NaN: not in the table)."""
    rows = read_history(table)
    time, over = (np.asarray(rows[name], dtype=float) for name in ("time [s]", "overpressure [Pa]"))
    top = int(over.argmax())
    arrival = time[np.flatnonzero(over > 0.5 * over[top])[0]]
    below = np.flatnonzero(over[top:] < over[top] / np.e)
    return float(arrival), float(over[top]), float(time[top + below[0]] - time[top]) if len(below) else np.nan


def bubble_radius(directory: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and radii [m] of a ball with the volume of the products."""
    times, radii = [], []
    for time, path in series(directory, "cells"):
        _, fields, lower, spacing = read_cells(path)
        share = 1.0 - fields["volume_fraction"].ravel()
        faces = lower[0] + spacing[0] * np.arange(len(share) + 1)
        times.append(time)
        radii.append((share * np.diff(faces**3)).sum() ** (1.0 / 3.0))
    return np.array(times), np.array(radii)


def first_period(times: np.ndarray, radii: np.ndarray) -> tuple[float, float]:
    """Time [s] of the smallest radius after the largest one, by a parabola, and the largest radius [m]."""
    largest = int(radii.argmax())
    smallest = largest + int(radii[largest:].argmin())
    near = slice(smallest - 1, smallest + 2)
    a, b, _ = np.polyfit(times[near] - times[smallest], radii[near], 2)
    return float(times[smallest] - 0.5 * b / a), float(radii[largest])


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Waves in two waters with 60 cells to the radius, and the bubble; overrides are for all."""
    _study(communicator, overrides, 60, tuple(WATERS), True)


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """A wave with 15 cells to the radius."""
    _study(communicator, overrides, 15, tuple(WATERS)[:1], False)


def _study(
    communicator: Communicator, overrides: Sequence[str], cells: int, waters: Sequence[str], bubble: bool
) -> None:
    if communicator.size > 1:
        raise InputError(["study undex_sphere: runs on one rank"])
    for water in waters:
        _wave(communicator, overrides, cells, water)
    if bubble:
        _bubble(communicator, overrides)


def _wave(communicator: Communicator, overrides: Sequence[str], cells: int, water: str) -> None:
    """Run one, and print it beside the others."""
    gamma, p_inf = WATERS[water]
    directory = DIRECTORY / f"wave_{gamma}"
    settings = [f"domain.cells={round(845 / 30 * cells)}", f"stages.0.domain.cells={15 * cells}"]
    settings += [f"fluid.phases.water.gamma={gamma}", f"fluid.phases.water.p_inf={p_inf}"]
    scene = load(shipped_inputs() / "undex_sphere.toml", [f'output.directory="{directory}"', *settings, *overrides])
    run(scene, communicator, 1)
    print(f"water of {water}, {cells} cells to the radius")
    print("radii   arrival [ms]  off [%]   peak [MPa]  off [%]  over Cole's   decay [us]  Cole's")
    for part in (*scene.stages, scene):
        for name in part.gauges:
            radii = int(name.split("_")[1])
            arrival, peak, decay = wave(Path(part.output.directory) / "gauges" / f"{name}.csv")
            other = RADIAL[water].get(radii)
            off = [100 * (a / b - 1) for a, b in zip((arrival, peak), other, strict=True)] if other else []
            late, high = (f"{each:+8.1f}" for each in off) if other else (" " * 8,) * 2
            cole = cole_peak(radii * RADIUS), cole_decay(radii * RADIUS)
            print(
                f"{radii:5} {1e3 * arrival:14.4f} {late} {1e-6 * peak:12.1f} {high} {peak / cole[0]:12.2f}"
                f" {1e6 * decay:12.0f} {1e6 * cole[1]:7.0f}",
                flush=True,
            )


def _bubble(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run it, print period and radius, draw the radius over time."""
    directory = DIRECTORY / "bubble"
    run(load(shipped_inputs() / "bubble.toml", [f'output.directory="{directory}"', *overrides]), communicator, 1)
    times, radii = bubble_radius(directory)
    (period, largest), (expected, expected_radius) = first_period(times, radii), bubble_similitude()
    print(f"bubble at {DEPTH:g} m: period {1e3 * period:.2f} ms, similitude {1e3 * expected:.2f} ms", end="")
    print(f" ({100 * (period / expected - 1):+.1f} %); radius {largest:.3f} m, {expected_radius:.3f} m", end="")
    print(f" ({100 * (largest / expected_radius - 1):+.1f} %)")
    curves = [
        Curve(1e3 * times, radii, "computed"),
        Curve(1e3 * np.array([expected] * 2), np.array([0.0, expected_radius]), "similitude: period", "--"),
        Curve(1e3 * np.array([0.0, expected]), np.array([expected_radius] * 2), "largest radius", ":"),
    ]
    print(draw_charts(DIRECTORY / "bubble.png", [Chart("the bubble", "time [ms]", "radius [m]", curves)], columns=1))
