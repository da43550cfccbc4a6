"""Which variant of a method gives the smallest error for the time it takes, on problems with answers.

The error is the mean size of the relative errors of a problem's figures, energy aside; the time is that of one core
(user and system) from the second step on.
"""

from __future__ import annotations

import csv
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.errors import Diverged, InputError
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.scatter import Point, draw_scatter
from distfsi.simulation import Simulation
from distfsi.study.solids import Figure


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a variant made of a problem at a spacing [m]; no figures where it failed, and why."""

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

    @property
    def name(self) -> str:
        return f"{self.variant}, {_size(self.spacing)}"


@dataclass(frozen=True)
class Frontier:
    """A study: its name, where its files go, and how a variant starts a problem at a spacing with overrides.

    A problem has a `name`, a `title`, `spacings` from coarse to fine, and `measure(simulation)`, which runs it.
    """

    name: str
    directory: Path
    start: Callable[[Any, str, float, Sequence[str]], Simulation]

    def measure(self, problem: Any, variant: str, spacing: float, overrides: Sequence[str]) -> Outcome:
        """Run a variant on a problem at a spacing [m]."""
        simulation = self.start(problem, variant, spacing, overrides)
        particles = len(present(simulation.solid).columns["id"])
        self.start(problem, variant, spacing, overrides).step()  # compiles
        started = clock.process_time()
        try:
            figures = tuple(problem.measure(simulation))
        except Diverged as error:
            return Outcome(variant, spacing, particles, simulation.steps, np.nan, (), str(error).splitlines()[0])
        except IndexError:
            why = "what is measured did not happen by the end"
            return Outcome(variant, spacing, particles, simulation.steps, np.nan, (), why)
        return Outcome(variant, spacing, particles, simulation.steps, clock.process_time() - started, figures)

    def run(
        self, communicator: Communicator, variants: Sequence[str], problems: Mapping[Any, int], overrides: Sequence[str]
    ) -> None:
        """Run the variants on the problems, each at so many of its spacings; print tables and fronts; leave a CSV file
        and charts."""
        if communicator.size > 1:
            raise InputError([f"study {self.name}: runs on one rank"])
        self.directory.mkdir(parents=True, exist_ok=True)
        rows = []
        with threadpool_limits(1):
            for problem, count in problems.items():
                print(f"\n{problem.title}")
                outcomes = []
                for variant in variants:
                    for spacing in problem.spacings[:count]:
                        outcomes.append(self.measure(problem, variant, spacing, overrides))
                        print(line(outcomes[-1]), flush=True)
                best = front(outcomes)
                print("  front: " + "; ".join(outcome.name for outcome in best))
                self.draw(problem, outcomes, best)
                rows += [(problem, outcome, outcome in best) for outcome in outcomes]
                self.write(rows)
        print(f"\ntable and charts in {self.directory}", flush=True)

    def draw(self, problem: Any, outcomes: Sequence[Outcome], best: Sequence[Outcome]) -> None:
        """The chart of one problem."""
        points = [Point(o.seconds, o.error, o.name, o.variant, o in best) for o in outcomes if o.figures]
        labels = ("seconds of one core", "mean relative error of the figures")
        draw_scatter(self.directory / f"{problem.name}.png", problem.title, *labels, points)

    def write(self, rows: Sequence[tuple[Any, Outcome, bool]]) -> None:
        """All outcomes as CSV."""
        names = "problem,method,spacing [m],particles,steps,seconds,error,front,figures,failure"
        with (self.directory / "frontier.csv").open("w", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(names.split(","))
            for problem, o, best in rows:
                figures = "; ".join(f"{f.name} {f.found:.6g} expected {f.expected:.6g}" for f in o.figures)
                numbers = [f"{o.spacing:g}", o.particles, o.steps, f"{o.seconds:.4g}", f"{o.error:.4g}"]
                table.writerow([problem.name, o.variant, *numbers, "yes" if best else "no", figures, o.failure])


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
    head = f"  {o.variant:28} {_size(o.spacing):>9} {o.particles:6}"
    if o.failure:
        return f"{head}  failed: {o.failure}"
    figures = "; ".join(f"{f.name} {f.found:.5g} ({100.0 * f.error:+.2f} %)" for f in o.figures if f.name != "energy")
    return f"{head} {o.seconds:8.2f} s  {100.0 * o.error:6.2f} %  {figures}"


def _size(spacing: float) -> str:
    return f"{1e3 * spacing:.3g} mm"
