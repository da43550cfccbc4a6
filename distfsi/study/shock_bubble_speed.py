"""Speed on the shock-bubble case at four resolutions, beside the paper's Table 2."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

from distfsi.mesh.communicator import Communicator
from distfsi.resources.bench import time_loop
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.study.references import SHOCK_BUBBLE_SPEEDS, MeshSpeed
from distfsi.study.shock_bubble import INPUT

SECONDS = 0.5  # of each of the loops of which the fastest counts


def cells_of(row: MeshSpeed) -> tuple[int, int]:
    """The cells along x and y that cover the case's 325 x 89 mm at the row's cell size."""
    return round(325 / row.spacing), round(89 / row.spacing)


def line(row: MeshSpeed, steps_per_second: float) -> str:
    """One line of the table."""
    cells = prod(cells_of(row))
    theirs, ours = (1e-6 * n * rate for n, rate in ((row.cells, row.steps_per_second), (cells, steps_per_second)))
    return (
        f"{row.spacing:9.3f}  {row.nodes:>9,}  {row.cells:>9,}  {row.steps_per_second:7.1f}  {theirs:13.2f}"
        f"  |{cells:>10,}  {steps_per_second:7.1f}  {ours:13.2f}"
    )


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The coarsest cells for a moment."""
    _study(communicator, overrides, SHOCK_BUBBLE_SPEEDS[:1], 0.0)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Print steps per second from the start of the case beside the paper's."""
    _study(communicator, overrides, SHOCK_BUBBLE_SPEEDS, SECONDS)


def _study(communicator: Communicator, overrides: Sequence[str], meshes: Sequence[MeshSpeed], seconds: float) -> None:
    if communicator.rank == 0:
        print(f"{'the paper, on an RTX 4090':>55}  |{'here':>34}")
        print("cell [mm]      nodes      cells  steps/s  Mcell-steps/s  |     cells  steps/s  Mcell-steps/s")
    for mesh in meshes:
        scene = load(INPUT, [f"domain.cells={list(cells_of(mesh))}", *overrides])
        _, step = time_loop(Simulation.of(scene, communicator), seconds)
        if communicator.rank == 0:
            print(line(mesh, 1.0 / step), flush=True)
