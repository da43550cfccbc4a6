"""The LLVM IR of the expressions of one function."""

from __future__ import annotations

import ast
from typing import Protocol

import numpy as np

from distfsi.device.llvm_types import (
    BOOL,
    INTEGER,
    Array,
    Function,
    Slot,
    Type,
    Value,
    joined,
    leaf_types,
    number,
    parts_of,
)
from distfsi.device.llvm_values import Values, exponential
from distfsi.device.source import Source
from distfsi.device.trees import called
from distfsi.narrowing import of_kind

ARITHMETIC = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
BITWISE = {ast.BitAnd: "and", ast.BitOr: "or", ast.LShift: "shl", ast.RShift: "ashr"}
COMPARISONS = {ast.Eq: "eq", ast.NotEq: "ne", ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge"}


class Functions(Protocol):
    """The functions of the module that is being written: by name and types of the arguments."""

    real: str
    written: dict[tuple[object, ...], Function]

    def function(self, name: str, types: tuple[Type, ...]) -> Function:
        """The function for such arguments, written at its first call."""


class Expressions(Values):
    """Writes the expressions of one function.

    slots   what stands at its start
    scopes  what names stand for, innermost last
    owned   memory to free
    """

    def __init__(self, functions: Functions, source: Source):
        super().__init__(source, functions.real)
        self.functions = functions
        self.slots: list[str] = []
        self.scopes: list[dict[str, Value | Slot]] = []
        self.owned: list[str] = []

    def found(self, name: str) -> Value | Slot | None:
        return next((scope[name] for scope in reversed(self.scopes) if name in scope), None)

    def truth(self, node: ast.expr) -> str:
        return self.scalar(self.value(node), BOOL)

    def integer(self, node: ast.expr) -> str:
        return self.scalar(self.value(node), INTEGER)

    def value(self, node: ast.expr) -> Value:
        method = getattr(self, f"value_of_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refuse(f"{type(node).__name__} has no meaning")
        return method(node)

    def value_of_constant(self, node: ast.Constant) -> Value:
        if isinstance(node.value, bool):
            return Value(BOOL, ("true" if node.value else "false",))
        if isinstance(node.value, int):
            return Value(INTEGER, (str(node.value),))
        return Value(self.real, (number(of_kind(float, node.value), self.real),))

    def value_of_name(self, node: ast.Name) -> Value:
        variable = self.found(node.id)
        if variable is None:
            raise self.refuse(f"{node.id} has a value only inside a branch or loop; give it one before")
        if isinstance(variable, Value):
            return variable
        pairs = zip(leaf_types(variable.type), variable.addresses, strict=True)
        return Value(variable.type, tuple(self.new(f"load {kind}, ptr {address}") for kind, address in pairs))

    def value_of_tuple(self, node: ast.Tuple) -> Value:
        return joined([self.value(item) for item in node.elts])

    def value_of_binop(self, node: ast.BinOp) -> Value:
        a, b, operator = self.value(node.left), self.value(node.right), type(node.op)
        if operator in BITWISE and a.type == b.type == BOOL:
            return Value(BOOL, (self.new(f"{BITWISE[operator]} i1 {a.leaves[0]}, {b.leaves[0]}"),))
        kind = INTEGER if a.type == b.type == BOOL else of_kind(str, self.common(a.type, b.type))
        if operator is ast.Div and kind == INTEGER:
            kind = "double"
        x, y = self.scalar(a, kind), self.scalar(b, kind)
        if kind != INTEGER:
            word = "fdiv" if operator is ast.Div else f"f{ARITHMETIC[operator]}"
            return Value(kind, (self.new(f"{word} {kind} {x}, {y}"),))
        if operator in (ast.FloorDiv, ast.Mod):
            return Value(kind, (self.floored(operator, x, y),))
        return Value(kind, (self.new(f"{(ARITHMETIC | BITWISE)[operator]} i64 {x}, {y}"),))

    def floored(self, operator: type, x: str, y: str) -> str:
        """Python's quotient or rest of two integers."""
        rest = self.new(f"srem i64 {x}, {y}")
        other_sign = self.new(f"icmp slt i64 {self.new(f'xor i64 {rest}, {y}')}, 0")
        off = self.new(f"and i1 {self.new(f'icmp ne i64 {rest}, 0')}, {other_sign}")
        if operator is ast.Mod:
            return self.new(f"add i64 {rest}, {self.new(f'select i1 {off}, i64 {y}, i64 0')}")
        return self.new(f"add i64 {self.new(f'sdiv i64 {x}, {y}')}, {self.new(f'sext i1 {off} to i64')}")

    def value_of_compare(self, node: ast.Compare) -> Value:
        a, b = self.value(node.left), self.value(node.comparators[0])
        return Value(BOOL, (self.compared(COMPARISONS[type(node.ops[0])], a, b),))

    def value_of_unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(BOOL, (self.new(f"xor i1 {self.truth(node.operand)}, true"),))
        value = self.value(node.operand)
        kind = INTEGER if value.type == BOOL else of_kind(str, value.type)
        x = self.scalar(value, kind)
        return Value(kind, (self.new(f"sub i64 0, {x}" if kind == INTEGER else f"fneg {kind} {x}"),))

    def value_of_boolop(self, node: ast.BoolOp) -> Value:
        *others, last = node.values
        stop = isinstance(node.op, ast.Or)
        if not others:
            return Value(BOOL, (self.truth(last),))
        first = self.value_of_boolop(ast.BoolOp(node.op, others)).leaves[0]
        known = Value(BOOL, ("true" if stop else "false",))
        then, orelse = (lambda: known), (lambda: Value(BOOL, (self.truth(last),)))
        return self.chosen(first, *((then, orelse) if stop else (orelse, then)))

    def value_of_ifexp(self, node: ast.IfExp) -> Value:
        return self.chosen(self.truth(node.test), lambda: self.value(node.body), lambda: self.value(node.orelse))

    def value_of_attribute(self, node: ast.Attribute) -> Value:
        lengths = self.value(node.value).leaves[1:]
        if node.attr == "shape":
            return Value((INTEGER,) * len(lengths), lengths)
        size, *others = lengths
        for length in others:
            size = self.new(f"mul i64 {size}, {length}")
        return Value(INTEGER, (size,))

    def value_of_subscript(self, node: ast.Subscript) -> Value:
        whole = self.value(node.value)
        if isinstance(whole.type, Array):
            return self.get(whole, self.indices(node.slice))
        if isinstance(node.slice, ast.Constant):
            return self.item(whole, of_kind(int, node.slice.value))
        *others, chosen = parts_of(whole)
        index = self.integer(node.slice)
        for k, part in reversed(list(enumerate(others))):
            chosen = self.selected(self.new(f"icmp eq i64 {index}, {k}"), part, self.converted(chosen, part.type))
        return chosen

    def indices(self, node: ast.expr) -> list[str]:
        return [self.integer(index) for index in (node.elts if isinstance(node, ast.Tuple) else [node])]

    def value_of_call(self, node: ast.Call) -> Value:
        values = [self.value(argument) for argument in node.args]
        word = getattr(self, f"word_{called(node)}", None)
        if word is not None:
            return word(*values)
        function = self.functions.function(called(node), tuple(value.type for value in values))
        return self.called(function, values)

    def word_workspace(self, n: Value) -> Value:
        element, length = "float64" if self.real == "double" else "float32", self.scalar(n, INTEGER)
        if length.isdigit():
            memory = f"%{self.name('w')}"
            self.slots.append(f"  {memory} = alloca [{length} x {self.real}], align 64")
        else:
            if len(self.scopes) > 1:
                raise self.refuse("a workspace of any size stands outside of branches and loops")
            size = self.new(f"mul i64 {length}, {np.dtype(element).itemsize}")
            memory = self.new(f"call ptr @malloc(i64 {size})")
            self.owned.append(memory)
        return Value(Array(element, 1), (memory, length))

    def word_exp(self, x: Value) -> Value:
        """The exponential in arithmetic that vectorises (device/exponential.py)."""
        key = ("exp", self.real)
        if key not in self.functions.written:
            self.functions.written[key] = exponential(self.real)
        return self.called(self.functions.written[key], [self.converted(x, self.real)])
