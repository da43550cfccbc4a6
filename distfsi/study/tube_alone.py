"""The steel tube by itself under the gas pressure of the one-dimensional reference: when it fails, and into what.

Pieces are counted across bonds that damage has cut, nothing else. Gas that escapes through cracks is not known here.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.errors import InputError
from distfsi.laws.solid.failure.johnson_cook import JohnsonCookFailure
from distfsi.laws.solid.scatter import Scatter
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.scene import load
from distfsi.scene.description import Solid as SolidOfScene
from distfsi.simulation import Simulation
from distfsi.solid.solid import Solid
from distfsi.study.references import STEEL_TUBE
from distfsi.study.steel_tube import INPUT

DIRECTORY = Path("out/study_tube_alone")
TIMES = (0.0, *(instant.time for instant in STEEL_TUBE))  # s
PRESSURES = (7.178e9, *(instant.gas_pressure for instant in STEEL_TUBE))  # Pa; first: products that meet steel
SPACING, SEEDS = 0.5e-3, 3
FRACTURE_ENERGY = 48e3  # J/m2: of 100 MPa m^(1/2)
TABULATED = (0.05, 3.44, -2.12, 0.002, 0.61)  # Johnson & Cook 1985, 4340 steel
MEASURED = (7.86e-3, 3.3e-3)  # m: width and thickness of the fragments found by Tang, Gu & Li 2003
HEADER = (
    "fracture strain over the tabulated",
    "seed",
    "r/r0 at first failure",
    "r/r0 at first break",
    "time [s]",
    "thickness [m]",
    "pieces of a ring",
    "width [m]",
    "velocity [m/s]",
)
DUST = 8  # particles: what is smaller is no piece


@dataclass(frozen=True)
class Burst:
    """What became of a tube: expansion r/r0 and time [s] when the first particle failed, when the first bonds were cut
    through the whole wall (nan: never), and the most pieces of a whole ring that there were at a time: later on, walls
    that have failed turn into debris."""

    first_failure: float
    first_break: float
    break_time: float
    pieces: float
    velocity: float

    @property
    def thickness(self) -> float:
        """Of the wall [m] at the first break; the section's area stays."""
        inner = 30e-3 * self.first_break
        return math.sqrt(inner**2 + 34e-3**2 - 30e-3**2) - inner

    @property
    def width(self) -> float:
        """Mean of the pieces [m], along the middle of the wall at the first break."""
        return 2.0 * math.pi * (30e-3 * self.first_break + 0.5 * self.thickness) / self.pieces


def tube(constants: Sequence[float], seed: int) -> Simulation:
    """A quarter of the tube, with Johnson and Cook's D1 to D5 of failure."""
    scene = load(INPUT)
    D1, D2, D3, D4, D5 = constants
    failure = JohnsonCookFailure(D1, D2, D3, D4, D5, 1.0, None, FRACTURE_ENERGY, Scatter(20.0, 1e-3, seed))
    body = replace(present(scene.solid).bodies[0], spacing=SPACING, failure=failure)
    return Simulation.of(replace(scene, fluid=None, solid=SolidOfScene((body,), 1.3, 0.5, 1.0)), Communicator(), 1)


def burst(constants: Sequence[float], seed: int, end: float) -> Burst:
    """Push the inner surface outward until `end` [s]."""
    solid, time = present(tube(constants, seed).solid), 0.0
    start = np.hypot(*solid.columns["position"].T)
    inmost = solid.columns["id"][start < start.min() + 0.25 * SPACING]
    inset = start.min() ** 2 - 30e-3**2  # times pi: area inside the inmost particles, which stays
    first_failure = first_break = break_time = math.nan
    pieces = 1
    while time < end:
        solid.prepare()
        dt = solid.time_step()[0]
        solid.advance(dt)
        c = solid.columns
        position, inner = c["position"], np.isin(c["id"], inmost)
        distance = np.hypot(*position.T)
        radius = math.sqrt(np.square(distance[inner]).mean() - inset)
        push = np.interp(time, TIMES, PRESSURES) * 0.5 * math.pi * radius / len(inmost) * dt
        solid.apply_impulse(np.where(inner, push / distance, 0.0)[:, None] * position)
        solid.migrate()
        time += dt
        if math.isnan(first_failure) and (solid.columns["damage"] >= 1.0).any():
            first_failure = radius / 30e-3
        if not math.isnan(first_failure):
            pieces = max(pieces, _pieces(solid))
        if math.isnan(first_break) and pieces > 1:
            first_break, break_time = radius / 30e-3, time
    totals = solid.totals()
    velocity = math.sqrt(2.0 * totals["kinetic"] / totals["mass"])
    return Burst(first_failure, first_break, break_time, 4.0 * (pieces - 1) if pieces > 1 else math.nan, velocity)


def _pieces(solid: Solid) -> int:
    return int((present(solid.pieces())["particles"] >= DUST).sum())


def scaled(share: float) -> tuple[float, ...]:
    """The tabulated constants with `share` of the fracture strain."""
    D1, D2, *others = TABULATED
    return share * D1, share * D2, *others


CASES = {"tabulated": (1.0, 60e-6), "a half": (0.5, 40e-6), "a fifth": (0.2, 40e-6), "a tenth": (0.1, 40e-6)}


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """A fifth of the tabulated fracture strain with one seed."""
    _study(communicator, overrides, ("a fifth",), 1)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """All constants and seeds; print a table and leave a CSV file in DIRECTORY."""
    _study(communicator, overrides, tuple(CASES), SEEDS)


def _study(communicator: Communicator, overrides: Sequence[str], cases: Sequence[str], seeds: int) -> None:
    if communicator.size > 1 or overrides:
        raise InputError(["study tube_alone: runs on one rank and takes no overrides"])
    DIRECTORY.mkdir(parents=True, exist_ok=True)
    width, thickness = MEASURED
    print(
        f"measured fragments: {1e3 * width:.2f} mm wide, {1e3 * thickness:.2f} mm thick, which the wall is at r/r0 1.24"
    )
    with threadpool_limits(1), (DIRECTORY / "bursts.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        for name in cases:
            share, end = CASES[name]
            found = [burst(scaled(share), seed, end) for seed in range(1, seeds + 1)]
            for seed, b in enumerate(found, 1):
                numbers = (b.first_failure, b.first_break, b.break_time, b.thickness, b.pieces, b.width, b.velocity)
                writer.writerow([share, seed, *(f"{n:.4g}" for n in numbers)])
            print(table(name, found), flush=True)
    print(f"\ntable in {DIRECTORY}", flush=True)


def table(name: str, found: Sequence[Burst]) -> str:
    """Means over the seeds; those of a break over the seeds that broke."""
    mean = _mean(found, "first_failure", "velocity")
    start = (
        f"  fracture strain {name:10}  first failure at r/r0 {mean['first_failure']:.2f}, {mean['velocity']:.0f} m/s,"
    )
    broken = [b for b in found if b.pieces > 1]
    if not broken:
        return f"{start} no break until the end"
    mean = _mean(broken, "first_break", "break_time", "thickness", "pieces", "width")
    return (
        f"{start} first break at {mean['first_break']:.2f} ({1e6 * mean['break_time']:.1f} us), wall"
        f" {1e3 * mean['thickness']:.2f} mm, {mean['pieces']:.0f} pieces {1e3 * mean['width']:.2f} mm wide"
    )


def _mean(bursts: Sequence[Burst], *names: str) -> dict[str, float]:
    return {name: float(np.mean([getattr(burst, name) for burst in bursts])) for name in names}
