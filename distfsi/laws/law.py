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
    vector   whether it is one number per dimension
    series   whether it is any number of numbers
    limits   by name, "above", "at_least", "below", "at_most", in SI
    default  of the input, or NEEDED
    key      in the input, where it is not the field's name
    """

    meaning: str
    unit: str | None
    limits: Mapping[str, float]
    default: object
    vector: bool = False
    key: str | None = None
    series: bool = False


def quantity(unit: str, meaning: str, *, default: object = NEEDED, **limits: float) -> Any:
    """A field that is a number (or None) in this unit, within the limits that `Entry` names."""
    return field(metadata={"entry": Entry(meaning, unit, limits, default)})


def number(meaning: str, *, default: object = NEEDED, **limits: float) -> Any:
    """A field that is a number without a unit."""
    return quantity("1", meaning, default=default, **limits)


def vector(unit: str, meaning: str, *, default: object = NEEDED, key: str | None = None) -> Any:
    """A field that has a number in this unit for each dimension; `key` in the input, if that is not its name."""
    return field(metadata={"entry": Entry(meaning, unit, {}, default, vector=True, key=key)})


def series(unit: str, meaning: str) -> Any:
    """A field that has any number of numbers in this unit, at least one."""
    return field(metadata={"entry": Entry(meaning, unit, {}, NEEDED, series=True)})


def entry(meaning: str, *, default: object = NEEDED, **limits: float) -> Any:
    """A field that is no quantity: a whole number, or a record of its own."""
    return field(metadata={"entry": Entry(meaning, None, limits, default)})


@dataclass(frozen=True)
class Law:
    """A law of any kind; `folder` of the package holds those of its kind.

    partner  word of the other law that a body needs with this one: a solid's EOS with a strength, or the reverse
    """

    folder: ClassVar[str]
    partner: ClassVar[str | None] = None

    def check(self) -> None:
        """Raise ValueError, in words for the user, where fields do not go together."""


class FluidEos(Law):
    """The pressure of a fluid: p = reference(rho) + omega(rho) rho e, e [J/kg] counted from where the law likes.

    A law may also have shifted_reference(rho), for float32: the reference to energies counted from that at REST_DENSITY
    and without pressure.

    closed_form  whether phases relax along the hyperbola of fluid/formulas/relaxation.py; else it is fitted
    """

    folder = "laws/fluid"
    closed_form: ClassVar[bool] = False

    def reference(self, rho: float) -> tuple[float, float]:
        """A formula for kernels: the pressure without energy [Pa], and its slope with density [m2/s2]."""
        raise NotImplementedError

    def grueneisen(self, rho: float) -> tuple[float, float]:
        """A formula for kernels: the coefficient omega, and its slope with density [m3/kg]."""
        raise NotImplementedError

    def cold_curve(self, rho: float) -> tuple[float, float]:
        """Pressure [Pa] and energy [J/kg] of the coldest state, for checks of the input."""
        raise NotImplementedError

    @property
    def maximum_density(self) -> float:
        """No state of the fluid is as dense [kg/m3]."""
        return inf


class Burn(Law):
    """How an explosive burns. Its phase carries the share that is unburnt, which holds back the energy of detonation:
    the products' equation of state sees it when the share falls.

    density  of the explosive at rest [kg/m3]
    energy   of detonation [J/kg], of the products at that density
    speed    of detonation [m/s]
    pressure behind the front [Pa]
    """

    folder = "laws/burn"
    density: float
    energy: float
    speed: float | None
    pressure: float | None

    def unburnt(self, share, since, rho, spacing):
        """A formula for kernels: the share that is unburnt, where `share` was, a time `since` [s] the cell was lit, at
        the density rho [kg/m3] of the phase, in cells of a size `spacing` [m]."""
        raise NotImplementedError


class Afterburn(Law):
    """How products of detonation burn with air. Their phase carries the share that is left, which holds back `energy`
    [J/kg].

    needs_air  whether the phase beside them must be a gas
    """

    folder = "laws/afterburn"
    needs_air: ClassVar[bool] = False
    energy: float

    def left(self, share, unburnt, pressure, air, dt):
        """A formula for kernels: the share that is left after `dt` [s] at a pressure [Pa], where a share of the
        explosive is `unburnt`, and `air` is the mass of the other phase per mass of this one."""
        raise NotImplementedError


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
    """

    folder = "laws/solid/eos"
    columns: ClassVar[tuple[Column, ...]] = ()

    def reference_sound_speed(self, density):
        """Of the bulk [m/s], at rest at that `density` [kg/m3]."""
        raise NotImplementedError

    def rest_bulk_modulus(self, density: float) -> float:
        """Bulk modulus [Pa] at rest, where the material has this density [kg/m3]; for checks of the input."""
        return float(density * self.reference_sound_speed(density) ** 2)

    def behind_shock(self, u: float) -> tuple[float, float]:
        """By how much sound is faster [m/s] behind a shock of particle velocity u, and the volume there over that in
        front of it, as far as it is known."""
        return 0.0, 1.0

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
    """

    folder = "laws/solid/strength"
    columns: ClassVar[tuple[Column, ...]] = ()
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
    scatter  of the strength from particle to particle (laws/solid/scatter.py), if a law has such a field
    """

    scatter: Any = None

    folder = "laws/solid/failure"
    columns: ClassVar[tuple[Column, ...]]

    def respond(self, load: Load, dt, width, memory: FailureMemory):
        """All that is remembered, the damage first; `width` [m]: in which particles beside a crack take its energy."""
        raise NotImplementedError


PLASTIC_STRAIN = Column("plastic_strain", "1", "equivalent plastic strain")
DAMAGE = Column("damage", "1", "share of the stress that is no longer carried, of the pressure in tension only")


class Source(Law):
    """What accelerates everything alike: `acceleration` [m/s2], one component per dimension, times a share of it that
    may depend on time. A step takes the mean over itself, so that a free body gains the integral to round-off.

    steady  whether the share is the same at all times
    """

    folder = "laws/sources"
    steady: ClassVar[bool] = False
    acceleration: tuple[float, ...]

    def share(self, start: float, end: float) -> float:
        """The mean of the share over the time from `start` to `end` [s], which may be the same."""
        raise NotImplementedError


class PressureHistory(Law):
    """What comes in through an end of the domain: an overpressure that changes in time."""

    folder = "laws/histories"

    def overpressure(self, time: float) -> float:
        """[Pa], beyond the pressure of the inflow's state, at a `time` [s]."""
        raise NotImplementedError

    @property
    def lowest(self) -> float:
        """The lowest overpressure of all times [Pa]."""
        return 0.0
