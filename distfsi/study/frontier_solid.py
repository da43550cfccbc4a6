"""Which form and viscosity of the solid gives the smallest error for the time it takes, on problems with answers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from distfsi.mesh.communicator import Communicator
from distfsi.simulation import Simulation
from distfsi.study.frontier import Frontier
from distfsi.study.solids import CANTILEVER, FLYER, PISTON, TAYLOR, VERNEY, Problem

DIRECTORY = Path("out/study_frontier_solid")
TOTAL, UPDATED = "solid.form=total_lagrangian", "solid.form=updated_lagrangian"
VARIANTS: dict[str, tuple[str, ...]] = {
    "total Lagrangian": (TOTAL,),
    "total, alpha 0, beta 1": (TOTAL, "solid.viscosity_alpha=0", "solid.viscosity_beta=1"),
    "total, zero energy 0.3": (TOTAL, "solid.zero_energy=0.3"),
    "total, Green-Naghdi": (TOTAL, "solid.objective_rate=green_naghdi"),
    "updated Lagrangian": (UPDATED,),
    "updated, alpha 0.5, beta 1": (UPDATED, "solid.viscosity_alpha=0.5", "solid.viscosity_beta=1"),
    "updated, alpha 0, beta 1": (UPDATED, "solid.viscosity_alpha=0", "solid.viscosity_beta=1"),
    "updated, artificial stress": (UPDATED, "solid.artificial_stress=0.3"),
    "updated, h = 2 spacings": (UPDATED, "solid.smoothing=2", "solid.viscosity_alpha=0", "solid.viscosity_beta=1"),
}
SPACINGS = {FLYER: 3, PISTON: 3, VERNEY: 2, TAYLOR: 1, CANTILEVER: 1}  # how many of a problem's, from the coarsest on


def start(problem: Problem, variant: str, spacing: float, overrides: Sequence[str]) -> Simulation:
    """A variant's run of a problem before its first step."""
    return problem.start(spacing, [*VARIANTS[variant], *overrides])


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Two forms on the waves at the coarsest spacing."""
    problems = {FLYER: 1, PISTON: 1}
    Frontier("frontier solid", DIRECTORY, start).run(
        communicator, ("total Lagrangian", "updated Lagrangian"), problems, overrides
    )


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run all variants on all problems; print tables and fronts; leave a CSV file and charts in DIRECTORY."""
    Frontier("frontier solid", DIRECTORY, start).run(communicator, tuple(VARIANTS), SPACINGS, overrides)
