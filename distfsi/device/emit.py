"""Emission: a driver and all the formulas it reaches, folded for a scene.

Two writers make texts of them: `device/llvm_text.py` for the CPU and `device/cuda_text.py` for GPUs. What is compiled
from a text is kept under its hash, so that it can never be stale.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from distfsi.device import markers
from distfsi.device.fold import Bound, Fold, NotInSubset, Source, constant_of


@dataclass
class Emission:
    """The functions that `driver` reaches, folded, callees first."""

    constants: Mapping[str, object]
    bindings: Mapping[str, Bound]
    functions: dict[str, tuple[Source, ast.FunctionDef]] = field(default_factory=dict)
    _names: dict[tuple[Callable, str], str] = field(default_factory=dict)

    def add(self, function: Callable, scope: Mapping[str, object], suffix: str = "") -> str:
        """Fold `function` and all it calls; return the name it is emitted under."""
        key = (function, suffix)
        if key in self._names:
            return self._names[key]
        name = function.__name__ + suffix
        if name in self.functions or name in self._names.values():
            other = next(f for (f, _), emitted in self._names.items() if emitted == name)
            raise NotInSubset(f"{Source(function).place}: {name} is also the name of {Source(other).place}")
        self._names[key] = name
        source = Source(function)
        tree = Fold(
            source, lambda n: self._constant(function, scope, n), lambda n: self._callee(function, scope, suffix, n)
        ).run()
        tree.name = name
        self.functions[name] = (source, tree)
        return name

    def _constant(self, function: Callable, scope: Mapping[str, object], name: str) -> object:
        if name in scope:
            return scope[name]
        if name in self.constants:
            return self.constants[name]
        value = function.__globals__[name]
        if isinstance(value, (bool, int, float)) or (
            isinstance(value, tuple) and all(isinstance(v, (int, float)) for v in value)
        ):
            return value
        raise KeyError(name)

    def _callee(
        self, caller: Callable, scope: Mapping[str, object], suffix: str, name: str
    ) -> tuple[str, ast.expr | None]:
        if name in self.bindings:
            bound = self.bindings[name]
            emitted = self.add(bound.function, bound.constants, "__" + name)
        else:
            function = caller.__globals__[name]
            if not callable(function) or not hasattr(function, "__code__"):
                raise KeyError(name)
            emitted = self.add(function, scope, suffix if scope else "")
        return emitted, self._constant_result(emitted)

    def _constant_result(self, name: str) -> ast.expr | None:
        """The value of a function that merely returns a constant."""
        body = self.functions[name][1].body
        if len(body) == 1 and isinstance(body[0], ast.Return) and constant_of(body[0].value)[0]:
            return body[0].value
        return None


def callees_first(
    functions: Mapping[str, tuple[Source, ast.FunctionDef]], roots: Iterable[str] | None = None
) -> list[tuple[Source, ast.FunctionDef]]:
    """Only what the `roots`, by default the last of the functions, still call after folding: callees first."""
    ordered: dict[str, tuple[Source, ast.FunctionDef]] = {}

    def place(name: str) -> None:
        if name in ordered or name not in functions:
            return
        for node in ast.walk(functions[name][1]):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                place(node.func.id)
        ordered[name] = functions[name]

    for root in [next(reversed(functions))] if roots is None else roots:
        place(root)
    return list(ordered.values())


def plain(function: Callable, constants: Mapping[str, object], bindings: Mapping[str, Bound] | None = None) -> Callable:
    """`function` as plain Python with the scene's values in place: for set-up, tests and debugging.

    Works on numpy arrays too, as long as the formula makes no choices.
    """
    emission = Emission(constants, bindings or {})
    name = emission.add(function, {})
    words = {"sqrt": np.sqrt, "exp": np.exp, "log": np.log, "pow": np.power, "floor": np.floor, "workspace": np.empty}
    namespace = {**words, "load": markers.load, "store": markers.store, "real": float}
    namespace |= {"min": lambda a, b: a if a < b else b, "max": lambda a, b: a if a > b else b}
    for _, tree in callees_first(emission.functions):
        exec(compile(ast.unparse(tree), f"<{name}>", "exec"), namespace)
    return namespace[name]
