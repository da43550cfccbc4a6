"""Tables of the input for laws and gauges, made from the fields of their dataclasses."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from types import NoneType
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from pydantic import BeforeValidator, Field, create_model, model_validator

from distfsi.coordinates import Coordinates
from distfsi.gauges import Gauge
from distfsi.laws.law import NEEDED, Entry, Failure, FluidEos, Law, PressureHistory, SolidEos, Source, Strength
from distfsi.laws.registry import laws_of, word_of
from distfsi.narrowing import present
from distfsi.scene.values import Mirror, quantity, series, vector

LIMITS = {"above": "gt", "at_least": "ge", "below": "lt", "at_most": "le"}  # pydantic's words


class LawTable(Mirror):
    """A table that gives the numbers of a law."""

    @model_validator(mode="after")
    def _checked(self) -> LawTable:
        self.build().check()
        return self


def table_of(law: type[Law], key: str | None = None, word: str | None = None) -> type[LawTable]:
    """The table of a law; where there are several `key` = `word` chooses this one."""
    types = get_type_hints(law)
    given = [each for each in fields(law) if each.init]
    entries: dict[str, Any] = {key: (Literal[word], ...)} if key else {}
    entries |= {each.name: _field(types[each.name], each.metadata["entry"]) for each in given}
    summary = (law.__doc__ or "").partition("\n\n")[0]
    table = create_model(law.__name__, __base__=LawTable, __doc__=summary, __module__=__name__, **entries)
    table.describes, table.word = law, key or ""
    return table


def _field(type_: Any, given: Entry) -> tuple[Any, Any]:
    """Type and description of one key."""
    whole = given.vector or given.series or get_origin(type_) is Literal
    options = {type_} if whole else set(get_args(type_)) - {NoneType} or {type_}
    kind: Any = next(iter(options))
    limits: dict[str, Any] = {LIMITS[name]: limit for name, limit in given.limits.items()}
    found: Any
    if is_dataclass(kind):
        found = table_of(cast(type[Law], kind))
    elif given.vector:
        found = vector(present(given.unit))
    elif given.series:
        found = series(present(given.unit))
    elif given.unit is not None:
        found = quantity(given.unit, **limits)
    elif whole:
        found = kind
    else:
        found = Annotated[kind, Field(strict=True, **limits)]
    default = ... if given.default is NEEDED else given.default
    return (found | None if kind is not type_ else found), Field(default, alias=given.key, description=given.meaning)


def choice(kind: type[Law], key: str = "kind") -> Any:
    """The type of a table for any law of a kind, whose word stands behind `key`."""
    tables = tuple(table_of(law, key, word_of(law)) for law in laws_of(kind))
    return Annotated[Union[tables], Field(discriminator=key)] if len(tables) > 1 else tables[0]  # noqa: UP007


def _word_as_table(value: Any) -> Any:
    return {"kind": value} if isinstance(value, str) else value


PhaseInput = choice(FluidEos, "eos")
SolidEosInput = choice(SolidEos)
FailureInput = choice(Failure)
SourceInput = choice(Source)
HistoryInput = choice(PressureHistory)
GaugeInput: Any = choice(Gauge)
SymmetryWord: Any = Literal[tuple(word_of(kind) for kind in laws_of(Coordinates))]  # a file, a word
_StrengthTable: Any = choice(Strength)
StrengthInput = Annotated[
    _StrengthTable, BeforeValidator(_word_as_table, json_schema_input_type=_StrengthTable | Literal["none"])
]
