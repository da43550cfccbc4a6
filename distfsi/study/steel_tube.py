"""The steel tube beside its references, up to four times its radius: wall speed and radius, and what strength costs.

The bonds of the total Lagrangian form decide where the wall is open, so that it stays whole where its particles are far
apart; failure is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.charts import Chart, Curve, draw_charts
from distfsi.output.fields import read_cells, read_particles, series
from distfsi.output.history import read_history
from distfsi.scene import load
from distfsi.scene.shipped import shipped_inputs
from distfsi.study.references import STEEL_TUBE, STEEL_TUBE_JOHNSON_COOK, STEEL_TUBE_PLASTIC, TubeStrength

DIRECTORY = Path("out/study_steel_tube")
INPUT = shipped_inputs() / "steel_tube.toml"
WIDE = (  # room for 60 us; eight particles across the wall; with strength it has begun to neck by 40 us
    "solid.form=total_lagrangian",
    "domain.upper=[0.14,0.14]",
    "domain.cells=[140,140]",
    'solid.bodies.tube.spacing="0.5 mm"',
    'time.end="40 us"',
    'output.fields_every="5 us"',
)
PLASTIC = '{kind="perfectly_plastic",shear_modulus="80 GPa",yield_stress="1 GPa"}'
STRENGTHS: dict[str, tuple[tuple[str, ...], Sequence[TubeStrength]]] = {
    "without strength": (("solid.bodies.tube.strength=none", 'time.end="60 us"'), ()),
    "plastic, 1 GPa": ((f"solid.bodies.tube.strength={PLASTIC}",), STEEL_TUBE_PLASTIC),
    "Johnson-Cook": ((), STEEL_TUBE_JOHNSON_COOK),
}


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


def _wall(
    time: float, path: Path, cells: Path, first: np.ndarray, last: np.ndarray, spacing: float, rings: np.ndarray
) -> Wall:
    particles = _by_id(read_particles(path)[1])
    x, v = particles["position"][:, :2], particles["velocity"][:, :2]
    r = np.hypot(*x.T)
    # A ring of particles stands for a strip of material that thins as the ring grows (plane strain, density kept).
    low = r[first].mean() - 0.5 * spacing * rings[0] / r[first].mean()
    high = r[last].mean() + 0.5 * spacing * rings[-1] / r[last].mean()
    velocity = float(np.mean(np.sum(v * x, axis=1) / r))
    return Wall(time, low, high - low, velocity, _pieces(particles, spacing), _products_outside(cells, high))


def _pieces(particles: dict[str, np.ndarray], spacing: float) -> int:
    """What intact bonds hold together; without bonds, what is nearer than the support of the input's kernel."""
    if "piece" in particles:
        return len(np.unique(particles["piece"]))
    x = particles["position"][:, :2]
    pairs = cKDTree(x).query_pairs(2.0 * spacing * 1.3, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(x), len(x)))
    return int(connected_components(links, directed=False, return_labels=False))


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


@dataclass(frozen=True)
class Expansion:
    """A run of the tube: its wall over time, and the kinetic energy [J] of the quarter at times [s]."""

    walls: list[Wall]
    time: np.ndarray
    kinetic: np.ndarray

    def lost(self, whole: Expansion, time: np.ndarray) -> np.ndarray:
        """Share of the kinetic energy that this wall lacks beside a `whole` one without strength."""
        return 1.0 - np.interp(time, self.time, self.kinetic) / np.interp(time, whole.time, whole.kinetic)


def expand(communicator: Communicator, name: str, overrides: Sequence[str]) -> Expansion | None:
    """Collective. Run the tube with a strength; None on all ranks but the first."""
    directory = DIRECTORY / name.replace(" ", "_").replace(",", "")
    scene = load(INPUT, [*WIDE, *STRENGTHS[name][0], f'output.directory="{directory}"', *overrides])
    run(scene, communicator)
    if communicator.rank > 0:
        return None
    history = read_history(directory / "history.csv")
    time, kinetic = (np.asarray(history[name]) for name in ("time [s]", "solid kinetic energy [J/m]"))
    return Expansion(walls(directory), time, kinetic)


def losses(name: str, found: Expansion, whole: Expansion) -> str:
    """What strength costs, beside the reference."""
    lines = ["   t       r_in [mm]              v [m/s]         kinetic energy lost [%]"]
    for reference in STRENGTHS[name][1]:
        wall = min(found.walls, key=lambda w: abs(w.time - reference.time))
        if abs(wall.time - reference.time) < 1e-7:
            lines.append(
                f"{1e6 * wall.time:5.1f} us  {1e3 * wall.inner_radius:6.2f} ({1e3 * reference.inner_radius:6.2f})"
                f"      {wall.velocity:5.0f} ({reference.mean_velocity:5.0f})"
                f"      {100 * found.lost(whole, np.array(wall.time)):5.2f} ({100 * reference.loss:5.2f})"
            )
    return "\n".join(lines)


def charts(found: dict[str, Expansion]) -> list[Chart]:
    """Radius, velocity and lost energy over time, with the points of the references."""
    whole = next(iter(found.values()))
    radius, velocity, loss = [], [], []
    for name, tube in found.items():
        points = STRENGTHS[name][1] or STEEL_TUBE
        time, at = 1e6 * np.array([w.time for w in tube.walls]), 1e6 * np.array([p.time for p in points])
        radius.append(Curve(time, 1e3 * np.array([w.inner_radius for w in tube.walls]), name))
        velocity.append(Curve(time, np.array([w.velocity for w in tube.walls])))
        late = tube.time > 1e-6
        loss.append(Curve(1e6 * tube.time[late], 100 * tube.lost(whole, tube.time[late])))
        radius.append(Curve(at, 1e3 * np.array([p.inner_radius for p in points]), None, "ok"))
        velocity.append(Curve(at, np.array([p.mean_velocity for p in points]), None, "ok"))
        loss.append(Curve(at, 100 * np.array([getattr(p, "loss", 0.0) for p in points]), None, "ok"))
    return [
        Chart("dots: one-dimensional computations", "time [us]", "inner radius [mm]", radius),
        Chart("", "time [us]", "mean wall velocity [m/s]", velocity),
        Chart("", "time [us]", "kinetic energy lost [%]", loss),
    ]


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run the tube without and with strength; print all beside the references, and leave charts in DIRECTORY."""
    runs = {name: expand(communicator, name, overrides) for name in STRENGTHS}
    if communicator.rank > 0:
        return
    found = {name: present(tube) for name, tube in runs.items()}
    whole = next(iter(found.values()))
    for name, tube in found.items():
        print(f"\n{name} (in brackets: 1-D reference without strength)\n{table(tube.walls)}")
        if STRENGTHS[name][1]:
            print(f"beside the 1-D reference with strength\n{losses(name, tube, whole)}")
    draw_charts(DIRECTORY / "tube.png", charts(found), columns=3)
    print(f"\nruns and charts in {DIRECTORY}", flush=True)


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The same on few cells up to 5 us."""
    coarse = ("domain.upper=[0.07,0.07]", "domain.cells=[35,35]", 'solid.bodies.tube.spacing="1 mm"', 'time.end="5 us"')
    main(communicator, [*coarse, *overrides])
