"""Functions of the kernel subset: their trees, the records and laws that they take, and what a scene binds to names."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from dataclasses import fields as dataclass_fields
from functools import cache
from typing import Any, TypeGuard, get_type_hints

from distfsi.device.trees import copied


class NotInSubset(Exception):
    """A formula or kernel uses something that cannot be emitted."""


@dataclass(frozen=True)
class Bound:
    """The formula a scene puts in the place of a name, with the constants that belong to it alone.

    owner  whose constants they are: formulas of one owner share its numbers
    law    whose formula it is, if it is one of a law: the law may have inherited it
    """

    function: Callable[..., Any]
    constants: Mapping[str, object] = field(default_factory=dict)
    owner: str = ""
    law: type | None = None

    @classmethod
    def of(cls, law: object, formula: str, owner: str = "") -> Bound:
        """A formula of a law whose fields the scene gives."""
        fields = {f"self.{name}": getattr(law, name) for name in fields_of(type(law))}
        return cls(getattr(type(law), formula), fields, owner, type(law))

    @classmethod
    def from_table(cls, law: type, formula: str) -> Bound:
        """A formula of a law that gets the fields of the law in each call, as a tuple in the place of `self`."""
        return cls(getattr(law, formula), law=law)


@dataclass(frozen=True)
class Callee:
    """A function as its callers see it.

    name           it is emitted under
    parameters     those of its source, each with its class if it is a record
    count          of its flat parameters, the numbers of the scene apart
    takes_numbers  whether these come last
    result         what it returns if that is the same in every call
    """

    name: str
    parameters: Mapping[str, type | None]
    count: int
    takes_numbers: bool
    result: ast.expr | None


@dataclass(frozen=True)
class Source:
    """A function's text: its tree, its file and line, and the names its module gives it.

    records  classes that the scene puts in the place of those of parameters, by their names; "self": the law
    """

    function: Callable[..., Any]
    records: Mapping[str, type] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        return getattr(self.function, "__kind__", "formula")

    @property
    def location(self) -> str:
        module = self.function.__module__.replace(".", "/")
        return f"{module}.py, line {self.function.__code__.co_firstlineno}"

    @property
    def name(self) -> str:
        """The name of the function, behind that of its law if it is a law's."""
        law = self.parameters.get("self")
        return f"{law.__name__}_{self.function.__name__}" if law is not None else self.function.__name__

    @property
    def parameters(self) -> dict[str, type | None]:
        """The parameters in order, each with its class if it is a record; `self` of a law's formula is the law."""
        code = self.function.__code__
        found: dict[str, type | None] = {}
        for name in code.co_varnames[: code.co_argcount]:
            class_ = self.function.__annotations__.get(name)
            if name == "self":
                class_ = self.records.get("self") or _class_of(self.function)
            elif isinstance(class_, str):
                class_ = eval(class_, self.function.__globals__)  # annotations of the project's own sources
            record = class_ if is_record(class_) else None
            found[name] = None if record is None else self.records.get(record.__name__, record)
        return found

    def tree(self) -> ast.FunctionDef:
        """A tree of its own for each call."""
        tree = _parsed(self.function)
        if not isinstance(tree, ast.FunctionDef):
            raise NotInSubset(f"{self.location}: only plain functions can be emitted")
        return copied(tree)


def _class_of(function: Callable[..., Any]) -> type:
    """The class whose body a function stands in, at the top of its module."""
    return function.__globals__[function.__qualname__.split(".")[0]]


def is_record(class_: object) -> TypeGuard[type]:
    """Whether a class is a record: a named tuple, or a law (a dataclass of numbers)."""
    return isinstance(class_, type) and (hasattr(class_, "_fields") or is_dataclass(class_))


def fields_of(record: type) -> dict[str, Any]:
    """The names and types of a record's fields."""
    types = get_type_hints(record)
    return {f.name: types[f.name] for f in dataclass_fields(record)} if is_dataclass(record) else types


def flat_names(name: str, record: type) -> list[str]:
    """The parameters that a record of this name becomes, records in it flattened, too."""
    out = []
    for field_name, kind in fields_of(record).items():
        flat = f"{name}_{field_name}"
        out += flat_names(flat, kind) if is_record(kind) else [flat]
    return out


def parameters_of(function: Callable[..., Any], first: int = 2) -> list[str]:
    """The flat parameters of a function from the `first` on: by default those of a driver behind begin and end."""
    found = Source(function).parameters.items()
    return [flat for name, record in found for flat in (flat_names(name, record) if record else [name])][first:]


FLATTENERS: dict[tuple[type, ...], Callable[..., tuple[object, ...]]] = {}  # by the types of arguments


def flat_values(arguments: Iterable[object]) -> tuple[object, ...]:
    """What a kernel is called with: its arguments, records replaced by their fields."""
    arguments = tuple(arguments)
    kinds = tuple(map(type, arguments))
    flatten = FLATTENERS.get(kinds)
    if flatten is None:
        flatten = FLATTENERS[kinds] = _flattener(arguments)
    return flatten(*arguments)


def _flattener(arguments: Sequence[object]) -> Callable[..., tuple[object, ...]]:
    """flat_values() for arguments like these, as one expression: kernels are called hundreds of times in a step."""
    names = [f"a{n}" for n in range(len(arguments))]
    flat = [text for name, value in zip(names, arguments, strict=True) for text in _flat_texts(name, value)]
    return eval(f"lambda {', '.join(names)}: ({''.join(f'{text}, ' for text in flat)})")


def _flat_texts(text: str, value: object) -> list[str]:
    """Expressions of what a value called `text` becomes. Fields of a record may be records, and those of one kind are
    always alike."""
    if not _is_named_tuple(value):
        return [text]
    if not any(map(_is_named_tuple, value)):
        return [f"*{text}"]
    return [flat for n, inner in enumerate(value) for flat in _flat_texts(f"{text}[{n}]", inner)]


def _is_named_tuple(value: object) -> TypeGuard[tuple[object, ...]]:
    return isinstance(value, tuple) and hasattr(value, "_fields")


@cache
def _parsed(function: Callable[..., Any]) -> ast.stmt:
    return ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
