"""Kinds of values in an input: quantities with units, vectors, counts, names; and the tables that hold them.

Validation gets a context {"dimensions": int | None, "phases": names, "folder": path}, taken from the raw input, so that
vectors and names are checked where they stand.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, cast

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, WithJsonSchema
from pydantic_core import PydanticCustomError

from distfsi.scene.units import to_si

LARGEST_COUNT = 10**15  # floats count as far


class Table(BaseModel):
    """A TOML table; unknown keys are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Mirror(Table):
    """A table that mirrors one class of description.py field by field, besides the word that chooses it."""

    describes: ClassVar[type]
    word: ClassVar[str] = "kind"

    def build(self) -> Any:
        """The instance of the described class."""
        values = {name: getattr(self, name) for name in type(self).model_fields if name != self.word}
        built = {name: value.build() if isinstance(value, Mirror) else value for name, value in values.items()}
        return self.describes(**built)


def quantity(unit: str, **limits: float) -> Any:
    """Type of a number in `unit` within pydantic's `limits` (gt, ge, lt, le), given in SI or as a text with a unit."""
    words = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}
    shown = {"type": ["number", "string"], "unit": unit} | {words[key]: limit for key, limit in limits.items()}
    field: Any = Field(**cast(Any, limits))
    return Annotated[float, field, BeforeValidator(lambda value: to_si(value, unit)), WithJsonSchema(shown)]


def vector(unit: str) -> Any:
    """Type of a list of numbers in `unit`, one per dimension of the domain; in 1D also a single number."""

    def convert(value: Any, info: ValidationInfo) -> tuple[float, ...]:
        entries = value if isinstance(value, list) else [value]
        wanted = (info.context or {}).get("dimensions")
        if wanted is not None and len(entries) != wanted:
            raise ValueError(f"has {len(entries)} entries, needs {wanted}, one per dimension of the domain")
        return tuple(to_si(entry, unit) for entry in entries)

    shown = {"type": ["array", "number", "string"], "items": {"type": ["number", "string"]}, "unit": unit}
    return Annotated[tuple[float, ...], BeforeValidator(convert), WithJsonSchema(shown)]


def series(unit: str) -> Any:
    """Type of a list of any number of numbers in `unit`, at least one."""

    def convert(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list) or not value:
            raise ValueError(f"expected a list of numbers [{unit}]")
        return tuple(to_si(entry, unit) for entry in value)

    shown = {"type": "array", "items": {"type": ["number", "string"]}, "unit": unit, "minItems": 1}
    return Annotated[tuple[float, ...], BeforeValidator(convert), WithJsonSchema(shown)]


def turn(unit: str) -> Any:
    """Type of what a turn has: in 2D a number in `unit`, in 3D a list of three; in 1D nothing turns."""

    def convert(value: Any, info: ValidationInfo) -> tuple[float, ...]:
        entries = value if isinstance(value, list) else [value]
        dimensions = (info.context or {}).get("dimensions")
        wanted = len(entries) if dimensions is None else (0, 1, 3)[dimensions - 1]
        if len(entries) != wanted:
            raise ValueError(f"has {len(entries)} entries, needs {wanted} in {dimensions}D")
        return tuple(to_si(entry, unit) for entry in entries)

    shown = {"type": ["array", "number", "string"], "items": {"type": ["number", "string"]}, "unit": unit}
    return Annotated[tuple[float, ...], BeforeValidator(convert), WithJsonSchema(shown)]


def counts(minimum: int) -> Any:
    """Type of a list of one to three whole numbers from `minimum` on; in 1D also a single number."""
    number = Annotated[int, Field(strict=True, ge=minimum, le=LARGEST_COUNT)]
    as_list = BeforeValidator(lambda value: value if isinstance(value, list) else [value])
    shown = {"type": ["array", "integer"], "items": {"type": "integer", "minimum": minimum, "maximum": LARGEST_COUNT}}
    return Annotated[tuple[number, ...], Field(min_length=1, max_length=3), as_list, WithJsonSchema(shown)]


def direction() -> Any:
    """Type of a vector of any length but zero."""

    def points_somewhere(value: tuple[float, ...]) -> tuple[float, ...]:
        if not any(value):
            raise ValueError("is no direction, which must not be zero")
        return value

    return Annotated[vector("1"), AfterValidator(points_somewhere)]


def _phase_name(value: Any, info: ValidationInfo) -> Any:
    names = (info.context or {}).get("phases", ())
    if isinstance(value, str) and names and value not in names:
        raise PydanticCustomError("literal_error", "no such phase", {"expected": ", ".join(map(repr, names))})
    return value


Number = quantity("1")
Fraction = quantity("1", ge=0.0, le=1.0)
PositiveNumber = quantity("1", gt=0.0)
Length = quantity("m", gt=0.0)
Density = quantity("kg/m3", gt=0.0)
Pressure = quantity("Pa")
PositivePressure = quantity("Pa", gt=0.0)
Temperature = quantity("K", ge=0.0)
Mass = quantity("kg", gt=0.0)
Delay = quantity("s", ge=0.0)
Speed = quantity("m/s", gt=0.0)
Position = vector("m")
Velocity = vector("m/s")
Acceleration = vector("m/s2")
Direction = direction()
PhaseName = Annotated[str, BeforeValidator(_phase_name)]
Count = Annotated[int, Field(strict=True, ge=1, le=LARGEST_COUNT)]
