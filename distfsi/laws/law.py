"""What a law of a material is: a frozen dataclass in a file of its own, named by the word that chooses it in the input.

The fields are the numbers that a scene gives, each with its unit, range and meaning; the first paragraph of the
docstring is what the input reference says. From them follow the tables of the input, its reference and schema
(scene/law_tables.py), and a file in the folder of its kind is all that a new law takes (laws/registry.py). Formulas are
methods in the subset of Python that kernels are made of, in which `self.NAME` is a number of the scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, ClassVar, NamedTuple

NEEDED = object()  # the default of what the input must give


@dataclass(frozen=True)
class Entry:
    """What the input says of a field.

    meaning  in words
    unit     SI, "1" for a pure number; None: of what is no quantity, the type of the field says what it is
    limits   by name, "above", "at_least", "below", "at_most", in SI
    default  of the input, or NEEDED
    """

    meaning: str
    unit: str | None
    limits: Mapping[str, float]
    default: object


def quantity(unit: str, meaning: str, *, default: object = NEEDED, **limits: float) -> Any:
    """A field that is a number (or None) in this unit, within the limits that `Entry` names."""
    return field(metadata={"entry": Entry(meaning, unit, limits, default)})


def number(meaning: str, *, default: object = NEEDED, **limits: float) -> Any:
    """A field that is a number without a unit."""
    return quantity("1", meaning, default=default, **limits)


def entry(meaning: str, *, default: object = NEEDED, **limits: float) -> Any:
    """A field that is no quantity: a whole number, or a record of its own."""
    return field(metadata={"entry": Entry(meaning, None, limits, default)})


class Law:
    """A law of any kind; `folder` in laws/ holds those of its kind."""

    folder: ClassVar[str]

    def check(self) -> None:
        """Raise ValueError, in words for the user, where fields do not go together."""


class FluidEos(Law):
    """The pressure of a fluid."""

    folder = "fluid"


# ---- solids ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Column:
    """A number that each particle of a material remembers, under a name that a law's `memory` has as a field.

    unit     SI, "1" for a pure number
    initial  at the start: a number, or the name of the field of the law that gives it
    written  whether it stands in field files and gauges
    """

    name: str
    unit: str
    meaning: str
    initial: float | str = 0.0
    written: bool = True


class EosMemory(NamedTuple):
    """What a particle remembers for its equation of state: a field per column of the law."""


class StrengthMemory(NamedTuple):
    """What a particle remembers for its strength model: a field per column of the law."""


class FailureMemory(NamedTuple):
    """What a particle remembers for its failure model: a field per column of the law."""


class Rest(NamedTuple):
    """A material before anything happens: density [kg/m3] and bulk modulus [Pa]."""

    density: float
    bulk_modulus: float


class Trial(NamedTuple):
    """What a strength model is asked about: the material after a step without plastic flow, as if it were intact.

    stress       von Mises stress [Pa]
    pressure     [Pa]
    density      [kg/m3]
    compression  density over that at rest - 1
    bulk         isentropic bulk modulus [Pa]
    rest_bulk    bulk modulus at rest [Pa]
    rate         equivalent rate of strain [1/s]
    compaction   growth in the step of the compression that stays without pressure
    damage       0 to 1: what share of the intact stress is no longer carried
    """

    stress: float
    pressure: float
    density: float
    compression: float
    bulk: float
    rest_bulk: float
    rate: float
    compaction: float
    damage: float


class Load(NamedTuple):
    """What a failure model is asked about: the intact material after plastic flow.

    increment    of the plastic strain in the step
    flow_stress  von Mises stress [Pa]
    pressure     [Pa]
    principal    largest principal stress [Pa]
    energy       [J/m3] that a crack lets go
    bulk         isentropic bulk modulus [Pa]
    homologous   temperature from 0 at the start to 1 when molten
    factor       of the strength of this particle: 1 without scatter
    """

    increment: float
    flow_stress: float
    pressure: float
    principal: float
    energy: float
    bulk: float
    homologous: float
    factor: float


class SolidEos(Law):
    """The pressure of a solid.

    columns  what each particle remembers
    needs    the word of the strength model without which it means nothing
    """

    folder = "solid/eos"
    columns: ClassVar[tuple[Column, ...]] = ()
    needs: ClassVar[str] = ""

    def reference_sound_speed(self, density):
        """Of the bulk [m/s], at rest at that `density` [kg/m3]."""
        raise NotImplementedError

    def respond(self, density, energy, rest: Rest, memory: EosMemory):
        """Pressure [Pa], isentropic bulk modulus [Pa], compaction of `Trial`; then all that is remembered.

        At a `density` [kg/m3] and a specific internal `energy` [J/kg].
        """
        raise NotImplementedError

    def free_swelling(self, energy):
        """Logarithm of the volume over that at rest at which material of that specific `energy` [J/kg] has no pressure;
        0 where it would have to be compressed."""
        return 0.0


class Strength(Law):
    """How a solid resists a change of its shape. A law with shear strength has a field `shear_modulus` [Pa].

    columns  what each particle remembers
    needs    the word of the equation of state without which it means nothing
    """

    folder = "solid/strength"
    columns: ClassVar[tuple[Column, ...]] = ()
    needs: ClassVar[str] = ""
    shear_modulus = 0.0

    def flow_stress_at_rest(self):
        """Von Mises stress [Pa] at which plastic flow begins in virgin material, for bonds that give way with it."""
        return inf

    def respond(self, trial: Trial, dt, memory: StrengthMemory):
        """Von Mises stress [Pa], pressure [Pa] and increment of the plastic strain of a step; then all that is
        remembered. By default the material is elastic."""
        return (trial.stress, trial.pressure, 0.0)

    def elastic_density(self, density, memory: StrengthMemory):
        """What the equation of state takes for the `density` [kg/m3]: without the part of it that stays without
        pressure, if that is the strength model's."""
        return density

    def carried_share(self, pressure, damage):
        """What share of the deviatoric stress of the intact material is carried."""
        return 1.0 - damage

    def homologous_temperature(self, memory: StrengthMemory):
        """0 at the start to 1 when molten; 0 where no temperature is known."""
        return 0.0


class Failure(Law):
    """What breaks a solid. The first of its columns is DAMAGE.

    columns  what each particle remembers
    """

    folder = "solid/failure"
    columns: ClassVar[tuple[Column, ...]]

    def respond(self, load: Load, dt, width, memory: FailureMemory):
        """All that is remembered, the damage first; `width` [m]: in which particles beside a crack take its energy."""
        raise NotImplementedError


PLASTIC_STRAIN = Column("plastic_strain", "1", "equivalent plastic strain")
DAMAGE = Column("damage", "1", "share of the stress that is no longer carried, of the pressure in tension only")
