"""Folding: one function of the formula subset, specialised for what a scene is.

The result is a plain `ast.FunctionDef` in which branches on what the scene fixes are resolved, `static_range` loops are
unrolled and arithmetic with 0 and 1 has vanished. Whole numbers and truth values of a scene are literals. What a scene
measures, its floats, are not: each becomes a `Number`, a place for a value that a kernel gets at run time, and so does
arithmetic among them; only a 0.0 is folded, as what a scene does not use it does not compute. Of a `Varying` one the
kernel gets the value of the moment. Records (named tuples and
laws, the types of parameters) are flattened to a parameter per field. Anything outside the subset is refused with the
module and line it stands on.
"""

from __future__ import annotations

import ast
import inspect
import operator
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, is_dataclass
from dataclasses import fields as dataclass_fields
from functools import cache
from typing import get_type_hints

from distfsi.formulas.subset import Varying

NUMBERS = "numbers_"  # the tuple in which functions hand on what a scene measures
MATH_WORDS = ("sqrt", "exp", "log", "pow", "abs", "min", "max")
KERNEL_WORDS = ("floor", "load", "store", "workspace", "range", "int", "int32", "len", "real")

_OPERATORS = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.USub: operator.neg, ast.Not: operator.not_,
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge, ast.BitAnd: operator.and_, ast.BitOr: operator.or_, ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
}  # fmt: skip


class NotInSubset(Exception):
    """A formula or kernel uses something that cannot be emitted."""


@dataclass(frozen=True)
class Bound:
    """The formula a scene puts in the place of a name, with the constants that belong to it alone.

    owner  whose constants they are: formulas of one owner share its numbers
    law    whose formula it is, if it is one of a law: the law may have inherited it
    """

    function: Callable
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

    function: Callable
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
        return f"{law.__name__}_{self.function.__name__}" if law else self.function.__name__

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
            if is_record(class_):
                class_ = self.records.get(class_.__name__, class_)
            found[name] = class_ if is_record(class_) else None
        return found

    def tree(self) -> ast.FunctionDef:
        """A tree of its own for each call."""
        tree = _parsed(self.function)
        if not isinstance(tree, ast.FunctionDef):
            raise NotInSubset(f"{self.location}: only plain functions can be emitted")
        return copied(tree)


def _class_of(function: Callable) -> type:
    """The class whose body a function stands in, at the top of its module."""
    return function.__globals__[function.__qualname__.split(".")[0]]


def is_record(class_: object) -> bool:
    """Whether a class is a record: a named tuple, or a law (a dataclass of numbers)."""
    return isinstance(class_, type) and (hasattr(class_, "_fields") or is_dataclass(class_))


def fields_of(record: type) -> dict[str, object]:
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


def parameters_of(function: Callable, first: int = 2) -> list[str]:
    """The flat parameters of a function from the `first` on: by default those of a driver behind begin and end."""
    found = Source(function).parameters.items()
    return [flat for name, record in found for flat in (flat_names(name, record) if record else [name])][first:]


def flat_values(arguments: Iterable[object]) -> Iterator[object]:
    """What a kernel is called with: its arguments, records replaced by their fields."""
    for argument in arguments:
        if isinstance(argument, tuple) and hasattr(argument, "_fields"):
            yield from flat_values(argument)
        else:
            yield argument


def named(node: ast.expr) -> ast.expr:
    """The tree with each Number as a plain name, for a text."""
    if isinstance(node, Number):
        return ast.Name(node.id, ast.Load())
    new = copied(node)
    for name, value in vars(new).items():
        if isinstance(value, ast.expr):
            setattr(new, name, named(value))
    return new


@cache
def _parsed(function: Callable) -> ast.stmt:
    return ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]


def copied(node: ast.AST) -> ast.AST:
    """A tree with nodes of its own, several times as fast as by copy.deepcopy."""
    new = type(node)()
    for name, value in vars(node).items():
        if isinstance(value, list):
            value = [copied(item) if isinstance(item, ast.AST) else item for item in value]
        elif isinstance(value, ast.AST) and not isinstance(value, ast.expr_context):
            value = copied(value)
        setattr(new, name, value)
    return new


def stored_names(node: ast.AST, sometimes: tuple[type, ...], within: bool = False) -> Iterator[tuple[str, bool]]:
    """Each name that is assigned to, and whether within a statement of a kind that may run never or more than once."""
    within = within or isinstance(node, sometimes)
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id, within
    for child in ast.iter_child_nodes(node):
        yield from stored_names(child, sometimes, within)


class Number(ast.Name):
    """A number that a scene measures, or arithmetic among such: `id` says which, whatever its `value` is."""

    def __init__(self, id: str = "", value: float = 0.0):
        super().__init__(id, ast.Load())
        self.value = value


class Changing(ast.Name):
    """A number of a scene that changes from call to call: arithmetic with it is the kernel's."""

    def __init__(self, id: str = "", value: Varying | None = None):
        super().__init__(id, ast.Load())
        self.value = value


def literal(value: object) -> ast.expr:
    """The tree of a constant: a number, a truth value or a tuple of them."""
    if isinstance(value, tuple):
        return ast.Tuple([literal(item) for item in value], ast.Load())
    return ast.Constant(value)


def given(value: object, label: str) -> ast.expr:
    """The tree of a constant that a scene gives, in which floats other than 0.0 are Numbers of that label."""
    if isinstance(value, tuple):
        return ast.Tuple([given(item, f"{label}[{k}]") for k, item in enumerate(value)], ast.Load())
    if isinstance(value, Varying):
        return Changing(f"given[{label!r}]", value)
    is_number = isinstance(value, float) and value != 0.0
    return Number(f"given[{label!r}]", float(value)) if is_number else ast.Constant(value)


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


def is_fixed(node: ast.expr) -> bool:
    """Whether a tree is a constant, a number of the scene, or a tuple of such: the same wherever it stands."""
    if isinstance(node, ast.Tuple):
        return all(map(is_fixed, node.elts))
    return isinstance(node, (ast.Constant, Number, Changing))


def truth_of(node: ast.expr) -> tuple[bool, object]:
    """(True, value) when it is known whether the tree is true; a Number is, as it is not 0.0."""
    return (True, True) if isinstance(node, Number) else constant_of(node)


def constant_of(node: ast.expr) -> tuple[bool, object]:
    """(True, value) when the tree is a constant or a tuple of constants."""
    if isinstance(node, ast.Constant):
        return True, node.value
    if isinstance(node, ast.Tuple):
        parts = [constant_of(item) for item in node.elts]
        if all(known for known, _ in parts):
            return True, tuple(value for _, value in parts)
    return False, None


class Fold(ast.NodeTransformer):
    """Folds one function.

    `lookup(name)` gives the tree of a scene constant; `call(name)` the callee. Both raise KeyError for what they do not
    know.
    """

    def __init__(self, source: Source, lookup: Callable[[str], ast.expr], call: Callable[[str], Callee]):
        self.source, self.lookup, self.call = source, lookup, call
        self.known: dict[str, ast.expr] = {}
        self.locals: set[str] = set()
        self.in_kernel = source.kind != "formula"

    def refuse(self, node: ast.AST, why: str) -> NotInSubset:
        line = self.source.function.__code__.co_firstlineno + getattr(node, "lineno", 1) - 1
        return NotInSubset(f"{self.source.function.__module__} line {line}, in {self.source.function.__name__}: {why}")

    def run(self) -> ast.FunctionDef:
        tree = self.source.tree()
        tree.decorator_list, tree.returns = [], None
        self.records = {name: class_ for name, class_ in self.source.parameters.items() if class_ is not None}
        flat = {name: self.flat_parameters(name, class_) for name, class_ in self.source.parameters.items()}
        self.parameters = {n: class_ for n, class_ in self.source.parameters.items() if not self.is_fixed(n, class_)}
        names = [name for each in flat.values() for name in each]
        tree.args.args = [ast.arg(name) for name in names]
        sometimes = (ast.For, ast.While, ast.AugAssign, *((ast.If,) if self.in_kernel else ()))
        stored = list(stored_names(tree, sometimes))
        times = Counter(name for name, _ in stored)
        self.locals = {a.arg for a in tree.args.args} | set(times)
        self.propagate = {name for name, within in stored if times[name] == 1 and not within}
        tree.body = self.statements(tree.body)
        if not self.in_kernel:
            self.refuse_integers(tree)
        return ast.fix_missing_locations(tree)

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

    def refuse_integers(self, tree: ast.AST) -> None:
        """Integers are for indices and arguments of other formulas; elsewhere they turn float32 into float64."""
        for node in ast.iter_child_nodes(tree):
            index = isinstance(tree, ast.Subscript) and node is tree.slice
            argument = isinstance(tree, ast.Call) and tree.func.id not in MATH_WORDS
            if isinstance(node, ast.Constant) and type(node.value) is int and not (index or argument):
                raise self.refuse(node, f"write {node.value}.0: an integer would turn float32 into float64")
            self.refuse_integers(node)

    # ---- statements --------------------------------------------------------------------------------------------------

    def statements(self, body: list[ast.stmt]) -> list[ast.stmt]:
        out: list[ast.stmt] = []
        for statement in body:
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                continue  # docstring
            result = self.visit(statement)
            out += result if isinstance(result, list) else [result] if result is not None else []
            if out and isinstance(out[-1], ast.Return):
                break
        return out

    def visit_Assign(self, node: ast.Assign):
        if len(node.targets) != 1:
            raise self.refuse(node, "one target per assignment")
        node.value = self.visit(node.value)
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple) and is_fixed(node.value):
            parts = zip(target.elts, node.value.elts, strict=True)
            return self.statements([ast.copy_location(ast.Assign([t], v), node) for t, v in parts])
        if isinstance(target, ast.Name):
            if target.id in self.propagate and is_fixed(node.value):
                self.known[target.id] = node.value
                return None
        elif isinstance(target, ast.Subscript):
            if not self.in_kernel:
                raise self.refuse(node, "a formula does not write into its arguments")
            node.targets = [self.visit(target)]
        elif not isinstance(target, ast.Tuple):
            raise self.refuse(node, "assign to names only")
        return node

    def visit_AugAssign(self, node: ast.AugAssign):
        if not self.in_kernel:
            raise self.refuse(node, "a formula names each value once (no +=)")
        node.value = self.visit(node.value)
        if isinstance(node.target, ast.Subscript):
            node.target = self.visit(node.target)
        return node

    def visit_If(self, node: ast.If):
        test = self.visit(node.test)
        known, value = truth_of(test)
        if known:
            return self.statements(node.body if value else node.orelse)
        if not self.in_kernel:
            raise self.refuse(node, "a formula does not branch at run time; write `x if condition else y`")
        node.test, node.body, node.orelse = test, self.statements(node.body), self.statements(node.orelse)
        if not node.body:
            node.body = [ast.Pass()]
        return node

    def visit_For(self, node: ast.For):
        if node.orelse:
            raise self.refuse(node, "no else on a loop")
        if self.is_static_range(node.iter):
            out = []
            for value in self.static_values(node.iter):
                self.known[node.target.id] = ast.Constant(value)
                out += self.statements([copied(statement) for statement in node.body])
            self.known.pop(node.target.id, None)
            return out
        if not self.in_kernel:
            raise self.refuse(node, "a formula loops over static_range only")
        node.iter, node.body = self.visit(node.iter), self.statements(node.body)
        return node

    def visit_While(self, node: ast.While):
        if not self.in_kernel:
            raise self.refuse(node, "a formula loops over static_range only")
        node.test, node.body = self.visit(node.test), self.statements(node.body)
        return node

    def visit_Return(self, node: ast.Return):
        node.value = self.visit(node.value) if node.value is not None else None
        return node

    def visit_Expr(self, node: ast.Expr):
        if not self.in_kernel or not isinstance(node.value, ast.Call):
            raise self.refuse(node, "a statement that has no effect")
        node.value = self.visit(node.value)
        return node

    # ---- expressions -------------------------------------------------------------------------------------------------

    def visit_Name(self, node: ast.Name):
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

    def visit_BinOp(self, node: ast.BinOp):
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

    def visit_UnaryOp(self, node: ast.UnaryOp):
        node.operand = self.visit(node.operand)
        if type(node.op) not in _OPERATORS:
            raise self.refuse(node, f"operator {type(node.op).__name__} is not in the subset")
        if isinstance(node.operand, ast.Constant):
            return ast.copy_location(ast.Constant(_OPERATORS[type(node.op)](node.operand.value)), node)
        if isinstance(node.operand, Number) and isinstance(node.op, ast.USub):
            return Number(f"-{node.operand.id}", -node.operand.value)
        return node

    def visit_Compare(self, node: ast.Compare):
        if len(node.ops) != 1:
            raise self.refuse(node, "one comparison at a time")
        if type(node.ops[0]) not in _OPERATORS:
            raise self.refuse(node, f"operator {type(node.ops[0]).__name__} is not in the subset")
        node.left, node.comparators = self.visit(node.left), [self.visit(node.comparators[0])]
        (known_l, left), (known_r, right) = constant_of(node.left), constant_of(node.comparators[0])
        if known_l and known_r:
            return ast.copy_location(ast.Constant(_OPERATORS[type(node.ops[0])](left, right)), node)
        return node

    def visit_BoolOp(self, node: ast.BoolOp):
        stop = isinstance(node.op, ast.Or)  # the value that decides
        values = []
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

    def visit_IfExp(self, node: ast.IfExp):
        test = self.visit(node.test)
        known, value = truth_of(test)
        if known:
            return self.visit(node.body if value else node.orelse)
        node.test, node.body, node.orelse = test, self.visit(node.body), self.visit(node.orelse)
        return node

    def visit_Subscript(self, node: ast.Subscript):
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

    def visit_Attribute(self, node: ast.Attribute):
        record = self.record_of(node.value)
        if record is not None:
            return self.field_of(node, *record)
        if not self.in_kernel or node.attr not in ("shape", "size"):
            raise self.refuse(node, "no attributes but fields of records and, in kernels, the shape and size of arrays")
        node.value = self.visit(node.value)
        return node

    # ---- records -----------------------------------------------------------------------------------------------------

    def record_of(self, node: ast.expr) -> tuple[str, type] | None:
        """The flat name and the class of a record: a parameter, or a field of a record that is one itself."""
        if isinstance(node, ast.Name) and node.id in self.records:
            return node.id, self.records[node.id]
        if isinstance(node, ast.Attribute):
            outer = self.record_of(node.value)
            inner = fields_of(outer[1]).get(node.attr) if outer else None
            if inner is not None and is_record(inner):
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
                out += [ast.Subscript(argument, ast.Constant(k), ast.Load()) for k in range(len(fields_of(class_)))]
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

    def visit_Tuple(self, node: ast.Tuple):
        if isinstance(node.ctx, ast.Load):
            node.elts = self.expanded(node.elts)
        return node

    def visit_Call(self, node: ast.Call):
        if isinstance(node.func, ast.Attribute) and self.record_of(node.func.value):
            if not self.is_fixed(*self.record_of(node.func.value)):
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

    def generic_visit(self, node: ast.AST):
        if isinstance(node, (ast.Constant, ast.Name, ast.Pass, ast.Break, ast.Continue, ast.Load, ast.Store)):
            return node
        raise self.refuse(node, f"{type(node).__name__} is not in the subset")

    # ---- unrolling ---------------------------------------------------------------------------------------------------

    @staticmethod
    def is_static_range(node: ast.expr) -> bool:
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
        name, items = generator.target.id, []
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
