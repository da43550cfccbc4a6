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
from typing import Any, ClassVar

NEEDED = object()  # the default of what the input must give


@dataclass(frozen=True)
class Entry:
    """What the input says of a field.

    meaning  in words
    unit     SI, "1" for a pure number; None: of what is no quantity, the type of the field says what it is
    vector   whether it is one number per dimension
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


def quantity(unit: str, meaning: str, *, default: object = NEEDED, **limits: float) -> Any:
    """A field that is a number (or None) in this unit, within the limits that `Entry` names."""
    return field(metadata={"entry": Entry(meaning, unit, limits, default)})


def number(meaning: str, *, default: object = NEEDED, **limits: float) -> Any:
    """A field that is a number without a unit."""
    return quantity("1", meaning, default=default, **limits)


def vector(unit: str, meaning: str, *, default: object = NEEDED, key: str | None = None) -> Any:
    """A field that has a number in this unit for each dimension; `key` in the input, if that is not its name."""
    return field(metadata={"entry": Entry(meaning, unit, {}, default, vector=True, key=key)})


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


class SolidEos(Law):
    """The pressure of a solid."""

    folder = "laws/solid/eos"

    def rest_bulk_modulus(self, density: float) -> float:
        """Bulk modulus [Pa] at rest, where the material has this density [kg/m3]."""
        raise NotImplementedError

    def behind_shock(self, u: float) -> tuple[float, float]:
        """By how much sound is faster [m/s] behind a shock of particle velocity u, and the volume there over that in
        front of it, as far as it is known."""
        return 0.0, 1.0


class Strength(Law):
    """How a solid resists a change of its shape, with `shear_modulus` [Pa] at rest."""

    folder = "laws/solid/strength"
    shear_modulus: float


class Failure(Law):
    """What breaks a solid."""

    folder = "laws/solid/failure"


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
