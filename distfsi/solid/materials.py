"""The materials of a scene's bodies: which laws they follow, with which numbers, and what each particle remembers.

Bodies of the same laws are one material, however their numbers differ: kernels are specialised for the laws of a
material, and find its numbers in tables with a row per body.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, cast

import numpy as np

from distfsi.device.emit import plain
from distfsi.device.source import Bound
from distfsi.laws.law import Column, Failure, Law, SolidEos, Strength
from distfsi.laws.solid.scatter import Scatter
from distfsi.scene.description import Body, Solid
from distfsi.solid.formulas.smoothing import smoothing_slope
from distfsi.solid.kernels.records import LawTables, RestState

SCATTER = Column("strength_scatter", "1", "factor of the strength of the particle", initial=1.0, written=False)
PRESSURE = Column("pressure", "Pa", "pressure that is carried")
RIGID = -1  # in the place of the number of a material
MINIMUM_MODULUS = 0.1  # of the bulk modulus at rest, which expanded hot material keeps


SolidLaw = type[SolidEos] | type[Strength] | type[Failure]


@dataclass(frozen=True)
class Material:
    """The laws that bodies follow; `scattered`: their strength differs from particle to particle."""

    eos: type[SolidEos]
    strength: type[Strength]
    failure: type[Failure] | None
    scattered: bool

    @classmethod
    def of(cls, body: Body) -> Material:
        """The laws of a body."""
        failure = body.failure
        scattered = failure is not None and failure.scatter is not None
        return cls(type(body.eos), type(body.strength), type(failure) if failure else None, scattered)

    @property
    def laws(self) -> dict[str, SolidLaw]:
        """The laws by their kind: eos, strength and, if the material can fail, failure."""
        return {name: getattr(self, name) for name in LawTables._fields if getattr(self, name)}

    @property
    def columns(self) -> tuple[Column, ...]:
        """What each particle remembers for its laws."""
        return tuple(column for law in self.laws.values() for column in law.columns)

    @property
    def memory(self) -> tuple[type[Any], ...]:
        """Records of what is remembered for each of the laws, in the order of the kernel's arguments."""
        return tuple(self._memory(name) for name in LawTables._fields)

    def _memory(self, name: str) -> type[Any]:
        columns = self.laws[name].columns if name in self.laws else ()
        return cast(type[Any], NamedTuple(f"{name.capitalize()}Memory", [(column.name, float) for column in columns]))

    @property
    def constants(self) -> dict[str, object]:
        """What the kernels of this material are specialised for, beside what all are."""
        sizes: dict[str, object] = {}
        for name in LawTables._fields:
            law = self.laws.get(name)
            sizes[f"{name.upper()}_FIELDS"] = len(fields(law)) if law else 0
            sizes[f"{name.upper()}_COLUMNS"] = len(law.columns) if law else 0
        return sizes | {"FAILS": self.failure is not None, "SCATTERED": self.scattered}

    @property
    def bindings(self) -> dict[str, Bound | type]:
        """The formulas of the laws, and the records of what is remembered."""
        bound = {f"{name}_response": Bound.from_table(law, "respond") for name, law in self.laws.items()}
        bound["free_swelling"] = Bound.from_table(self.eos, "free_swelling")
        for formula in ("elastic_density", "carried_share", "homologous_temperature"):
            bound[formula] = Bound.from_table(self.strength, formula)
        return bound | {record.__name__: record for record in self.memory}


class Materials:
    """The materials of a solid.

    materials  without repetition, in the order of the bodies
    number     (bodies,) which of them each body has; RIGID: none, it does not deform
    rest       of each body, on the host
    constants  what all kernels of the solid are specialised for
    columns    what particles remember, of all materials; a particle of another material keeps what it had at the start
    """

    def __init__(self, solid: Solid, dimensions: int):
        self.bodies, self.dimensions = solid.bodies, dimensions
        of_bodies = [None if body.motion else Material.of(body) for body in solid.bodies]
        self.materials = tuple(material for material in dict.fromkeys(of_bodies) if material)
        self.number = np.array([self.materials.index(each) if each else RIGID for each in of_bodies])
        self.rest = rest_state(solid.bodies, crack_width(solid.smoothing, dimensions))
        self.columns = self._columns()
        names = {column.name for column in self.columns}
        self.constants = {
            "POLAR_ROTATION": solid.objective_rate == "green_naghdi",
            "FAILS": any(body.failure for body in solid.bodies),
            "YIELDS": "plastic_strain" in names,
        }

    def _columns(self) -> tuple[Column, ...]:
        found = {column.name: column for material in self.materials for column in material.columns}
        scatter = (SCATTER,) if any(material.scattered for material in self.materials) else ()
        return (PRESSURE, *found.values(), *scatter)

    def tables(self, material: Material) -> LawTables:
        """The numbers of the laws; rows of bodies of other materials hold nothing."""
        numbers = [np.full((len(self.bodies), len(fields(law))), np.nan) for law in material.laws.values()]
        for b, body in enumerate(self.bodies):
            if self.number[b] == self.materials.index(material):
                for name, table in zip(material.laws, numbers, strict=True):
                    table[b] = numbers_of(getattr(body, name))
        return LawTables(*numbers, *[np.empty((len(self.bodies), 0))] * (len(LawTables._fields) - len(numbers)))

    def initial(self, body: np.ndarray, id: np.ndarray, volume: np.ndarray) -> dict[str, np.ndarray]:
        """The columns of particles at rest: their bodies, global ids and volumes [m^D], all (n,)."""
        n, components = len(body), self.dimensions * (self.dimensions + 1) // 2
        found = {"deviator": np.zeros((n, components)), "sound_speed": np.zeros(n)}
        for column in self.columns:
            found[column.name] = np.array([_initial(each, column) for each in self.bodies])[body]
        if SCATTER in self.columns:
            for b, each in enumerate(self.bodies):
                if each.failure and each.failure.scatter:
                    own = body == b
                    found[SCATTER.name][own] = weibull(each.failure.scatter, id[own], volume[own], self.dimensions)
        if self.constants["POLAR_ROTATION"]:
            found["stretch"] = np.zeros((n, components))
            found["stretch"][:, : self.dimensions] = 1.0
        return found


def _initial(body: Body, column: Column) -> float:
    """What the particles of a body remember at the start; 0 where no law of it has the column."""
    if not isinstance(column.initial, str):
        return column.initial
    laws = [law for law in (body.eos, body.strength, body.failure) if law and column in law.columns]
    return getattr(laws[0], column.initial) if laws else 0.0


def numbers_of(law: Law) -> list[float]:
    """The fields of a law as numbers: without limit where there is none; NaN for what is no number."""
    values = [getattr(law, field.name) for field in fields(law)]
    return [math.inf if v is None else float(v) if isinstance(v, int | float) else math.nan for v in values]


def rest_state(bodies: tuple[Body, ...], width: float) -> RestState:
    """The bodies at rest; `width` of a crack in spacings."""
    density = np.array([body.density for body in bodies])
    sound = np.array([body.eos.reference_sound_speed(body.density) for body in bodies])
    return RestState(
        density,
        density * sound * sound,
        MINIMUM_MODULUS * density * sound * sound,
        np.array([body.strength.shear_modulus for body in bodies]),
        np.array([body.strength.flow_stress_at_rest() for body in bodies]),
        np.array([width * body.spacing for body in bodies]),
    )


def crack_width(smoothing: float, dimensions: int) -> float:
    """The width [spacings] in which particles beside a crack take its energy, `smoothing` spacings being h.

    A crack that opens by d between two rows of a square lattice strains the rows at it by d over this width, and those
    beyond by less, as fewer of their bonds cross it: with linear softening all rows together take, as their strains
    sum up to d, what this width would take evenly.
    """
    reach = np.arange(-math.ceil(2.0 * smoothing), math.ceil(2.0 * smoothing) + 1.0)
    X = np.stack(np.meshgrid(*[reach] * dimensions, indexing="ij"))
    distance2 = np.sum(X**2, axis=0)
    slope = plain(smoothing_slope, {"DIMENSIONS": dimensions})(distance2, smoothing)
    weight = np.where(distance2 < 4.0 * smoothing**2, -slope, 0.0)
    return float(np.sum(weight * X[0] ** 2) / np.sum(weight * np.maximum(X[0], 0.0)))


# ---- scatter ---------------------------------------------------------------------------------------------------------


def weibull(scatter: Scatter, id: np.ndarray, volume: np.ndarray, dimensions: int) -> np.ndarray:
    """(n,) factors of a Weibull distribution whose mean is 1 for a volume size^D, lower for larger volumes: by the
    weakest link, a larger particle fails earlier.

    A particle's factor depends on the seed and its global id alone.
    """
    m = scatter.modulus
    mean = math.gamma(1.0 + 1.0 / m)
    return (-np.log(_uniform(scatter.seed, id)) * scatter.size**dimensions / volume) ** (1.0 / m) / mean


def _uniform(seed: int, id: np.ndarray) -> np.ndarray:
    """Numbers in (0, 1) that depend on nothing but the seed and each id (splitmix64)."""
    step = np.uint64(0x9E3779B97F4A7C15)
    with np.errstate(over="ignore"):
        z = np.uint64(seed) * np.uint64(0xD1342543DE82EF95) + (id.astype(np.uint64) + np.uint64(1)) * step
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            z = (z ^ (z >> np.uint64(shift))) * np.uint64(factor)
        z ^= z >> np.uint64(31)
    return ((z >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
