"""Which scheme of the coupling, with how many particles to a cell, gives the smallest error for the time it takes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from distfsi.mesh.communicator import Communicator
from distfsi.simulation import Simulation
from distfsi.study.couplings import FREE_PLATE, PISTON, PROBLEMS, Problem
from distfsi.study.frontier import Frontier

DIRECTORY = Path("out/study_frontier_coupling")
SCHEMES = {"cut cells": "cut_cells", "staircase": "staircase", "immersed boundary": "immersed_boundary"}
PER_CELL = (1.4, 2.0, 4.0)
VARIANTS = {f"{name}, {n:g} per cell": (scheme, n) for name, scheme in SCHEMES.items() for n in PER_CELL}


def start(problem: Problem, variant: str, spacing: float, overrides: Sequence[str]) -> Simulation:
    """A variant's run of a problem before its first step."""
    scheme, per_cell = VARIANTS[variant]
    return problem.start(spacing, per_cell, [f"coupling.scheme={scheme}", *overrides])


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Both schemes with two particles to a cell on the coarsest cells."""
    problems = {PISTON: 1, FREE_PLATE: 1}
    Frontier("frontier coupling", DIRECTORY, start).run(
        communicator, ("cut cells, 2 per cell", "immersed boundary, 2 per cell"), problems, overrides
    )


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run all variants on all problems; print tables and fronts; leave a CSV file and charts in DIRECTORY."""
    problems = {problem: len(problem.spacings) for problem in PROBLEMS}
    Frontier("frontier coupling", DIRECTORY, start).run(communicator, tuple(VARIANTS), problems, overrides)
