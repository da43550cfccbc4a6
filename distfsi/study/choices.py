"""The methods a scene can choose from, read from the schema of the input: a new choice shows up in the studies by
itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from distfsi.scene.schema import FluidInput, TimeInput

Method = Mapping[str, str]  # values by key of the input, "fluid.riemann": "hll"

_TABLES: dict[str, type[BaseModel]] = {"fluid": FluidInput, "time": TimeInput}


@cache
def choices() -> dict[str, tuple[str, ...]]:
    """Every key of the fluid's method with the words it takes, the default first."""
    found = {}
    for section, table in _TABLES.items():
        for name, field in table.model_fields.items():
            words = [_word(value) for value in _values(field.annotation)]
            if words:
                default = _word(field.default)
                found[f"{section}.{name}"] = (default, *(word for word in words if word != default))
    return found


def _values(annotation: Any) -> tuple[Any, ...]:
    """The values of an annotation that has finitely many; none of any other."""
    if annotation is bool:
        return (False, True)
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    if get_origin(annotation) in (Union, UnionType):
        parts = [_values(part) for part in get_args(annotation) if part is not type(None)]
        return tuple(value for part in parts for value in part) if all(parts) else ()
    return ()


def _word(value: object) -> str:
    """A value as TOML on the command line."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def default() -> dict[str, str]:
    """The method of an input that chooses nothing."""
    return {key: words[0] for key, words in choices().items()}


def varied_alone() -> Iterator[Method]:
    """Every choice but the default's, one at a time."""
    for key, words in choices().items():
        for word in words[1:]:
            yield {key: word}


def exists(method: Method) -> bool:
    """Whether the input knows all of a method's words."""
    return all(word in choices().get(key, ()) for key, word in method.items())


def name_of(method: Method) -> str:
    """A method by its words; a truth by its key."""
    words = [key.rpartition(".")[2] if word == "true" else word for key, word in method.items() if word != "false"]
    return " ".join([*words, *(f"no {key.rpartition('.')[2]}" for key, word in method.items() if word == "false")])


def settings(method: Method) -> list[str]:
    """Overrides of an input that make it use a method, and the default for what the method does not say."""
    return [f"{key}={word}" for key, word in (default() | dict(method)).items()]
