"""What a law of a material is: a frozen dataclass in a file of its own, named by the word that chooses it in the input.

The fields are the numbers that a scene gives, each with its unit, range and meaning; the first paragraph of the
docstring is what the input reference says. From them follow the tables of the input, its reference and schema
(scene/law_tables.py), and a file in the folder of its kind is all that a new law takes (laws/registry.py). Formulas are
methods in the subset of Python that kernels are made of, in which `self.NAME` is a number of the scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

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


class SolidEos(Law):
    """The pressure of a solid."""

    folder = "solid/eos"


class Strength(Law):
    """How a solid resists a change of its shape."""

    folder = "solid/strength"


class Failure(Law):
    """What breaks a solid."""

    folder = "solid/failure"
