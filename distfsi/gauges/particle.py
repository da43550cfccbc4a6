"""A particle of a body, wherever it goes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from distfsi.gauges import AXES, Gauge, Kept, Particles, Run, TableProbe, each_step
from distfsi.laws.law import entry, vector
from distfsi.laws.registry import column_units

STRESSES = ("xx", "yy", "zz", "xy", "yz", "xz")
UNITS = {
    "position": "m",
    "velocity": "m/s",
    "density": "kg/m3",
    "pressure": "Pa",
    "energy": "J/kg",
    "von_mises": "Pa",
    "stress": "Pa",
    **column_units(),
}


@dataclass(frozen=True)
class ParticleGauge(Gauge):
    """A particle of a body, wherever it goes: all its fields. Velocities are those of half a step before."""

    body: str = entry("name of the body")
    position: tuple[float, ...] = vector("m", "the particle nearest to it at the start")
    every: float | None = each_step()

    needs = "solid"

    def location(self, axes: str = AXES) -> str:
        return f"particle of body '{self.body}' at ({', '.join(f'{x:g}' for x in self.position)}) m at first"

    def faults(self, dimensions: int, bodies: Sequence[str]) -> Iterator[tuple[str, str]]:
        if self.body not in bodies:
            yield "body", f"'{self.body}' is no body"

    def probe(self, run: Run) -> TableProbe:
        return ParticleProbe(self, run)


class ParticleProbe(TableProbe):
    """The output of a particle, known by its id, without what never changes."""

    def __init__(self, gauge: ParticleGauge, run: Run):
        c, body = run.particles.columns, run.bodies.index(gauge.body)
        distance = np.where(c["body"] == body, ((c["position"] - gauge.position) ** 2).sum(axis=1), np.inf)
        near = np.lexsort((c["id"], distance))[:1]
        candidates = run.communicator.concatenate(np.column_stack([distance[near], c["id"][near]]))
        self._id = int(candidates[np.lexsort(candidates.T[::-1])[0], 1])
        # The columns are those of the output, whatever a solid has.
        fields = _fields(run.particles, near[:0])
        self.columns = [column for name, array in fields.items() for column in _columns(name, array)]

    def rows(self, run: Run) -> np.ndarray:
        fields = _fields(run.particles, np.flatnonzero(run.particles.columns["id"] == self._id))
        own = np.column_stack(list(fields.values())).astype(np.float64)
        return run.communicator.concatenate(own)

    def kept(self) -> Kept:
        return {"id": np.array([self._id])}

    def bring_back(self, kept: Kept) -> None:
        self._id = int(kept["id"][0])


def _fields(particles: Particles, chosen: np.ndarray) -> dict[str, np.ndarray]:
    """The output of some particles, vectors with one component per dimension."""
    fields = {name: array for name, array in particles.outputs(chosen).items() if name not in ("id", "body")}
    return fields | {name: fields[name][:, : particles.dimensions] for name in ("position", "velocity")}


def _columns(name: str, array: np.ndarray) -> list[str]:
    """Names and units of the columns of a field."""
    unit = f" [{UNITS[name]}]" if name in UNITS else ""
    if array.ndim == 1:
        return [name + unit]
    return [f"{name}_{part}{unit}" for part in (STRESSES if name == "stress" else AXES[: array.shape[1]])]
