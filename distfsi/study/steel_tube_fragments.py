"""The steel tube with failure: when it breaks, and how wide, thick and fast its fragments are, over ten specimens.

Fragments are what intact bonds hold together. The constants of the failure are of the kind published for medium carbon
steel; the paper names none. Those of the paper and of the experiment it compares with are printed beside.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output.charts import Chart, Curve, Picture, draw_charts, draw_pictures
from distfsi.output.fields import read_cells, read_particles, series
from distfsi.output.history import read_history
from distfsi.scene import load
from distfsi.study.references import TUBE_FRAGMENTS
from distfsi.study.steel_tube import INPUT, WIDE

DIRECTORY = Path("out/study_steel_tube_fragments")
SEEDS = range(1, 11)
FAILURE = (
    'solid.bodies.tube.failure={{kind="johnson_cook",D1=0.10,D2=0.76,D3=-1.57,D4=0.005,D5=-0.84,'
    'fracture_energy="35 kJ/m2",scatter={{modulus=10,size="1 mm",seed={seed}}}}}'
)
SMOOTHING = "solid.smoothing=1.3"  # so that the bonds that a crack cuts take its energy
HEADER = ("seed", "broken at [s]", "r/r0 failed", "r/r0 broken", "width [m]", "thickness [m]", "speed [m/s]")
SMALLEST = 8  # particles of a fragment that is measured
SHOWN, WINDOW = (10e-6, 20e-6, 30e-6, 40e-6), 0.1  # the times of the pictures [s] and the width that they show [m]


@dataclass(frozen=True)
class Fragments:
    """A specimen: time [s] when a first piece has parted; r/r0 when a first particle has failed, and at that time;
    widths, thicknesses [m] and speeds [m/s] of its fragments at the end, and the share of the mass that they hold; all
    else is dust or touches a plane of symmetry."""

    seed: int
    broken_at: float
    failed: float
    expansion: float
    width: np.ndarray
    thickness: np.ndarray
    speed: np.ndarray
    share: float


def burst(communicator: Communicator, seed: int, overrides: Sequence[str]) -> Path:
    """Collective. Run a specimen; its directory."""
    directory = DIRECTORY / f"seed_{seed}"
    output = ('output.fields_every="1 us"', f'output.directory="{directory}"')
    run(load(INPUT, [*WIDE, SMOOTHING, FAILURE.format(seed=seed), *output, *overrides]), communicator)
    return directory


def fragments(directory: Path, seed: int) -> Fragments:
    """What a run has left in its directory."""
    frames = series(directory, "particles")
    inner = np.hypot(*read_particles(frames[0][1])[1]["position"][:, :2].T)
    rows, start = np.flatnonzero(inner < inner.min() * (1.0 + 1e-6)), inner.min()
    broken_at, failed, expansion = np.nan, np.nan, np.nan
    for time, path in frames:
        p = read_particles(path)[1]
        order = np.argsort(p["id"])
        now = float(np.hypot(*p["position"][order][rows, :2].T).mean() / start)
        if np.isnan(failed) and (p["damage"] >= 1.0).any():
            failed = now
        if np.unique(p["piece"], return_counts=True)[1].max() < len(order):
            broken_at, expansion = time, now
            break
    return Fragments(seed, broken_at, failed, expansion, *_measured(read_particles(frames[-1][1])[1]))


def _measured(p: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Width, thickness, speed of all fragments, and their share of the particles.

    A fragment counts as the rectangle with the same second moments.
    """
    x, v = p["position"][:, :2], p["velocity"][:, :2]
    r = np.hypot(*x.T)
    found, held = [], 0
    for piece, count in zip(*np.unique(p["piece"], return_counts=True), strict=True):
        rows = p["piece"] == piece
        middle = x[rows].mean(axis=0)
        if count < SMALLEST or (middle < 0.1 * r[rows].mean()).any():
            continue
        low, high = np.sqrt(12.0 * np.linalg.eigvalsh(np.cov(x[rows].T, bias=True)) * count / max(count - 1.0, 1.0))
        found.append((high, low, float(np.hypot(*v[rows].mean(axis=0)))))
        held += count
    width, thickness, speed = np.array(found).reshape(-1, 3).T
    return width, thickness, speed, held / len(r)


def line(f: Fragments) -> str:
    """A specimen as a line of the table."""
    head = f"{f.seed:4} {1e6 * f.broken_at:8.1f} {f.failed:11.2f} {f.expansion:8.2f} {len(f.width):8}"
    if not len(f.width):
        return f"{head}  only dust"
    means = (1e3 * f.width.mean(), 1e3 * f.thickness.mean(), f.speed.mean(), 100.0 * f.share)
    return head + "{:9.2f} {:9.2f} {:9.0f} {:9.0f}".format(*means)


def together(found: Sequence[Fragments]) -> str:
    """Mean and standard deviation over the fragments of all specimens."""
    names = ("width", "thickness", "speed")
    width, thickness, speed = (np.concatenate([getattr(f, name) for f in found]) for name in names)
    return (
        f"{len(width)} fragments: width {1e3 * width.mean():.2f} ± {1e3 * width.std():.2f} mm, thickness"
        f" {1e3 * thickness.mean():.2f} ± {1e3 * thickness.std():.2f} mm, {speed.mean():.0f} ± {speed.std():.0f} m/s"
    )


def maps(directory: Path, what: str) -> list[Picture]:
    """Fragments, or speeds of gas and wall, at the times SHOWN (after the paper's Figs. 25, 26)."""
    pictures = []
    particles, cells = series(directory, "particles"), series(directory, "cells")
    for instant in SHOWN:
        number = min(range(len(cells)), key=lambda n: abs(cells[n][0] - instant))
        time, path = cells[number]
        _, fields, lower, spacing = read_cells(path)
        shown = slice(int(WINDOW / spacing[0]))
        values = _drawn(fields, read_particles(particles[number][1])[1], lower, spacing, what)[shown, shown]
        size = [1e3 * n * s for n, s in zip(values.shape[::-1], spacing[:2], strict=True)]
        title = {"speed": "speed [m/s]", "piece": "fragments"}[what]
        bar = "" if what == "speed" else None
        extent = (0.0, size[0], 0.0, size[1])
        pictures.append(Picture(f"{title}, {1e6 * time:.0f} us", values, extent, "turbo", label=bar))
    return pictures


def _drawn(
    cells: Mapping[str, np.ndarray],
    particles: Mapping[str, np.ndarray],
    lower: np.ndarray,
    spacing: np.ndarray,
    what: str,
) -> np.ndarray:
    """Speeds of gas and wall, or the colors of the fragments, in the cells."""
    x = particles["position"][:, :2]
    cell = tuple(((x - lower[:2]) / spacing[:2]).astype(int).T[::-1])
    speed = np.linalg.norm(cells["velocity"][0], axis=-1)
    if what == "speed":
        speed[cell] = np.hypot(*particles["velocity"][:, :2].T)
        return speed
    numbers = np.full(speed.shape, np.nan)
    pieces, count = np.unique(particles["piece"], return_counts=True)
    large = count >= SMALLEST
    color = np.where(large, 5 + 7 * np.cumsum(large) % 20, 0)  # neighbours far from each other, dust alike
    numbers[cell] = color[np.searchsorted(pieces, particles["piece"])]
    return numbers


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run the specimens; print them beside experiment and paper; leave table and pictures in DIRECTORY."""
    directories = {seed: burst(communicator, seed, overrides) for seed in SEEDS}
    if communicator.rank > 0:
        return
    found = [fragments(directory, seed) for seed, directory in directories.items()]
    print("seed  broken [us]  r/r0 failed  broken  fragments  width [mm]  thickness  speed [m/s]  mass [%]")
    print("\n".join(line(f) for f in found))
    print(together(found))
    for source in TUBE_FRAGMENTS:
        print(f"{source.source}: width {1e3 * source.width} mm, thickness {1e3 * source.thickness} mm, {source.speed}")
    write(found)
    first = directories[SEEDS[0]]
    draw_pictures(DIRECTORY / "fragments.png", maps(first, "piece"), columns=4, unit="mm")
    draw_pictures(DIRECTORY / "speed.png", maps(first, "speed"), columns=4, unit="mm")
    draw_charts(DIRECTORY / "energy.png", [energies(first)], columns=1)
    print(f"\nruns, table and pictures in {DIRECTORY}", flush=True)


def energies(directory: Path) -> Chart:
    """Energy of the quarter of the tube (after the paper's Fig. 27)."""
    history = read_history(directory / "history.csv")
    time, kinetic, internal = (
        np.asarray(history[name]) for name in ("time [s]", "solid kinetic energy [J/m]", "solid internal energy [J/m]")
    )
    curves = [
        Curve(1e6 * time, 1e-6 * values, name)
        for name, values in (("kinetic", kinetic), ("internal", internal), ("both", kinetic + internal))
    ]
    return Chart("quarter of the tube, one metre", "time [us]", "energy [MJ]", curves)


def write(found: Sequence[Fragments]) -> None:
    """All fragments as CSV."""
    with (DIRECTORY / "fragments.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEADER)
        for f in found:
            begin = (f.seed, f"{f.broken_at:.3g}", f"{f.failed:.3f}", f"{f.expansion:.3f}")
            for w, t, v in zip(f.width, f.thickness, f.speed, strict=True):
                table.writerow([*begin, f"{w:.3e}", f"{t:.3e}", f"{v:.0f}"])


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """One specimen on few cells up to 24 us, only to see that it breaks."""
    coarse = (
        "domain.upper=[0.07,0.07]",
        "domain.cells=[35,35]",
        'solid.bodies.tube.spacing="1 mm"',
        'time.end="24 us"',
    )
    found = fragments(burst(communicator, SEEDS[0], [*coarse, *overrides]), SEEDS[0])
    print(line(found), flush=True)
