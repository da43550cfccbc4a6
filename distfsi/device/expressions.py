"""Folding of expressions: constants and numbers of the scene, records, calls, unrolled ranges."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any, TypeGuard

from distfsi.device.source import Callee, NotInSubset, Source, fields_of, flat_names, is_record
from distfsi.device.trees import Number, constant_of, copied, name_of, named, truth_of
from distfsi.narrowing import present

NUMBERS = "numbers_"  # the tuple in which functions hand on what a scene measures
MATH_WORDS = ("sqrt", "exp", "log", "pow", "abs", "min", "max")
KERNEL_WORDS = ("floor", "load", "store", "workspace", "range", "int", "int32", "len", "real")

_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.USub: operator.neg, ast.Not: operator.not_,
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge, ast.BitAnd: operator.and_, ast.BitOr: operator.or_, ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
}  # fmt: skip


class Expressions(ast.NodeTransformer):
    """Folds the expressions of one function.

    `lookup(name)` gives the tree of a scene constant; `call(name)` the callee. Both raise KeyError for what they do not
    know.

    known       names that have a fixed value by now
    propagated  those that may get one: they are assigned to once, and always
    locals      parameters and names that are assigned to
    records     parameters that are records, with their classes
    parameters  of the source, but for records of which the scene gives all fields
    """

    def __init__(self, source: Source, lookup: Callable[[str], ast.expr], call: Callable[[str], Callee]):
        self.source, self.lookup, self.call = source, lookup, call
        self.known: dict[str, ast.expr] = {}
        self.locals: set[str] = set()
        self.propagated: set[str] = set()
        self.records = {name: class_ for name, class_ in source.parameters.items() if class_ is not None}
        self.parameters = {n: class_ for n, class_ in source.parameters.items() if not self.is_fixed(n, class_)}
        self.in_kernel = source.kind != "formula"

    def refuse(self, node: ast.AST, why: str) -> NotInSubset:
        line = self.source.function.__code__.co_firstlineno + getattr(node, "lineno", 1) - 1
        return NotInSubset(f"{self.source.function.__module__} line {line}, in {self.source.function.__name__}: {why}")

    # ---- expressions -------------------------------------------------------------------------------------------------

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if not isinstance(node.ctx, ast.Load):
            return node
        if node.id in self.known:
            return copied(self.known[node.id])
        if node.id in self.locals:
            return node
        try:
            return self.lookup(node.id)
        except KeyError:
            raise self.refuse(node, f"{node.id} is neither a local name nor fixed by the scene") from None

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        node.left, node.right = self.visit(node.left), self.visit(node.right)
        return self.combined(node)

    def combined(self, node: ast.BinOp) -> ast.expr:
        """An operation whose operands are folded already."""
        if type(node.op) not in _OPERATORS:
            raise self.refuse(node, f"operator {type(node.op).__name__} is not in the subset")
        left, right = node.left, node.right
        if isinstance(left, ast.Constant) and isinstance(right, ast.Constant):
            return ast.copy_location(ast.Constant(_OPERATORS[type(node.op)](left.value, right.value)), node)
        simpler = self.identity(node)
        if simpler is not None:
            return simpler
        if isinstance(left, (ast.Constant, Number)) and isinstance(right, (ast.Constant, Number)):
            return Number(f"({ast.unparse(named(node))})", _OPERATORS[type(node.op)](left.value, right.value))
        return node

    @staticmethod
    def identity(node: ast.BinOp) -> ast.expr | None:
        """x + 0, 0 + x, x - 0, 0 - x, x * 0, x * 1, 0 / x, x / 1 without their second operand; 1 for N / N."""

        def is_(side: ast.expr, value: float) -> bool:
            return isinstance(side, ast.Constant) and not isinstance(side.value, bool) and side.value == value

        left, right, op = node.left, node.right, type(node.op)
        if op is ast.Add and (is_(left, 0) or is_(right, 0)):
            return right if is_(left, 0) else left
        if op is ast.Sub and is_(right, 0):
            return left
        if op is ast.Sub and is_(left, 0):
            return ast.copy_location(ast.UnaryOp(ast.USub(), right), node)
        if op is ast.Mult and (is_(left, 0) or is_(right, 0)):
            return left if is_(left, 0) else right
        if op is ast.Mult and (is_(left, 1) or is_(right, 1)):
            return right if is_(left, 1) else left
        if op is ast.Div and (is_(left, 0) or is_(right, 1)):
            return left
        if op is ast.Div and isinstance(left, Number) and isinstance(right, Number) and left.id == right.id:
            return ast.copy_location(ast.Constant(1.0), node)
        return None

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        node.operand = self.visit(node.operand)
        if type(node.op) not in _OPERATORS:
            raise self.refuse(node, f"operator {type(node.op).__name__} is not in the subset")
        if isinstance(node.operand, ast.Constant):
            return ast.copy_location(ast.Constant(_OPERATORS[type(node.op)](node.operand.value)), node)
        if isinstance(node.operand, Number) and isinstance(node.op, ast.USub):
            return Number(f"-{node.operand.id}", -node.operand.value)
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        if len(node.ops) != 1:
            raise self.refuse(node, "one comparison at a time")
        if type(node.ops[0]) not in _OPERATORS:
            raise self.refuse(node, f"operator {type(node.ops[0]).__name__} is not in the subset")
        node.left, node.comparators = self.visit(node.left), [self.visit(node.comparators[0])]
        (known_l, left), (known_r, right) = constant_of(node.left), constant_of(node.comparators[0])
        if known_l and known_r:
            return ast.copy_location(ast.Constant(_OPERATORS[type(node.ops[0])](left, right)), node)
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        stop = isinstance(node.op, ast.Or)  # the value that decides
        values: list[ast.expr] = []
        for value in (self.visit(v) for v in node.values):
            known, truth = truth_of(value)
            if known and bool(truth) == stop:
                values.append(ast.Constant(stop))
                break
            if not known:
                values.append(value)
        if not values:
            return ast.Constant(not stop)
        node.values = values
        return values[0] if len(values) == 1 else node

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        test = self.visit(node.test)
        known, value = truth_of(test)
        if known:
            return self.visit(node.body if value else node.orelse)
        node.test, node.body, node.orelse = test, self.visit(node.body), self.visit(node.orelse)
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        record, node.slice = self.record_of(node.value), self.visit(node.slice)
        known, index = constant_of(node.slice)
        if record is not None:
            if not known:
                raise self.refuse(node, "the number of a record's field must be fixed by the scene")
            attribute = ast.Attribute(node.value, list(fields_of(record[1]))[index], ast.Load())
            return self.field_of(ast.copy_location(attribute, node), *record)
        node.value = self.visit(node.value)
        if known and isinstance(node.value, ast.Tuple):
            return node.value.elts[index]
        if not known and not self.in_kernel:
            raise self.refuse(node, "a formula's index must be fixed by the scene")
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        record = self.record_of(node.value)
        if record is not None:
            return self.field_of(node, *record)
        if not self.in_kernel or node.attr not in ("shape", "size"):
            raise self.refuse(node, "no attributes but fields of records and, in kernels, the shape and size of arrays")
        node.value = self.visit(node.value)
        return node

    # ---- records -----------------------------------------------------------------------------------------------------

    def flat_parameters(self, name: str, record: type | None) -> list[str]:
        """The parameters that one of the source becomes: one per field of a record, but for those that are fixed."""
        if record is None:
            return [name]
        return [flat for flat in flat_names(name, record) if not self.is_given(name, flat)]

    def is_fixed(self, name: str, record: type | None) -> bool:
        """Whether the scene gives all fields of a record, so that it is no parameter."""
        return record is not None and len(fields_of(record)) > 0 and not self.flat_parameters(name, record)

    def is_given(self, name: str, flat: str) -> bool:
        """Whether the scene gives the field of a record."""
        try:
            self.lookup(f"{name}.{flat[len(name) + 1 :]}")
        except KeyError:
            return False
        return True

    def record_of(self, node: ast.expr) -> tuple[str, type] | None:
        """The flat name and the class of a record: a parameter, or a field of a record that is one itself."""
        if isinstance(node, ast.Name) and node.id in self.records:
            return node.id, self.records[node.id]
        if isinstance(node, ast.Attribute) and (outer := self.record_of(node.value)):
            inner = fields_of(outer[1]).get(node.attr)
            if is_record(inner):
                return f"{outer[0]}_{node.attr}", inner
        return None

    def field_of(self, node: ast.Attribute, name: str, record: type) -> ast.expr:
        """A field of a record: a flat parameter, or what the scene gives for the field of a law that it fixes."""
        if node.attr not in fields_of(record):
            raise self.refuse(node, f"{record.__name__} has no field {node.attr}")
        try:
            return self.lookup(f"{name}.{node.attr}")
        except KeyError:
            return ast.Name(f"{name}_{node.attr}", ast.Load())

    def flattened(self, call: ast.Call, parameters: Mapping[str, type | None]) -> list[ast.expr]:
        """The arguments of a call in which each record has become its fields."""
        out: list[ast.expr] = []
        stars = any(isinstance(argument, ast.Starred) for argument in call.args)
        wanted = [None] * len(call.args) if stars else [*parameters.values()]
        if len(call.args) < len(wanted):  # a law without fields, bound by the scene, is not handed on
            wanted = [class_ for class_ in wanted if class_ is None or fields_of(class_)]
        for k, argument in enumerate(call.args):
            record, class_ = self.record_of(argument), wanted[k] if k < len(wanted) else None
            if record is None and class_ is None:
                out.append(argument)
            elif record is not None:
                if class_ is not record[1]:
                    raise self.refuse(call, f"the parameter {list(parameters)[k]} is no {record[1].__name__}")
                out += [ast.Name(flat, ast.Load()) for flat in self.flat_parameters(record[0], record[1])]
            elif made := self.made_record(argument):
                if class_ is not made[0]:
                    raise self.refuse(call, f"the parameter {list(parameters)[k]} is no {made[0].__name__}")
                out += made[1]
            else:  # a tuple that holds the fields
                count = len(fields_of(present(class_)))
                out += [ast.Subscript(argument, ast.Constant(k), ast.Load()) for k in range(count)]
        return out

    def made_record(self, node: ast.expr) -> tuple[type, list[ast.expr]] | None:
        """The class and the fields, in order, of a record that is made where it is handed on."""
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or node.func.id in self.locals:
            return None
        class_ = self.source.function.__globals__.get(node.func.id)
        if not is_record(class_):
            return None
        names = list(fields_of(class_))
        fields = dict(zip(names, node.args, strict=False)) | {word.arg: word.value for word in node.keywords}
        if len(node.args) + len(node.keywords) != len(names) or fields.keys() != set(names):
            raise self.refuse(node, f"{class_.__name__} has the fields {', '.join(names)}")
        return class_, [fields[name] for name in names]

    def visit_Tuple(self, node: ast.Tuple) -> ast.expr:
        if isinstance(node.ctx, ast.Load):
            node.elts = self.expanded(node.elts)
        return node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        if isinstance(node.func, ast.Attribute) and (record := self.record_of(node.func.value)):
            if not self.is_fixed(*record):
                node.args.insert(0, node.func.value)
            node.func = ast.Name(ast.unparse(node.func), ast.Load())  # a formula of a law
        if made := self.made_record(node):
            return self.visit(ast.copy_location(ast.Tuple(made[1], ast.Load()), node))
        if not isinstance(node.func, ast.Name) or node.keywords:
            raise self.refuse(node, "call functions by their plain names, without keywords")
        name = node.func.id
        if name in ("tuple", "sum"):
            items = self.unrolled(node.args[0])
            if name == "tuple":
                return ast.copy_location(ast.Tuple(items, ast.Load()), node)
            total = items[0] if items else ast.Constant(0.0)
            for item in items[1:]:
                total = self.combined(ast.copy_location(ast.BinOp(total, ast.Add(), item), node))
            return total
        if name in MATH_WORDS or (self.in_kernel and name in KERNEL_WORDS):
            node.args = self.expanded(node.args)
            return node
        if name in self.locals:
            raise self.refuse(node, f"{name} is a local value, not a formula")
        try:
            callee = self.call(name)
        except KeyError:
            raise self.refuse(node, f"{name} is not a formula and the scene binds nothing to it") from None
        if callee.result is not None:
            return copied(callee.result)
        node.args = self.expanded(self.flattened(node, callee.parameters))
        if len(node.args) != callee.count:
            raise self.refuse(node, f"{name} takes {callee.count} values, not {len(node.args)}")
        if callee.takes_numbers:
            node.args.append(ast.Name(NUMBERS, ast.Load()))
        node.func = ast.Name(callee.name, ast.Load())
        return node

    def generic_visit(self, node: ast.AST) -> ast.AST:
        if isinstance(node, (ast.Constant, ast.Name, ast.Pass, ast.Break, ast.Continue, ast.Load, ast.Store)):
            return node
        raise self.refuse(node, f"{type(node).__name__} is not in the subset")

    # ---- unrolling ---------------------------------------------------------------------------------------------------

    @staticmethod
    def is_static_range(node: ast.expr) -> TypeGuard[ast.Call]:
        return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "static_range"

    def static_values(self, call: ast.Call) -> range:
        bounds = [constant_of(self.visit(copied(a))) for a in call.args]
        if not all(known for known, _ in bounds):
            raise self.refuse(call, "the bounds of static_range must be fixed by the scene")
        return range(*(value for _, value in bounds))

    def unrolled(self, node: ast.expr) -> list[ast.expr]:
        """The items of `f(d) for d in static_range(N)`."""
        if not isinstance(node, ast.GeneratorExp) or len(node.generators) != 1 or node.generators[0].ifs:
            raise self.refuse(node, "expected `expression for name in static_range(N)`")
        generator = node.generators[0]
        if not self.is_static_range(generator.iter):
            raise self.refuse(node, "expected `expression for name in static_range(N)`")
        name, items = name_of(generator.target), []
        before = self.known.get(name)
        for value in self.static_values(generator.iter):
            self.known[name] = ast.Constant(value)
            items.append(self.visit(copied(node.elt)))
        if before is None:
            self.known.pop(name, None)
        else:
            self.known[name] = before
        return items

    def expanded(self, items: list[ast.expr]) -> list[ast.expr]:
        """Arguments or tuple elements with `*(… for … in static_range(N))` and `*(a, b)` written out."""
        out: list[ast.expr] = []
        for item in items:
            if not isinstance(item, ast.Starred):
                out.append(self.visit(item))
            elif isinstance(item.value, ast.GeneratorExp):
                out += self.unrolled(item.value)
            else:
                value = self.visit(item.value)
                if not isinstance(value, ast.Tuple):
                    raise self.refuse(item, "a star needs a tuple written out or a generator over static_range")
                out += value.elts
        return out
