"""Which method of the fluid gives the smallest error for the time it takes: every choice alone, and some together.

On problems with exact answers: L1 errors of density, velocity and pressure, each over its mean size, and the mean of
the three, against seconds of one core's time (user and system) from the second step on; those of a tube are per row.
"""

from __future__ import annotations

import csv
import time as clock
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.errors import Diverged, InputError
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.scatter import Point, draw_scatter
from distfsi.scene.description import Scene
from distfsi.study.choices import Method, default, exists, name_of, settings, varied_alone
from distfsi.study.problems import PROBLEMS, QUANTITIES, WATER_AIR, Problem, riemann_of, start
from distfsi.study.references import PEER_SPEEDS, WATER_AIR_ERRORS

DIRECTORY = Path("out/study_frontier_fluid")
FINER = (0.5, 2.0)
COMBINATIONS: tuple[tuple[Method, float], ...] = (  # and the cells along x over those of the default
    ({"fluid.reconstruction": "van_leer", "time.scheme": "rk2"}, 1.0),
    ({"fluid.reconstruction": "van_leer", "time.scheme": "rk2"}, 2.0),
    ({"fluid.reconstruction": "van_leer", "fluid.riemann": "adaptive"}, 1.0),
    ({"fluid.reconstruction": "van_leer", "fluid.precision": "float32"}, 1.0),
    ({"fluid.reconstruction": "van_leer", "time.scheme": "rk2", "fluid.precision": "float32"}, 1.0),
    ({"fluid.reconstruction": "van_leer", "time.scheme": "rk2", "fluid.precision": "float32"}, 2.0),
    ({"fluid.reconstruction": "van_leer", "fluid.sharpening": "true"}, 1.0),
    ({"fluid.reconstruction": "van_leer", "fluid.sharpening": "true", "time.scheme": "rk2"}, 1.0),
    ({"fluid.reconstruction": "van_leer", "fluid.sharpening": "true", "time.scheme": "rk2"}, 2.0),
    ({"fluid.reconstruction": "weno5", "fluid.sharpening": "true"}, 1.0),
    ({"fluid.reconstruction": "weno5", "fluid.sharpening": "true"}, 2.0),
    ({"fluid.reconstruction": "first_order", "fluid.riemann": "rusanov", "time.scheme": "rk2"}, 2.0),
)


@dataclass(frozen=True)
class Variant:
    """A method on so many times the default's cells along each axis; `group`: which choice it stands for."""

    name: str
    group: str
    method: Method
    finer: float = 1.0


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a variant made of a problem; without errors where it failed, and why."""

    variant: Variant
    cells: int
    steps: int
    seconds: float
    errors: np.ndarray | None
    failure: str = ""

    @property
    def error(self) -> float:
        """Mean of the three errors, NaN of a failure."""
        return float(np.mean(self.errors)) if self.errors is not None else np.nan


def variants() -> Iterator[Variant]:
    """The default, every choice alone, the default finer and coarser, and the combinations that the input knows."""
    yield Variant("default", "default", {})
    for method in varied_alone():
        (key,) = method
        yield Variant(name_of(method), key, method)
    for finer in FINER:
        yield Variant(f"default, {_times(finer)}", "resolution", {}, finer)
    for method, finer in COMBINATIONS:
        if exists(method):
            times = "" if finer == 1.0 else f", {_times(finer)}"
            yield Variant(name_of(method) + times, "combination", method, finer)


def _times(finer: float) -> str:
    return f"cells x{finer:g}"


def measure(problem: Problem, variant: Variant, cells: int, overrides: Sequence[str]) -> Outcome:
    """Run a variant on a problem whose default has so many cells along x."""
    cells = round(variant.finer * cells)
    try:
        scene = problem.scene(cells, [*settings(variant.method), *overrides])
    except InputError as error:
        return Outcome(variant, cells, 0, np.nan, None, str(error).splitlines()[0])
    simulation = start(scene)
    started = clock.process_time()
    try:
        while not simulation.done:
            if simulation.steps == 1:  # what comes before compiles
                started = clock.process_time()
            simulation.step()
    except Diverged as error:
        return Outcome(variant, cells, simulation.steps, np.nan, None, str(error))
    seconds = (clock.process_time() - started) / (problem.rows or 1)
    return Outcome(variant, cells, simulation.steps, seconds, problem.errors(simulation))


def front(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Those that no other beats in both time and error, the fastest first."""
    best, found = np.inf, []
    for outcome in sorted((o for o in outcomes if o.errors is not None), key=lambda o: (o.seconds, o.error)):
        if outcome.error < best:
            best = outcome.error
            found.append(outcome)
    return found


# ---- other codes -----------------------------------------------------------------------------------------------------


def peer_points(scene: Scene, reference: Outcome) -> list[Point]:
    """Errors of other codes on the water/air tube against the time they take for as many steps per cell as ours."""
    scales = _sizes_over_ranges(scene)
    points = []
    for peer in WATER_AIR_ERRORS:
        errors = np.array([peer.density, peer.velocity, peer.pressure]) / (scales if peer.code == "MFC" else 1.0)
        seconds = _seconds(_speed(peer.code, peer.scheme), peer.cells, reference)
        points.append(Point(seconds, errors.mean(), f"{peer.code} {peer.scheme}, {peer.cells} cells", "peers"))
    return points


def _sizes_over_ranges(scene: Scene) -> np.ndarray:
    """Mean size over range of the exact density, velocity and pressure: MFC's errors are over the range."""
    solution, interface = riemann_of(scene)
    x = np.linspace(scene.domain.lower[0], scene.domain.upper[0], 10001)
    values = solution.sample((x - interface) / scene.time.end)[:3]
    return np.array([np.abs(v).mean() / np.ptp(v) for v in values])


def _speed(code: str, scheme: str) -> float:
    return next(
        s.cell_steps_per_second for s in PEER_SPEEDS if s.code == code and scheme.startswith(s.scheme.split("-")[0])
    )


def _seconds(speed: float, cells: int, reference: Outcome) -> float:
    return cells * reference.steps * cells / reference.cells / speed


def peer_lines(problem: Problem, reference: Outcome) -> list[tuple[float, str]]:
    """What other codes take for the default's cells and steps with two phases, where only their speed is known [s]."""
    cells = reference.cells * (1 if problem.rows else reference.cells)
    return [
        (cells * reference.steps / peer.cell_steps_per_second, f"{peer.code} {peer.scheme}") for peer in PEER_SPEEDS
    ]


# ---- what is shown ---------------------------------------------------------------------------------------------------


def draw(problem: Problem, outcomes: Sequence[Outcome], scene: Scene) -> None:
    """The chart of one problem."""
    best = front(outcomes)
    points = [
        Point(o.seconds, o.error, o.variant.name, o.variant.group, o in best) for o in outcomes if o.errors is not None
    ]
    known = problem is WATER_AIR
    others = peer_points(scene, outcomes[0]) if known else ()
    lines = () if known or len(present(scene.fluid).phases) == 1 else peer_lines(problem, outcomes[0])
    per_row = " per row" if problem.rows else ""
    draw_scatter(
        DIRECTORY / f"{problem.name}.png",
        f"{problem.title}: default {outcomes[0].cells} cells along x",
        f"seconds of one core{per_row}",
        "mean relative L1 error of density, velocity and pressure",
        points,
        others,
        lines,
    )


def line(outcome: Outcome) -> str:
    """One outcome as a line of the table."""
    if outcome.errors is None:
        return f"  {outcome.variant.name:45} {outcome.cells:6}  failed: {outcome.failure}"
    errors = "".join(f"{e:10.2e}" for e in (outcome.error, *outcome.errors))
    return f"  {outcome.variant.name:45} {outcome.cells:6}{errors}{outcome.seconds:11.4f}"


def write(rows: Sequence[tuple[Problem, Outcome, bool]]) -> None:
    """All outcomes as CSV."""
    DIRECTORY.mkdir(parents=True, exist_ok=True)
    with (DIRECTORY / "frontier.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        names = [f"error of {quantity}" for quantity in QUANTITIES]
        table.writerow(["problem", "method", "cells", "seconds", "error", *names, "on the front", "failure"])
        for problem, o, best in rows:
            errors = o.errors if o.errors is not None else [np.nan] * len(QUANTITIES)
            numbers = [f"{value:.4g}" for value in (o.seconds, o.error, *errors)]
            front = "yes" if best else "no"
            table.writerow([problem.name, o.variant.name, o.cells, *numbers, front, o.failure])


def compare(problem: Problem, chosen: Sequence[Variant], cells: int, overrides: Sequence[str]) -> list[Outcome]:
    """Run variants on a problem, print them as they come, and draw their chart."""
    names = "".join(f"{name:>10}" for name in ("error", "rho", "u", "p"))
    print(f"\n{problem.title}\n  {'method':45} {'cells':>6}{names}{'seconds':>11}")
    outcomes = []
    for variant in chosen:
        outcomes.append(measure(problem, variant, cells, overrides))
        print(line(outcomes[-1]), flush=True)
    print("  front: " + "; ".join(outcome.variant.name for outcome in front(outcomes)))
    draw(problem, outcomes, problem.scene(cells))
    return outcomes


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The default, one choice and one combination on few cells."""
    every = list(variants())
    _study(communicator, [every[0], every[1], every[-1]], {p: p.quick_cells for p in PROBLEMS}, overrides)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run all variants on all problems; print tables and fronts; leave a CSV file and charts in DIRECTORY."""
    _study(communicator, list(variants()), {problem: problem.cells for problem in PROBLEMS}, overrides)


def _study(
    communicator: Communicator, chosen: Sequence[Variant], cells: Mapping[Problem, int], overrides: Sequence[str]
) -> None:
    if communicator.size > 1:
        raise InputError(["study frontier fluid: runs on one rank"])
    print("default: " + ", ".join(f"{key} {word}" for key, word in default().items()))
    rows = []
    with threadpool_limits(1):
        for problem in PROBLEMS:
            outcomes = compare(problem, chosen, cells[problem], overrides)
            best = front(outcomes)
            rows += [(problem, outcome, outcome in best) for outcome in outcomes]
    write(rows)
    print(f"\ntable and charts in {DIRECTORY}", flush=True)
