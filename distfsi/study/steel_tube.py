"""The steel tube beside its references: wall speed and radius with strength off, and what strength costs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from distfsi.mesh.communicator import Communicator
from distfsi.output.fields import read_cells, read_particles, series
from distfsi.output.history import read_history
from distfsi.scene import load
from distfsi.simulation import run
from distfsi.study.references import STEEL_TUBE

INPUT = Path(__file__).parents[2] / "inputs" / "steel_tube.toml"


@dataclass(frozen=True)
class Wall:
    """The tube's wall at one time: radii [m], mean radial velocity [m/s], pieces, and the products found outside it."""

    time: float
    inner_radius: float
    thickness: float
    velocity: float
    pieces: int
    products_outside: float


def walls(directory: Path) -> list[Wall]:
    """The wall in each field file of a run of the tube, quarter or full, centred at the origin."""
    frames = series(directory, "particles")
    start = _by_id(read_particles(frames[0][1])[1])
    radius = np.hypot(*start["position"][:, :2].T)
    rings = np.unique(np.round(radius, 9))
    first, last = np.isclose(radius, rings[0], rtol=1e-6), np.isclose(radius, rings[-1], rtol=1e-6)
    spacing = rings[1] - rings[0]
    cells = dict(series(directory, "cells"))
    return [_wall(time, path, cells[time], first, last, spacing, rings) for time, path in frames]


def _wall(time, path, cells, first, last, spacing, rings) -> Wall:
    particles = _by_id(read_particles(path)[1])
    x, v = particles["position"][:, :2], particles["velocity"][:, :2]
    r = np.hypot(*x.T)
    # A ring of particles stands for a strip of material that thins as the ring grows (plane strain, density kept).
    low = r[first].mean() - 0.5 * spacing * rings[0] / r[first].mean()
    high = r[last].mean() + 0.5 * spacing * rings[-1] / r[last].mean()
    velocity = float(np.mean(np.sum(v * x, axis=1) / r))
    pairs = cKDTree(x).query_pairs(2.0 * spacing * 1.3, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(x), len(x)))
    pieces = connected_components(links, directed=False, return_labels=False)
    return Wall(time, low, high - low, velocity, int(pieces), _products_outside(cells, high))


def _products_outside(path: Path, radius: float) -> float:
    """Largest volume fraction of the products in a cell wholly outside `radius`."""
    _, fields, lower, spacing = read_cells(path)
    fraction = fields["volume_fraction"][0]
    x, y = (lower[axis] + (np.arange(fraction.shape[1 - axis]) + 0.5) * spacing[axis] for axis in (0, 1))
    outside = np.hypot(x[None, :], y[:, None]) > radius + spacing[0]
    return float(np.nanmax(fraction[outside]))


def _by_id(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    order = np.argsort(columns["id"])
    return {name: column[order] for name, column in columns.items()}


def table(found: list[Wall]) -> str:
    """The wall beside the reference, a line per time of the reference."""
    lines = ["   t       r_in [mm]              v [m/s]              thickness [mm]   pieces  products outside"]
    for reference in STEEL_TUBE:
        wall = min(found, key=lambda w: abs(w.time - reference.time))
        if abs(wall.time - reference.time) < 1e-7:
            lines.append(
                f"{1e6 * wall.time:5.1f} us"
                f"  {1e3 * wall.inner_radius:6.2f} ({1e3 * reference.inner_radius:6.2f}, "
                f"{100 * (wall.inner_radius / reference.inner_radius - 1):+5.1f} %)"
                f"  {wall.velocity:5.0f} ({reference.mean_velocity:5.0f}, "
                f"{100 * (wall.velocity / reference.mean_velocity - 1):+5.1f} %)"
                f"  {1e3 * wall.thickness:5.2f} ({1e3 * reference.thickness:5.2f})"
                f"  {wall.pieces:6d}  {wall.products_outside:.1e}"
            )
    return "\n".join(lines)


def main(communicator: Communicator, overrides: list[str]) -> None:
    """Run the tube without and with strength and print both beside the reference."""
    energies, tables = {}, {}
    for name, strength in (("without strength", ["solid.bodies.tube.strength=none"]), ("Johnson-Cook", [])):
        directory = Path("out/study_steel_tube") / name.replace(" ", "_")
        scene = load(INPUT, [*strength, "output.fields_every=2.5e-6", f'output.directory="{directory}"', *overrides])
        run(scene, communicator)
        if communicator.rank == 0:
            tables[name] = table(walls(directory))
            energies[name] = read_history(directory / "history.csv")["solid kinetic energy [J]"][-1]
    if communicator.rank == 0:
        for name, text in tables.items():
            print(f"\n{name} (in brackets: 1-D reference without strength)\n{text}")
        without, with_strength = energies.values()
        print(f"\nkinetic energy at the end: {100 * (with_strength / without - 1):+.1f} % with Johnson-Cook strength")
