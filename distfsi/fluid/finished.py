"""The end of a finished run in radial coordinates, for another one that goes on from it."""

from __future__ import annotations

from ast import literal_eval
from collections.abc import Mapping
from itertools import count, takewhile
from pathlib import Path

import numpy as np

from distfsi.coordinates import Coordinates
from distfsi.errors import InputError
from distfsi.laws.law import FluidEos
from distfsi.laws.registry import laws_of
from distfsi.narrowing import present
from distfsi.output.restart import Restart, newest_restart
from distfsi.output.scene_text import describe
from distfsi.scene.description import Scene

PHASE = "fluid.phases."
CARRIED = ("fluid.detonation.burn", "fluid.afterburn.law")  # what the shares mean that a phase carries


class FinishedRun:
    """What the cells of a run hold at its end, with the phases of the scene that goes on from it.

    path, time   of its last restart file [s]
    coordinates  in which it was computed
    edges        (shells + 1,) of the cells along r [m]
    layers       (layers + 1,) edges along z [m], None in one dimension
    names        of this scene's phases
    phases       how many they are
    extra        how many rows stand behind the energy
    contents     (rows + 1, layers or 1, shells): masses, momentum along r (and z), energy, volume fraction of the first
                 of two phases, masses of the shares that one carries, and 1, per volume
    """

    def __init__(self, run: str, scene: Scene):
        """Raises InputError when the run has no restart file, or what it computed does not fit the scene."""
        path = newest_restart(Path(run)) if Path(run).is_dir() else Path(run)
        if path is None:
            raise InputError([f"fluid.map.run: {run} has no restart file: a run in radial coordinates ends with one"])
        restart = Restart(path)
        self.path, self.time = path, restart.time
        fluid = present(scene.fluid)
        self._there = restart.scene
        self.coordinates = self._coordinates()
        lower, upper, cells = (literal_eval(self._there[f"domain.{key}"]) for key in ("lower", "upper", "cells"))
        edges = [a + (b - a) / n * np.arange(n + 1) for a, b, n in zip(lower, upper, cells, strict=True)]
        self.edges, self.layers = edges[0], edges[1] if len(edges) > 1 else None
        self.names = [phase.name for phase in fluid.phases]
        self.phases = len(self.names)
        self._check_phases(scene)
        self.contents = self._arranged(restart.array("fluid/cells/state")[:, 0].astype(np.float64), scene)
        self.extra = self.rows - self.phases - len(self.coordinates.axes) - 1

    @property
    def rows(self) -> int:
        """Rows of the contents but for the last one."""
        return len(self.contents) - 1

    def _coordinates(self) -> Coordinates:
        """Raises InputError unless they are radial."""
        kinds = {kind.__name__: kind for kind in laws_of(Coordinates) if kind.radial}
        if self._there["domain.coordinates"] not in kinds:
            text = f"{self.path} is a run in planar coordinates; expected cylindrical, spherical or axisymmetric"
            raise InputError([f"fluid.map.run: {text}"])
        return kinds[self._there["domain.coordinates"]]()

    @property
    def _names_there(self) -> list[str]:
        return names_in(self._there)

    def _check_phases(self, scene: Scene) -> None:
        """Each phase of the run is one of the scene, with the same equation of state; cells hold energies that are
        counted alike."""
        here, faults = describe(scene), []
        for name in self._names_there:
            if name not in self.names:
                faults.append(f"fluid.phases: has no '{name}', which {self.path} holds")
        alike = (*(f"{PHASE}{name}.eos" for name in self._names_there), *CARRIED)
        faults += [
            f"{key}: {here.get(key, 'absent')}; was {self._there.get(key, 'absent')} in {self.path}"
            for key in sorted(here.keys() | self._there.keys())
            if key.startswith(alike) and here.get(key) != self._there.get(key)
        ]
        faults += self._unlike_energies(here)
        if faults:
            raise InputError(faults)

    def _unlike_energies(self, here: Mapping[str, str]) -> list[str]:
        """Faults of a precision that is another, and of phases whose energies are counted from another density."""
        key, there = "fluid.precision", self._there
        if here[key] != there[key]:
            return [f"{key}: {here[key]}; was {there[key]} in {self.path}"]
        if here[key] == repr("float64"):
            return []
        return [
            f"fluid.regions: {name} has {first_density(here, name)} kg/m3 in its first one, from where float32 counts"
            f" energies; was {first_density(there, name)} in {self.path}"
            for name in self._names_there
            if first_density(here, name) != first_density(there, name) and is_shifted(here[f"{PHASE}{name}.eos"])
        ]

    def _arranged(self, state: np.ndarray, scene: Scene) -> np.ndarray:
        """`contents` from the run's conserved state (variables, layers or 1, shells)."""
        there, fluid = self._names_there, present(scene.fluid)
        P = len(there)
        masses = {name: state[k] for k, name in enumerate(there)}
        energy = P + len(self.coordinates.axes)
        first = state[energy + 1] if P == 2 else np.ones(state.shape[1:])
        fraction = {there[-1]: 1.0 - first} | {there[0]: first}
        if self.phases == 2 and P == 1:
            (other,) = set(self.names) - set(there)
            trace = fluid.minimum_volume_fraction
            density = next(r.state.density for r in fluid.regions if self.names[r.state.phase] == other)
            masses[other] = np.full(state.shape[1:], trace * density)
            fraction = {there[0]: fraction[there[0]] - trace, other: np.full(state.shape[1:], trace)}
        rows = [*(masses[name] for name in self.names), *state[P : energy + 1]]
        rows += [fraction[self.names[0]]] if self.phases == 2 else []
        return np.stack([*rows, *state[energy + 1 + (P == 2) :], np.ones(state.shape[1:])])


# ---- scenes as texts by key (output/scene_text.py) -------------------------------------------------------------------


def names_in(scene: Mapping[str, str]) -> list[str]:
    """The names of its phases."""
    return [key.removeprefix(PHASE) for key, value in scene.items() if key.startswith(PHASE) and value == "Phase"]


def first_density(scene: Mapping[str, str], name: str) -> str | None:
    """The density of the first region of a phase; None: it has none."""
    states = takewhile(lambda state: f"{state}.phase" in scene, (f"fluid.regions.{n}.state" for n in count()))
    own = str(names_in(scene).index(name))
    return next((scene[f"{state}.density"] for state in states if scene[f"{state}.phase"] == own), None)


def is_shifted(eos: str) -> bool:
    """Whether in float32 energies are counted from rest by the equation of state of this class."""
    return any(kind.__name__ == eos and hasattr(kind, "shifted_reference") for kind in laws_of(FluidEos))
