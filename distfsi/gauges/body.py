"""A body as a whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from distfsi.gauges import AXES, Gauge, Kept, Run, TableProbe, each_step, per_extent
from distfsi.laws.law import entry

QUANTITIES = {"force": "N", "velocity": "m/s", "displacement": "m", "momentum": "N s", "impulse": "N s"}


@dataclass(frozen=True)
class BodyGauge(Gauge):
    """A body as a whole: the mean force of the fluid or of loads on it in the last step, velocity and displacement
    of its center of mass, momentum, and the impulse that these have given to it so far; of what has not left the
    domain."""

    body: str = entry("name of the body")
    every: float | None = each_step()

    needs = "solid"

    def location(self, axes: str = AXES) -> str:
        return f"body '{self.body}'"

    def faults(self, dimensions: int, bodies: Sequence[str]) -> Iterator[tuple[str, str]]:
        if self.body not in bodies:
            yield "body", f"'{self.body}' is no body"

    def probe(self, run: Run) -> TableProbe:
        return BodyProbe(self, run)


class BodyProbe(TableProbe):
    """Displacements are from where the body was when the run began."""

    def __init__(self, gauge: BodyGauge, run: Run):
        axes = AXES[: run.particles.dimensions]
        units = {name: per_extent(unit, len(axes)) if "N" in unit else unit for name, unit in QUANTITIES.items()}
        self.columns = [f"{name}_{axis} [{unit}]" for name, unit in units.items() for axis in axes]
        self._body = run.bodies.index(gauge.body)
        self._totals = run.particles.body_totals(self._body)
        self._start = self._totals["center"]
        self._impulse = np.zeros_like(self._start)

    def see(self, run: Run) -> None:
        self._totals = run.particles.body_totals(self._body)
        self._impulse = self._impulse + self._totals["impulse"]

    def rows(self, run: Run) -> np.ndarray:
        totals = self._totals
        force = totals["impulse"] / run.dt if run.dt > 0.0 else np.full_like(self._start, np.nan)
        velocity = totals["momentum"] / (totals["mass"] or np.nan)
        moved = totals["center"] - self._start
        return np.concatenate([force, velocity, moved, totals["momentum"], self._impulse])[None]

    def kept(self) -> Kept:
        return {"start": self._start, "impulse": self._impulse}

    def bring_back(self, kept: Kept) -> None:
        self._start, self._impulse = kept["start"], kept["impulse"]
