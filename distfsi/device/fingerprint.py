"""All that the text of a driver can depend on, as one hash: a text made before is found again without folding."""

from __future__ import annotations

import hashlib
import marshal
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import CodeType

from distfsi.device.fold import Bound

WITHOUT_REFERENCES = 2  # marshal's format whose bytes depend on the code alone


def fingerprint(
    driver: Callable, constants: Mapping[str, object], bindings: Mapping[str, Bound], *others: object
) -> str:
    """A hash of the functions that a driver can reach, as Python has compiled them, of the constants and formulas that
    a scene gives to the names in them, and of `others`."""
    seen: set[tuple] = set()
    told = hashlib.sha256(_writers() + repr(others).encode())

    def tell(function: Callable, scope: Mapping[str, object], scope_name: str) -> None:
        key = function, scope_name
        if key in seen:
            return
        seen.add(key)
        code, names = _compiled(function)
        told.update(code)
        for name in names:
            if name in scope or name in constants:
                told.update(f"{name} = {scope.get(name, constants.get(name))!r}".encode())
            if name in bindings:
                told.update(f"{name} is".encode())
                tell(bindings[name].function, bindings[name].constants, name)
                continue
            value = function.__globals__.get(name)
            if hasattr(value, "__code__"):
                tell(value, scope, scope_name)
            elif isinstance(value, (bool, int, float, tuple)):
                told.update(f"{name} = {value!r}".encode())

    tell(driver, {}, "")
    return told.hexdigest()[:20]


@cache
def _writers() -> bytes:
    """What makes texts of functions: Python, and this folder."""
    return sys.version.encode() + b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))


@cache
def _compiled(function: Callable) -> tuple[bytes, list[str]]:
    """What Python has made of a function, and the names of other modules in it."""
    code, kind = function.__code__, getattr(function, "__kind__", "")
    told = f"{function.__module__} {kind}".encode() + marshal.dumps(code, WITHOUT_REFERENCES)
    return told, sorted(set(_names(code)))


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)
