"""Emission: a driver and all the formulas it reaches, folded for a scene.

Two writers make texts of them: `device/llvm_text.py` for the CPU and `device/cuda_text.py` for GPUs. What is compiled
from a text is kept under its hash, so that it can never be stale.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from distfsi.device import markers
from distfsi.device.expressions import NUMBERS
from distfsi.device.fold import Fold
from distfsi.device.source import Bound, Callee, NotInSubset, Source
from distfsi.device.trees import Changing, Number, copied, given, is_fixed, literal
from distfsi.formulas.subset import Varying
from distfsi.narrowing import of_kind


class _Numbered(ast.NodeTransformer):
    """Each Number, changing or not, becomes an item of the tuple of numbers."""

    def __init__(self, numbers: dict[str, float | Varying]):
        self.numbers, self.positions, self.found = numbers, list(numbers), False

    def visit_Number(self, node: Number | Changing) -> ast.expr:
        self.found = True
        if node.id not in self.numbers:
            assert node.value is not None
            self.numbers[node.id] = node.value
            self.positions.append(node.id)
        return ast.Subscript(ast.Name(NUMBERS, ast.Load()), ast.Constant(self.positions.index(node.id)), ast.Load())

    visit_Changing = visit_Number


class Numbers:
    """What a scene measures, as a kernel gets it behind its other arguments: called, it gives the values of now."""

    def __init__(self, numbers: Iterable[float | Varying], real: Callable[[float], float]):
        self._numbers, self._real = tuple(numbers), real
        self._varies = any(isinstance(number, Varying) for number in self._numbers)
        self._values = self._now()

    def __call__(self) -> tuple[float, ...]:
        return self._now() if self._varies else self._values

    def _now(self) -> tuple[float, ...]:
        values = (number.value if isinstance(number, Varying) else number for number in self._numbers)
        return tuple(map(self._real, values))


def given_numbers(constants: Mapping[str, object], bindings: Mapping[str, Bound | type]) -> dict[str, float | Varying]:
    """All floats that a scene gives, by their labels: what the names of Numbers are expressions of."""
    found: dict[str, float | Varying] = {}

    def put(value: object, label: str) -> None:
        if isinstance(value, tuple):
            for k, item in enumerate(value):
                put(item, f"{label}[{k}]")
        elif isinstance(value, (float, Varying)):
            found[label] = value

    for name, value in constants.items():
        put(value, name)
    for word, bound in bindings.items():
        if isinstance(bound, Bound):
            for name, value in bound.constants.items():
                put(value, f"{bound.owner or word}.{name}")
    return found


@dataclass
class Emission:
    """The functions that `driver` reaches, folded, callees first.

    numbers  what the scene measures, by name, in the order in which the driver gets it behind its other arguments
    """

    constants: Mapping[str, object]
    bindings: Mapping[str, Bound | type]
    functions: dict[str, tuple[Source, ast.FunctionDef]] = field(default_factory=dict)
    numbers: dict[str, float | Varying] = field(default_factory=dict)
    _callees: dict[tuple[Callable[..., Any], type | None, str], Callee] = field(default_factory=dict)

    def add(
        self, function: Callable[..., Any], scope: Bound | None = None, suffix: str = "", law: type | None = None
    ) -> Callee:
        """Fold `function`, perhaps a formula of a `law`, and all it calls, with the constants of `scope`."""
        key = (function, law, suffix)
        if key in self._callees:
            return self._callees[key]
        source = Source(function, self._records() | ({"self": law} if law else {}))
        name = source.name + suffix
        if name in self.functions:
            raise NotInSubset(f"{source.location}: {name} is also the name of {self.functions[name][0].location}")
        self.functions[name] = source, source.tree()  # its name is taken
        given = source, scope, suffix
        fold = Fold(source, partial(self._constant, *given), partial(self._callee, *given))
        tree = fold.run()
        tree.name, count = name, len(tree.args.args)
        result = _fixed_result(tree)
        numbered = _Numbered(self.numbers)
        numbered.visit(tree)
        takes_numbers = numbered.found or any(isinstance(n, ast.Name) and n.id == NUMBERS for n in ast.walk(tree))
        if takes_numbers:
            tree.args.args.append(ast.arg(NUMBERS))
        del self.functions[name]
        self.functions[name] = source, ast.fix_missing_locations(tree)
        self._callees[key] = Callee(name, fold.parameters, count, takes_numbers, result)
        return self._callees[key]

    def add_bound(self, name: str) -> Callee:
        """Fold the formula that the scene binds to a name."""
        bound = of_kind(Bound, self.bindings[name])
        return self.add(bound.function, bound, "__" + name, bound.law)

    def _records(self) -> dict[str, type]:
        """The records that the scene chooses."""
        return {name: class_ for name, class_ in self.bindings.items() if isinstance(class_, type)}

    def root(self, function: Callable[..., Any]) -> str:
        """Fold a driver, which gets the numbers one by one behind its other arguments; the name it is emitted under."""
        callee = self.add(function)
        _, tree = self.functions[callee.name]
        if callee.takes_numbers:
            names = number_names(len(self.numbers))
            tree.args.args[-1:] = [ast.arg(name) for name in names]
            whole = ast.Tuple([ast.Name(name, ast.Load()) for name in names], ast.Load())
            tree.body.insert(0, ast.Assign([ast.Name(NUMBERS, ast.Store())], whole))
            ast.fix_missing_locations(tree)
        else:
            self.numbers.clear()  # only formulas that nobody calls asked for some
        return callee.name

    def _constant(self, source: Source, scope: Bound | None, suffix: str, name: str) -> ast.expr:
        if scope is not None and name in scope.constants:
            return given(scope.constants[name], f"{scope.owner or suffix.removeprefix('__')}.{name}")
        if name in self.constants:
            return given(self.constants[name], name)
        value = source.function.__globals__[name]
        if isinstance(value, (bool, int, float)) or (
            isinstance(value, tuple) and all(isinstance(v, (int, float)) for v in value)
        ):
            return literal(value)
        raise KeyError(name)

    def _callee(self, caller: Source, scope: Bound | None, suffix: str, name: str) -> Callee:
        if name in self.bindings:
            return self.add_bound(name)
        record, _, formula = name.rpartition(".")
        law = caller.parameters[record] if record else None
        function = getattr(law, formula) if law else caller.function.__globals__[name]
        if not callable(function) or not hasattr(function, "__code__"):
            raise KeyError(name)
        return self.add(function, scope, suffix if scope and scope.constants else "", law)


def number_names(count: int) -> list[str]:
    """The parameters of a driver in which it gets the numbers of the scene."""
    return [f"number_{k}" for k in range(count)]


def _fixed_result(tree: ast.FunctionDef) -> ast.expr | None:
    """What a function merely returns, if that is the same in every call."""
    only = tree.body[0] if len(tree.body) == 1 else None
    value = only.value if isinstance(only, ast.Return) else None
    return copied(value) if value is not None and is_fixed(value) else None


def callees_first(
    functions: Mapping[str, tuple[Source, ast.FunctionDef]], roots: Iterable[str] | None = None
) -> list[tuple[Source, ast.FunctionDef]]:
    """Only what the `roots`, by default the last of the functions, still call after folding: callees first."""
    ordered: dict[str, tuple[Source, ast.FunctionDef]] = {}

    def arrange(name: str) -> None:
        if name in ordered or name not in functions:
            return
        for node in ast.walk(functions[name][1]):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                arrange(node.func.id)
        ordered[name] = functions[name]

    for root in list(functions)[-1:] if roots is None else roots:
        arrange(root)
    return list(ordered.values())


def plain(
    function: Callable[..., Any], constants: Mapping[str, object], bindings: Mapping[str, Bound | type] | None = None
) -> Callable[..., Any]:
    """`function` as plain Python with the scene's values in place: for set-up, tests and debugging.

    Works on numpy arrays too, as long as the formula makes no choices.
    """
    emission = Emission(constants, bindings or {})
    name = emission.root(function)
    words = {"sqrt": np.sqrt, "exp": np.exp, "log": np.log, "pow": np.power, "floor": np.floor, "workspace": np.empty}
    namespace: dict[str, Any] = {**words, "load": markers.load, "store": markers.store, "real": float, "int32": int}
    namespace |= {"min": lambda a, b: a if a < b else b, "max": lambda a, b: a if a > b else b}
    for _, tree in callees_first(emission.functions):
        exec(compile(ast.unparse(tree), f"<{name}>", "exec"), namespace)
    formula, numbers = namespace[name], Numbers(emission.numbers.values(), float)
    return (lambda *arguments: formula(*arguments, *numbers())) if emission.numbers else formula
