"""The CUDA C of one folded function: statements and expressions."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Sequence
from typing import TypeGuard

import numpy as np

from distfsi.device.source import NotInSubset, Source
from distfsi.device.trees import called, name_of
from distfsi.narrowing import of_kind

BINARY = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.BitAnd: "&", ast.BitOr: "|", ast.LShift: "<<",
    ast.RShift: ">>", ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.And: "&&", ast.Or: "||", ast.USub: "-", ast.Not: "!",
}  # fmt: skip
CALLED = {ast.FloorDiv: "floor_divided", ast.Mod: "modulo"}  # Python's meaning for negative numbers
WORDS = {
    "min": "minimum",
    "max": "maximum",
    "abs": "magnitude",
    "floor": "floored",
    "int": "truncated",
    "int32": "integer",
    "len": "length",
}
WORDS |= {"exp": "exponential", "log": "logarithm", "pow": "power", "sqrt": "square_root", "real": "real"}
TAKEN = frozenset(  # words of C++ and of device/runtime.h
    """alignas and asm auto bool case catch char class const default delete do double enum explicit export extern false
    float friend goto inline int integer item length long mutable namespace new not operator or pack private protected
    public real register requires short signed sizeof static struct switch template this throw true try typedef typename
    union unsigned using virtual void volatile xor load store""".split()  # noqa: SIM905
) | {*WORDS.values()}


def number(value: float, real: str) -> str:
    """A literal of the real type."""
    if math.isnan(value) or math.isinf(value):
        raise NotInSubset(f"{value} has no literal in C")
    return f"{np.float32(value)!s}f" if real == "float32" else repr(float(value))


def safe(name: str) -> str:
    """A Python name as a C++ one."""
    return f"{name}_" if name in TAKEN or name.endswith("_kernel") else name


class Writer:
    """Writes one folded function."""

    def __init__(self, source: Source, real: str):
        self.source, self.real = source, real
        self.scopes: list[set[str]] = []
        self.temporaries = 0
        self.items: ast.For | None = None  # the loop that the threads share

    def refuse(self, why: str) -> NotInSubset:
        return NotInSubset(f"{self.source.location}, {self.source.function.__name__} in CUDA C: {why}")

    def function(self, tree: ast.FunctionDef) -> str:
        """A device function."""
        names = [safe(argument.arg) for argument in tree.args.args]
        self.scopes = [set(names)]
        head = f"DEVICE auto {tree.name}({', '.join(f'auto {name}' for name in names)})"
        return f"// {self.source.location}\n{head}\n{self.block(tree.body, 0)}"

    def driver(self, tree: ast.FunctionDef) -> str:
        """The device function whose threads share the items begin … end."""
        loop = tree.body[-1]
        wanted = [argument.arg for argument in tree.args.args[:2]]
        bounds = ast.unparse(loop.iter) if isinstance(loop, ast.For) else ""
        if not isinstance(loop, ast.For) or bounds != f"range({wanted[0]}, {wanted[1]})":
            raise self.refuse("its last statement is not the loop over its items, range(begin, end)")
        if any(isinstance(node, ast.Return) for node in ast.walk(tree)):
            raise self.refuse("a return would end other items")
        self.items = loop
        return self.function(tree)

    # ---- statements --------------------------------------------------------------------------------------------------

    def block(self, body: Sequence[ast.stmt], depth: int, names: Sequence[str] = ()) -> str:
        """Statements in braces; `names` are declared in front of them."""
        self.scopes.append(set(names))
        lines = [line for statement in body for line in self.statement(statement, depth + 1)]
        self.scopes.pop()
        indent = "    " * depth
        return "\n".join([indent + "{", *(indent + "    " + line if line else "" for line in lines), indent + "}"])

    def statement(self, node: ast.stmt, depth: int) -> list[str]:
        method = getattr(self, type(node).__name__.lower() + "_lines", None)
        if method is None:
            raise self.refuse(f"{type(node).__name__} has no meaning")
        return method(node)

    def nested(self, body: Sequence[ast.stmt], names: Sequence[str] = ()) -> list[str]:
        return self.block(body, 0, names).split("\n")

    def pass_lines(self, node: ast.Pass) -> list[str]:
        return []

    def break_lines(self, node: ast.Break) -> list[str]:
        return ["break;"]

    def continue_lines(self, node: ast.Continue) -> list[str]:
        return ["continue;"]

    def expr_lines(self, node: ast.Expr) -> list[str]:
        return [f"{self.expression(node.value)};"]

    def return_lines(self, node: ast.Return) -> list[str]:
        return ["return;" if node.value is None else f"return {self.expression(node.value)};"]

    def assign_lines(self, node: ast.Assign) -> list[str]:
        target, value = node.targets[0], node.value
        if isinstance(target, ast.Tuple):
            return self.unpacked(target, value)
        if isinstance(target, ast.Name) and self.is_workspace(value):
            return self.workspace(target.id, value)
        return self.stored(target, self.expression(value))

    def augassign_lines(self, node: ast.AugAssign) -> list[str]:
        before = ast.parse(ast.unparse(node.target), mode="eval").body
        return self.stored(node.target, self.expression(ast.BinOp(before, node.op, node.value)))

    def unpacked(self, target: ast.Tuple, value: ast.expr) -> list[str]:
        if isinstance(value, ast.Tuple) and all(self.is_workspace(item) for item in value.elts):
            pairs = zip(target.elts, value.elts, strict=True)
            return [line for part, item in pairs for line in self.workspace(name_of(part), of_kind(ast.Call, item))]
        self.temporaries += 1
        whole = f"t{self.temporaries}_"
        lines = [f"const auto {whole} = {self.expression(value)};"]
        for k, part in enumerate(target.elts):
            lines += self.stored(part, f"item<{k}>({whole})")
        return lines

    def stored(self, target: ast.expr, value: str) -> list[str]:
        """Lines that give `target` a value; the first assignment to a name declares it."""
        if isinstance(target, ast.Subscript):
            return [f"{self.expression(target.value)}.at({self.indices(target.slice)}) = {value};"]
        name = safe(name_of(target))
        if any(name in scope for scope in self.scopes):
            return [f"assign({name}, {value});"]
        self.scopes[-1].add(name)
        return [f"auto {name} = {value};"]

    @staticmethod
    def is_workspace(node: ast.expr) -> TypeGuard[ast.Call]:
        return isinstance(node, ast.Call) and called(node) == "workspace"

    def workspace(self, name: str, call: ast.Call) -> list[str]:
        if not isinstance(call.args[0], ast.Constant):
            raise self.refuse("the size of a workspace must be fixed by the scene")
        size, name = of_kind(int, call.args[0].value), safe(name)
        self.scopes[-1].add(name)
        return [f"real {name}_values[{size}];", f"const Array<real, 1> {name}{{{name}_values, {{{size}}}}};"]

    def if_lines(self, node: ast.If) -> list[str]:
        lines = [f"if ({self.expression(node.test)})", *self.nested(node.body)]
        return [*lines, "else", *self.nested(node.orelse)] if node.orelse else lines

    def while_lines(self, node: ast.While) -> list[str]:
        return [f"while ({self.expression(node.test)})", *self.nested(node.body)]

    def for_lines(self, node: ast.For) -> list[str]:
        name = safe(name_of(node.target))
        if any(name in scope for scope in self.scopes):
            raise self.refuse(f"{name} runs over a range, but has a value already")
        if not (isinstance(node.iter, ast.Call) and called(node.iter) == "range"):
            raise self.refuse("loops run over a range")
        bounds = [self.expression(bound) for bound in node.iter.args]
        first, end = bounds[:2] if len(bounds) > 1 else ("integer(0)", bounds[0])
        step, sign = "integer(1)", "<"
        if len(bounds) == 3:
            if not isinstance(node.iter.args[2], ast.Constant):
                raise self.refuse("the step of a range must be fixed by the scene")
            step, sign = bounds[2], "<" if of_kind(int, node.iter.args[2].value) > 0 else ">"
        if node is self.items:
            first, step = f"{first} + thread_number()", "thread_count()"
        head = f"for (integer {name} = {first}, {name}_end = {end}; {name} {sign} {name}_end; {name} += {step})"
        return [head, *self.nested(node.body, [name])]

    # ---- expressions -------------------------------------------------------------------------------------------------

    def expression(self, node: ast.expr) -> str:
        return getattr(self, type(node).__name__.lower())(node)

    def operand(self, node: ast.expr) -> str:
        text = self.expression(node)
        simple = isinstance(node, (ast.Name, ast.Call, ast.Subscript, ast.Attribute, ast.Tuple))
        return text if simple or re.fullmatch(r"[\w.]+|integer\(\d+\)", text) else f"({text})"

    def constant(self, node: ast.Constant) -> str:
        if isinstance(node.value, bool):
            return "true" if node.value else "false"
        if isinstance(node.value, int):
            return f"integer({node.value})"
        value = of_kind(float, node.value)
        if math.isinf(value):
            return "infinity()" if value > 0.0 else "-infinity()"
        return number(value, self.real)

    def name(self, node: ast.Name) -> str:
        name = safe(node.id)
        if not any(name in scope for scope in self.scopes):
            raise self.refuse(f"{node.id} has a value only inside a branch or loop; give it one before")
        return name

    def tuple(self, node: ast.Tuple) -> str:
        return f"pack({', '.join(map(self.expression, node.elts))})"

    def binop(self, node: ast.BinOp) -> str:
        if type(node.op) in CALLED:
            return f"{CALLED[type(node.op)]}({self.expression(node.left)}, {self.expression(node.right)})"
        return f"{self.operand(node.left)} {BINARY[type(node.op)]} {self.operand(node.right)}"

    def boolop(self, node: ast.BoolOp) -> str:
        return f" {BINARY[type(node.op)]} ".join(map(self.operand, node.values))

    def compare(self, node: ast.Compare) -> str:
        return f"{self.operand(node.left)} {BINARY[type(node.ops[0])]} {self.operand(node.comparators[0])}"

    def unaryop(self, node: ast.UnaryOp) -> str:
        return f"{BINARY[type(node.op)]}{self.operand(node.operand)}"

    def ifexp(self, node: ast.IfExp) -> str:
        return f"{self.operand(node.test)} ? {self.operand(node.body)} : {self.operand(node.orelse)}"

    def call(self, node: ast.Call) -> str:
        return f"{WORDS.get(called(node), called(node))}({', '.join(map(self.expression, node.args))})"

    def attribute(self, node: ast.Attribute) -> str:
        return f"{self.expression(node.value)}.{node.attr}" + ("()" if node.attr == "size" else "")

    def subscript(self, node: ast.Subscript) -> str:
        value = self.expression(node.value)
        if isinstance(node.value, ast.Attribute):
            return f"{value}[{of_kind(ast.Constant, node.slice).value!r}]"
        if isinstance(node.slice, ast.Constant):
            return f"item<{node.slice.value!r}>({value})"
        return f"{value}({self.indices(node.slice)})"

    def indices(self, node: ast.expr) -> str:
        indices = node.elts if isinstance(node, ast.Tuple) else [node]
        if any(isinstance(index, ast.Constant) and of_kind(int, index.value) < 0 for index in indices):
            raise self.refuse("an index below zero")
        return ", ".join(str(i.value) if isinstance(i, ast.Constant) else self.expression(i) for i in indices)
