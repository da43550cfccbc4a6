"""All that the text of a driver can depend on, as one hash: a text made before is found again without folding."""

from __future__ import annotations

import hashlib
import marshal
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import CodeType
from typing import Any

from distfsi.device.source import Bound, Source, fields_of, is_record
from distfsi.formulas.subset import Varying

WITHOUT_REFERENCES = 2  # marshal's format whose bytes depend on the code alone


def fingerprint(
    driver: Callable[..., Any], constants: Mapping[str, object], bindings: Mapping[str, Bound | type], real: str
) -> str:
    """A hash of the functions that a driver can reach, as Python has compiled them, and of what a scene gives to the
    names in them: constants, formulas and records, but of floats only whether they are 0."""
    seen: set[tuple[object, ...]] = set()
    digest = hashlib.sha256(texts_depend_on() + real.encode())
    chosen = {name: record for name, record in bindings.items() if isinstance(record, type)}

    def add(function: Callable[..., Any], scope: Mapping[str, object], owner: str, law: type | None) -> None:
        if (function, owner, law) in seen:
            return
        seen.add((function, owner, law))
        code, names = _compiled(function)
        digest.update(code)
        source = Source(function, chosen | ({"self": law} if law else {}))
        records = [record for record in source.parameters.values() if record is not None]
        digest.update(repr([(record, fields_of(record)) for record in records]).encode())
        for name in names:
            for known in (name, f"self.{name}"):
                if known in scope:
                    digest.update(f"{known} of {owner} = {_shape(scope[known])}".encode())
                elif known in constants:
                    digest.update(f"{known} = {_shape(constants[known])}".encode())
            bound = bindings.get(name)
            if isinstance(bound, Bound):
                digest.update(f"{name} is {bound.owner}".encode())
                add(bound.function, bound.constants, bound.owner or name, bound.law)
                continue
            value = function.__globals__.get(name)
            for callee, its_law in [(value, None), *((getattr(record, name, None), record) for record in records)]:
                if callee is not None and hasattr(callee, "__code__"):
                    add(callee, scope, owner, its_law)
            if is_record(value):
                digest.update(repr(fields_of(value)).encode())
            if isinstance(value, (bool, int, float, tuple)):
                digest.update(f"{name} = {value!r}".encode())

    add(driver, {}, "", None)
    return digest.hexdigest()[:20]


def _shape(value: object) -> str:
    """What a text depends on of a constant that a scene gives."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_shape, value))})"
    if isinstance(value, Varying):
        return "a changing number"
    return "a number" if isinstance(value, float) and value != 0.0 else repr(value)


@cache
def texts_depend_on() -> bytes:
    """What makes texts and machine code of functions: Python, numba and this folder."""
    versions = f"{sys.version} {version('numba')} {version('llvmlite')} "
    return versions.encode() + b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))


@cache
def _compiled(function: Callable[..., Any]) -> tuple[bytes, list[str]]:
    """What Python has made of a function, and the names of other modules in it."""
    code, kind = function.__code__, getattr(function, "__kind__", "")
    digest = f"{function.__module__} {kind}".encode() + marshal.dumps(code, WITHOUT_REFERENCES)
    return digest, sorted(set(_names(code)))


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)
