"""Which form and viscosity of the solid gives the smallest error for the time it takes, on problems with answers.

The error is the mean size of the relative errors of a problem's figures, energy aside; the time is that of one core
(user and system) from the second step on.
"""

from __future__ import annotations

import csv
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.errors import Diverged, InputError
from distfsi.mesh.communicator import Communicator
from distfsi.output.scatter import Point, draw_scatter
from distfsi.study.solids import CANTILEVER, FLYER, PISTON, PROBLEMS, TAYLOR, VERNEY, Figure, Problem

DIRECTORY = Path("out/study_frontier_solid")
TOTAL, UPDATED = "solid.form=total_lagrangian", "solid.form=updated_lagrangian"
VARIANTS: dict[str, tuple[str, ...]] = {
    "total Lagrangian": (TOTAL,),
    "total, alpha 0, beta 1": (TOTAL, "solid.viscosity_alpha=0", "solid.viscosity_beta=1"),
    "total, zero energy x3": (TOTAL, "solid.zero_energy=0.3"),
    "total, Green-Naghdi": (TOTAL, "solid.objective_rate=green_naghdi"),
    "updated Lagrangian": (UPDATED,),
    "updated, alpha 0.5, beta 1": (UPDATED, "solid.viscosity_alpha=0.5", "solid.viscosity_beta=1"),
    "updated, alpha 0, beta 1": (UPDATED, "solid.viscosity_alpha=0", "solid.viscosity_beta=1"),
    "updated, h = 2 spacings": (UPDATED, "solid.smoothing=2", "solid.viscosity_alpha=0", "solid.viscosity_beta=1"),
}
SPACINGS = {FLYER: 3, PISTON: 3, VERNEY: 2, TAYLOR: 1, CANTILEVER: 1}  # how many of a problem's, from the coarsest on


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a variant made of a problem; no figures where it failed, and why."""

    variant: str
    spacing: float
    particles: int
    steps: int
    seconds: float
    figures: tuple[Figure, ...]
    failure: str = ""

    @property
    def error(self) -> float:
        """Mean size of the errors, NaN of a failure."""
        return float(np.mean([abs(f.error) for f in self.figures if f.name != "energy"] or [np.nan]))


def measure(problem: Problem, variant: str, spacing: float, overrides: Sequence[str]) -> Outcome:
    """Run a variant on a problem at a spacing [m]."""
    simulation = problem.start(spacing, [*VARIANTS[variant], *overrides])
    particles = len(simulation.solid.columns["id"])
    _compile(problem, variant, spacing, overrides)
    started = clock.process_time()
    try:
        figures = tuple(problem.measure(simulation))
    except (Diverged, IndexError) as error:  # an index error: what is measured did not happen
        return Outcome(variant, spacing, particles, simulation.steps, np.nan, (), str(error).splitlines()[0])
    return Outcome(variant, spacing, particles, simulation.steps, clock.process_time() - started, figures)


def _compile(problem: Problem, variant: str, spacing: float, overrides: Sequence[str]) -> None:
    problem.start(spacing, [*VARIANTS[variant], *overrides]).step()


def front(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Those that no other beats in both time and error, the fastest first."""
    best, found = np.inf, []
    for outcome in sorted((o for o in outcomes if o.figures), key=lambda o: (o.seconds, o.error)):
        if outcome.error < best:
            best = outcome.error
            found.append(outcome)
    return found


def line(o: Outcome) -> str:
    """One outcome as a line of the table."""
    head = f"  {o.variant:28} {1e3 * o.spacing:7.3g} mm {o.particles:6}"
    if o.failure:
        return f"{head}  failed: {o.failure}"
    figures = "; ".join(f"{f.name} {f.found:.5g} ({100.0 * f.error:+.2f} %)" for f in o.figures if f.name != "energy")
    return f"{head} {o.seconds:8.2f} s  {100.0 * o.error:6.2f} %  {figures}"


def draw(problem: Problem, outcomes: Sequence[Outcome], best: Sequence[Outcome]) -> None:
    """The chart of one problem."""
    points = [
        Point(o.seconds, o.error, f"{o.variant}, {1e3 * o.spacing:g} mm", o.variant, o in best)
        for o in outcomes
        if o.figures
    ]
    labels = ("seconds of one core", "mean relative error of the figures")
    draw_scatter(DIRECTORY / f"{problem.name}.png", problem.title, *labels, points)


def write(rows: Sequence[tuple[Problem, Outcome, bool]]) -> None:
    """All outcomes as CSV."""
    with (DIRECTORY / "frontier.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            [
                "problem",
                "method",
                "spacing [m]",
                "particles",
                "steps",
                "seconds",
                "error",
                "front",
                "figures",
                "failure",
            ]
        )
        for problem, o, best in rows:
            figures = "; ".join(f"{f.name} {f.found:.6g} expected {f.expected:.6g}" for f in o.figures)
            numbers = [f"{o.spacing:g}", o.particles, o.steps, f"{o.seconds:.4g}", f"{o.error:.4g}"]
            table.writerow([problem.name, o.variant, *numbers, "yes" if best else "no", figures, o.failure])


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Two forms on the waves at the coarsest spacing."""
    _study(communicator, ("total Lagrangian", "updated Lagrangian"), {FLYER: 1, PISTON: 1}, overrides)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run all variants on all problems; print tables and fronts; leave a CSV file and charts in DIRECTORY."""
    _study(communicator, tuple(VARIANTS), SPACINGS, overrides)


def _study(communicator, variants, spacings, overrides) -> None:
    if communicator.size > 1:
        raise InputError(["study frontier solid: runs on one rank"])
    DIRECTORY.mkdir(parents=True, exist_ok=True)
    rows = []
    with threadpool_limits(1):
        for problem in (p for p in PROBLEMS if p in spacings):
            print(f"\n{problem.title}")
            outcomes = []
            for variant in variants:
                for spacing in problem.spacings[: spacings[problem]]:
                    outcomes.append(measure(problem, variant, spacing, overrides))
                    print(line(outcomes[-1]), flush=True)
            best = front(outcomes)
            print("  front: " + "; ".join(f"{o.variant}, {1e3 * o.spacing:g} mm" for o in best))
            draw(problem, outcomes, best)
            rows += [(problem, outcome, outcome in best) for outcome in outcomes]
    write(rows)
    print(f"\ntable and charts in {DIRECTORY}", flush=True)
