"""The first writer: a driver and all the formulas it reaches -> the LLVM IR of one module, from folded trees.

What a driver is called with fixes the types of its parameters; from there types follow the assignments, and each
function is written once for each list of types it is called with. Integers have 64 bits; an integer with a real of any
size makes a double. A name keeps its type. Nothing here reassociates or contracts arithmetic: the bits are those of the
text, on any machine.

A value is a type and its *leaves*, operands of LLVM: one of a number; the address and the lengths of an array; those of
its parts, one after the other, of a tuple.
"""

from __future__ import annotations

import ast
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from distfsi.device.emit import Emission
from distfsi.device.exponential import EXPONENTIALS
from distfsi.device.fold import Bound, NotInSubset, Source, stored_names

INTEGER, BOOL = "i64", "i1"
REALS = {"float64": "double", "float32": "float"}
STORED = {"float64": "double", "float32": "float", "bool": "i8", "int64": "i64", "int32": "i32", "int8": "i8"}
STORED |= {"uint8": "i8"}  # how values of an array lie in memory
ARITHMETIC = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
BITWISE = {ast.BitAnd: "and", ast.BitOr: "or", ast.LShift: "shl", ast.RShift: "ashr"}
COMPARISONS = {ast.Eq: "eq", ast.NotEq: "ne", ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge"}
LOOPS = (ast.For, ast.While)
DECLARED = [f"declare double @llvm.{word}.f64(double)" for word in ("sqrt", "log", "fabs", "floor")]
DECLARED += [f"declare float @llvm.{word}.f32(float)" for word in ("sqrt", "log", "fabs", "floor")]
DECLARED += ["declare double @llvm.pow.f64(double, double)", "declare float @llvm.pow.f32(float, float)"]
DECLARED += ["declare i64 @llvm.abs.i64(i64, i1)", "declare noalias ptr @malloc(i64)", "declare void @free(ptr)"]


@dataclass(frozen=True)
class Array:
    """The type of a contiguous array: numpy's name of its values' type, and its axes."""

    element: str
    axes: int


Type = str | Array | tuple


class Value(NamedTuple):
    """A value in the text being written."""

    type: Type
    leaves: tuple[str, ...]


class Slot(NamedTuple):
    """Memory of a name that is assigned to more than once: an address per leaf."""

    type: Type
    addresses: tuple[str, ...]


def type_of(argument: object) -> Type:
    """The type of what a driver is called with. Raises TypeError for what no kernel takes."""
    if isinstance(argument, tuple):
        return tuple(map(type_of, argument))
    if isinstance(argument, np.ndarray) and argument.ndim:
        if argument.dtype.name not in STORED or not argument.flags.c_contiguous:
            raise TypeError(f"kernels take contiguous arrays of numbers, not of {argument.dtype}")
        return Array(argument.dtype.name, argument.ndim)
    dtype = np.asarray(argument).dtype
    kind = {"b": BOOL, "i": INTEGER, "u": INTEGER}.get(dtype.kind) or REALS.get(dtype.name)
    if kind is None:
        raise TypeError(f"kernels take no {type(argument).__name__}")
    return kind


def leaf_types(kind: Type) -> list[str]:
    """The LLVM types of a type's leaves."""
    if isinstance(kind, Array):
        return ["ptr", *[INTEGER] * kind.axes]
    if isinstance(kind, tuple):
        return [leaf for part in kind for leaf in leaf_types(part)]
    return [kind]


def packed_type(kind: Type | None) -> str:
    """The LLVM type in which a function returns a type."""
    leaves = [] if kind is None else leaf_types(kind)
    return "void" if not leaves else leaves[0] if len(leaves) == 1 else f"{{{', '.join(leaves)}}}"


def parts_of(value: Value) -> list[Value]:
    """The parts of a tuple."""
    parts, start = [], 0
    for kind in value.type:
        end = start + len(leaf_types(kind))
        parts.append(Value(kind, value.leaves[start:end]))
        start = end
    return parts


def joined(parts: Sequence[Value]) -> Value:
    """A tuple of parts."""
    return Value(tuple(part.type for part in parts), tuple(leaf for part in parts for leaf in part.leaves))


def number(value: float, real: str) -> str:
    """A literal of the real type: the bits of a double."""
    (bits,) = struct.unpack("<Q", struct.pack("<d", np.float32(value) if real == "float" else value))
    return f"0x{bits:016X}"


@dataclass
class Function:
    """A function that is written: its name, the type it returns, its text."""

    name: str
    returns: Type | None
    text: str


@dataclass
class Module:
    """The functions that a driver reaches, each for the types it is called with."""

    folded: Mapping[str, tuple[Source, ast.FunctionDef]]
    real: str
    written: dict[tuple, Function] = field(default_factory=dict)
    loops: int = 0

    def function(self, name: str, types: tuple[Type, ...]) -> Function:
        """The function for such arguments, written at its first call."""
        key = name, types
        if key not in self.written:
            copies = sum(other == name for other, _ in self.written)
            self.written[key] = Writer(self, *self.folded[name]).function(f"{name}.{copies}", types)
        return self.written[key]

    def loop(self) -> str:
        """The mark of a loop that is to become one of vectors: its steps are not written out, however few."""
        self.loops += 1
        return f"!{self.loops}"

    def text(self) -> str:
        """The whole module."""
        marks = [f"!{k} = distinct !{{!{k}, !0}}" for k in range(1, self.loops + 1)]
        marks = ['!0 = !{!"llvm.loop.unroll.disable"}', *marks] if marks else []
        return "\n".join([*DECLARED, "", *(function.text for function in self.written.values()), *marks, ""])


def module_of(
    driver: Callable,
    constants: Mapping[str, object],
    bindings: Mapping[str, Bound],
    real: str,
    types: tuple[Type, ...],
) -> tuple[Module, Function]:
    """The module of one driver, or of a formula as if it were one, for arguments of such types; and the driver in it.

    Raises NotInSubset.
    """
    emission = Emission(constants, bindings)
    name = emission.add(driver, {})
    module = Module(emission.functions, REALS[real])
    return module, module.function(name, types)


class Writer:
    """Writes one folded function."""

    def __init__(self, module: Module, source: Source, tree: ast.FunctionDef):
        self.module, self.source, self.tree, self.real = module, source, tree, module.real
        self.lines: list[str] = []
        self.slots: list[str] = []  # what stands at the start of the function
        self.scopes: list[dict[str, Value | Slot]] = []
        self.loops: list[tuple[str, str]] = []  # where `continue` and `break` go
        self.block, self.ended, self.count = "entry", False, 0
        self.owned: list[str] = []  # memory to free
        self.returns: Type | None = None
        self.returned = False
        branches = any(isinstance(node, (ast.If, *LOOPS)) for node in ast.walk(tree))
        times = Counter(name for name, _ in stored_names(tree, ())) + Counter(a.arg for a in tree.args.args)
        self.changing = {name for name, n in times.items() if n > 1} if branches else set()

    def refuse(self, why: str) -> NotInSubset:
        return NotInSubset(f"{self.source.place}, {self.source.function.__name__}: {why}")

    def function(self, name: str, types: tuple[Type, ...]) -> Function:
        """The function as `name`, for arguments of such types."""
        self.scopes = [{}]
        parameters, alias = [], "noalias " if self.source.kind == "row" else ""
        for argument, kind in zip(self.tree.args.args, types, strict=True):
            leaves = [f"%p{len(parameters) + k}" for k in range(len(leaf_types(kind)))]
            for leaf, leaf_kind in zip(leaves, leaf_types(kind), strict=True):
                parameters.append(f"{leaf_kind} {alias if leaf_kind == 'ptr' else ''}{leaf}")
            self.assign(argument.arg, Value(kind, tuple(leaves)))
        self.statements(self.tree.body)
        if not self.ended:
            if self.returned and self.returns is not None:
                raise self.refuse("it may end without a value")
            self.give_back(None)
        inlined = " alwaysinline" if self.source.kind in ("formula", "helper") else ""
        head = f"define internal {packed_type(self.returns)} @{name}({', '.join(parameters)}) nounwind{inlined} {{"
        text = "\n".join([f"; {self.source.place}", head, "entry:", *self.slots, *self.lines, "}", ""])
        return Function(name, self.returns, text)

    # ---- text --------------------------------------------------------------------------------------------------------

    def name(self, kind: str = "t") -> str:
        self.count += 1
        return f"{kind}{self.count}"

    def line(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def new(self, text: str) -> str:
        """The operand that an instruction makes."""
        name = f"%{self.name()}"
        self.line(f"{name} = {text}")
        return name

    def go(self, label: str) -> None:
        """End the block, unless it has ended."""
        if not self.ended:
            self.line(f"br label %{label}")
            self.ended = True

    def branch(self, condition: str, yes: str, no: str) -> None:
        self.line(f"br i1 {condition}, label %{yes}, label %{no}")
        self.ended = True

    def start(self, label: str) -> None:
        """Begin a block."""
        self.lines.append(f"{label}:")
        self.block, self.ended = label, False

    @contextmanager
    def apart(self) -> Iterator[list[str]]:
        """Write into a list of its own."""
        before, self.lines = self.lines, []
        yield self.lines
        self.lines = before

    # ---- names -------------------------------------------------------------------------------------------------------

    def found(self, name: str) -> Value | Slot | None:
        return next((scope[name] for scope in reversed(self.scopes) if name in scope), None)

    def assign(self, name: str, value: Value) -> None:
        """Give a name a value; the first assignment in reach declares it."""
        if name not in self.changing:
            self.scopes[-1][name] = value
            return
        place = self.found(name)
        if place is None:
            addresses = [f"%{self.name('s')}" for _ in value.leaves]
            pairs = zip(addresses, leaf_types(value.type), strict=True)
            self.slots += [f"  {address} = alloca {kind}" for address, kind in pairs]
            place = self.scopes[-1][name] = Slot(value.type, tuple(addresses))
        if isinstance(place, Value):
            raise self.refuse(f"{name} runs over a range, but gets another value")
        if self.common(place.type, value.type) != place.type:
            raise self.refuse(f"{name} gets a value of another type")
        value = self.converted(value, place.type)
        for kind, leaf, address in zip(leaf_types(place.type), value.leaves, place.addresses, strict=True):
            self.line(f"store {kind} {leaf}, ptr {address}")

    # ---- types -------------------------------------------------------------------------------------------------------

    def common(self, a: Type, b: Type) -> Type:
        """The type that holds values of both."""
        if a == b:
            return a
        if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
            return tuple(map(self.common, a, b))
        if not (isinstance(a, str) and isinstance(b, str)):
            raise self.refuse(f"one of two values is {a}, the other {b}")
        return INTEGER if {a, b} == {BOOL, INTEGER} else "double"

    def converted(self, value: Value, kind: Type) -> Value:
        """The value in another type."""
        if value.type == kind:
            return value
        if isinstance(kind, tuple):
            pairs = zip(parts_of(value), kind, strict=True)
            return joined([self.converted(part, part_kind) for part, part_kind in pairs])
        return Value(kind, (self.cast(value.leaves[0], value.type, kind),))

    def cast(self, leaf: str, old: str, new: str) -> str:
        if old == new:
            return leaf
        if new == BOOL:
            return self.new(f"icmp ne i64 {leaf}, 0" if old == INTEGER else f"fcmp une {old} {leaf}, 0.0")
        if new == INTEGER:
            return self.new(f"zext i1 {leaf} to i64" if old == BOOL else f"fptosi {old} {leaf} to i64")
        if old in (BOOL, INTEGER):
            return self.new(f"{'uitofp' if old == BOOL else 'sitofp'} {old} {leaf} to {new}")
        return self.new(f"{'fpext' if new == 'double' else 'fptrunc'} {old} {leaf} to {new}")

    def scalar(self, value: Value, kind: str) -> str:
        """The one leaf of a number, in a type."""
        if not isinstance(value.type, str):
            raise self.refuse(f"a number is needed, not {value.type}")
        return self.cast(value.leaves[0], value.type, kind)

    def truth(self, node: ast.expr) -> str:
        return self.scalar(self.value(node), BOOL)

    def integer(self, node: ast.expr) -> str:
        return self.scalar(self.value(node), INTEGER)

    # ---- statements --------------------------------------------------------------------------------------------------

    def statements(self, body: Sequence[ast.stmt]) -> None:
        for statement in body:
            if self.ended:
                return
            getattr(self, f"write_{type(statement).__name__.lower()}")(statement)

    def nested(self, body: Sequence[ast.stmt], **names: Value) -> None:
        self.scopes.append(names)
        self.statements(body)
        self.scopes.pop()

    def write_pass(self, node: ast.Pass) -> None:
        pass

    def write_break(self, node: ast.Break) -> None:
        self.go(self.loops[-1][1])

    def write_continue(self, node: ast.Continue) -> None:
        self.go(self.loops[-1][0])

    def write_expr(self, node: ast.Expr) -> None:
        self.value(node.value)

    def write_return(self, node: ast.Return) -> None:
        value = None if node.value is None else self.value(node.value)
        kind = None if value is None else value.type
        if not self.returned:
            self.returned, self.returns = True, kind
        if kind != self.returns:
            if kind is None or self.returns is None or self.common(kind, self.returns) != self.returns:
                raise self.refuse("its values have several types; the first one must be the widest")
            value = self.converted(value, self.returns)
        self.give_back(value)

    def give_back(self, value: Value | None) -> None:
        for memory in self.owned:
            self.line(f"call void @free(ptr {memory})")
        leaves, packed = () if value is None else value.leaves, packed_type(self.returns)
        if len(leaves) > 1:
            whole = "poison"
            for k, (kind, leaf) in enumerate(zip(leaf_types(value.type), leaves, strict=True)):
                whole = self.new(f"insertvalue {packed} {whole}, {kind} {leaf}, {k}")
            leaves = (whole,)
        self.line(f"ret {packed} {leaves[0]}" if leaves else "ret void")
        self.ended = True

    def write_assign(self, node: ast.Assign) -> None:
        self.store(node.targets[0], self.value(node.value))

    def write_augassign(self, node: ast.AugAssign) -> None:
        before = ast.parse(ast.unparse(node.target), mode="eval").body
        self.store(node.target, self.value(ast.BinOp(before, node.op, node.value)))

    def store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self.assign(target.id, value)
        elif isinstance(target, ast.Tuple):
            for k, part in enumerate(target.elts):
                self.store(part, self.item(value, k))
        else:
            array = self.value(target.value)
            self.put(array.type.element, self.address(array, self.places(target.slice)), value)

    def write_if(self, node: ast.If) -> None:
        yes, no, after = self.name("yes"), self.name("no"), self.name("after")
        self.branch(self.truth(node.test), yes, no if node.orelse else after)
        ends = []
        for label, body in ((yes, node.body), (no, node.orelse)):
            if body:
                self.start(label)
                self.nested(body)
                ends.append(self.ended)
                self.go(after)
        if node.orelse and all(ends):
            self.ended = True
        else:
            self.start(after)

    def write_while(self, node: ast.While) -> None:
        head, body, after = self.name("head"), self.name("body"), self.name("after")
        self.go(head)
        self.start(head)
        self.branch(self.truth(node.test), body, after)
        self.start(body)
        self.loops.append((head, after))
        self.nested(node.body)
        self.loops.pop()
        self.go(head)
        self.start(after)

    def write_for(self, node: ast.For) -> None:
        if not (isinstance(node.iter, ast.Call) and node.iter.func.id == "range"):
            raise self.refuse("loops run over a range")
        bounds, step = [self.integer(bound) for bound in node.iter.args], "1"
        if len(bounds) == 3:
            if not bounds[2].lstrip("-").isdigit():
                raise self.refuse("the step of a range must be fixed by the scene")
            step = bounds.pop()
        first, end = bounds if len(bounds) > 1 else ("0", bounds[0])
        head, body, after, next_ = self.name("head"), self.name("body"), self.name("after"), self.name("next")
        i, following, before = f"%{self.name('i')}", f"%{self.name('i')}", self.block
        self.go(head)
        self.start(head)
        self.line(f"{i} = phi i64 [{first}, %{before}], [{following}, %{next_}]")
        self.branch(self.new(f"icmp {'sgt' if step[0] == '-' else 'slt'} i64 {i}, {end}"), body, after)
        self.start(body)
        self.loops.append((next_, after))
        self.nested(node.body, **{node.target.id: Value(INTEGER, (i,))})
        self.loops.pop()
        self.go(next_)
        self.start(next_)
        self.line(f"{following} = add nsw i64 {i}, {step}")
        mark = f", !llvm.loop {self.module.loop()}" if self.source.kind == "row" else ""
        self.line(f"br label %{head}{mark}")
        self.start(after)

    # ---- expressions -------------------------------------------------------------------------------------------------

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
        return Value(self.real, (number(node.value, self.real),))

    def value_of_name(self, node: ast.Name) -> Value:
        place = self.found(node.id)
        if place is None:
            raise self.refuse(f"{node.id} has a value only inside a branch or loop; give it one before")
        if isinstance(place, Value):
            return place
        pairs = zip(leaf_types(place.type), place.addresses, strict=True)
        return Value(place.type, tuple(self.new(f"load {kind}, ptr {address}") for kind, address in pairs))

    def value_of_tuple(self, node: ast.Tuple) -> Value:
        return joined([self.value(item) for item in node.elts])

    def value_of_binop(self, node: ast.BinOp) -> Value:
        a, b, operator = self.value(node.left), self.value(node.right), type(node.op)
        if operator in BITWISE and a.type == b.type == BOOL:
            return Value(BOOL, (self.new(f"{BITWISE[operator]} i1 {a.leaves[0]}, {b.leaves[0]}"),))
        kind = INTEGER if a.type == b.type == BOOL else self.common(a.type, b.type)
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

    def compared(self, word: str, a: Value, b: Value) -> str:
        kind = self.common(a.type, b.type)
        x, y = self.scalar(a, kind), self.scalar(b, kind)
        if kind in (BOOL, INTEGER):
            return self.new(f"icmp {word if word in ('eq', 'ne') else 's' + word} {kind} {x}, {y}")
        return self.new(f"fcmp {'une' if word == 'ne' else 'o' + word} {kind} {x}, {y}")

    def value_of_unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(BOOL, (self.new(f"xor i1 {self.truth(node.operand)}, true"),))
        value = self.value(node.operand)
        kind = INTEGER if value.type == BOOL else value.type
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

    def chosen(self, condition: str, body: Callable[[], Value], orelse: Callable[[], Value]) -> Value:
        """One of two values, of which only that one is computed."""
        yes, no, after = self.name("yes"), self.name("no"), self.name("after")
        before, values, texts, blocks = self.block, [], [], []
        for label, write in ((yes, body), (no, orelse)):
            with self.apart() as lines:
                self.block = label
                values.append(write())
                texts.append(lines)
                blocks.append(self.block)
        kind = self.common(*(value.type for value in values))
        for k in range(2):
            with self.apart() as lines:
                values[k] = self.converted(values[k], kind)
                texts[k] += lines
        if not any(texts):
            self.block = before
            return self.selected(condition, *values)
        self.branch(condition, yes, no)
        for label, lines in ((yes, texts[0]), (no, texts[1])):
            self.start(label)
            self.lines += lines
            self.go(after)
        self.start(after)
        triples = zip(leaf_types(kind), values[0].leaves, values[1].leaves, strict=True)
        leaves = [self.new(f"phi {leaf} [{a}, %{blocks[0]}], [{b}, %{blocks[1]}]") for leaf, a, b in triples]
        return Value(kind, tuple(leaves))

    def selected(self, condition: str, a: Value, b: Value) -> Value:
        """One of two values of one type that are both computed."""
        triples = zip(leaf_types(a.type), a.leaves, b.leaves, strict=True)
        leaves = [self.new(f"select i1 {condition}, {leaf} {x}, {leaf} {y}") for leaf, x, y in triples]
        return Value(a.type, tuple(leaves))

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
            return self.get(whole, self.places(node.slice))
        if isinstance(node.slice, ast.Constant):
            return self.item(whole, node.slice.value)
        *others, chosen = parts_of(whole)
        place = self.integer(node.slice)
        for k, part in reversed(list(enumerate(others))):
            chosen = self.selected(self.new(f"icmp eq i64 {place}, {k}"), part, self.converted(chosen, part.type))
        return chosen

    def item(self, whole: Value, k: int) -> Value:
        return self.get(whole, [str(k)]) if isinstance(whole.type, Array) else parts_of(whole)[k]

    # ---- arrays ------------------------------------------------------------------------------------------------------

    def places(self, node: ast.expr) -> list[str]:
        return [self.integer(place) for place in (node.elts if isinstance(node, ast.Tuple) else [node])]

    def address(self, array: Value, places: Sequence[str]) -> str:
        data, *lengths = array.leaves
        flat = places[0]
        for place, length in zip([*places[1:], *["0"] * (len(lengths) - len(places))], lengths[1:], strict=True):
            flat = self.new(f"mul i64 {flat}, {length}")
            flat = flat if place == "0" else self.new(f"add i64 {flat}, {place}")
        return self.new(f"getelementptr inbounds {STORED[array.type.element]}, ptr {data}, i64 {flat}")

    def get(self, array: Value, places: Sequence[str]) -> Value:
        """A value of an array, or with fewer places than axes the array of the rest."""
        element, axes = array.type.element, array.type.axes
        if len(places) < axes:
            rest = array.leaves[1 + len(places) :]
            return Value(Array(element, axes - len(places)), (self.address(array, places), *rest))
        return self.loaded(element, self.address(array, places))

    def loaded(self, element: str, address: str) -> Value:
        stored = STORED[element]
        leaf = self.new(f"load {stored}, ptr {address}")
        if element in REALS or element == "int64":
            return Value(stored, (leaf,))
        if element == "bool":
            return Value(BOOL, (self.new(f"icmp ne i8 {leaf}, 0"),))
        return Value(INTEGER, (self.new(f"{'zext' if element[0] == 'u' else 'sext'} {stored} {leaf} to i64"),))

    def put(self, element: str, address: str, value: Value) -> None:
        stored = STORED[element]
        if element in REALS:
            leaf = self.scalar(value, stored)
        elif element == "bool":
            leaf = self.new(f"zext i1 {self.scalar(value, BOOL)} to i8")
        else:
            leaf = self.scalar(value, INTEGER)
            leaf = leaf if stored == INTEGER else self.new(f"trunc i64 {leaf} to {stored}")
        self.line(f"store {stored} {leaf}, ptr {address}")

    # ---- calls -------------------------------------------------------------------------------------------------------

    def value_of_call(self, node: ast.Call) -> Value:
        values = [self.value(argument) for argument in node.args]
        word = getattr(self, f"word_{node.func.id}", None)
        if word is not None:
            return word(*values)
        function = self.module.function(node.func.id, tuple(value.type for value in values))
        return self.called(function, values)

    def called(self, function: Function, values: Sequence[Value]) -> Value:
        whole = joined(values)
        operands = [f"{kind} {leaf}" for kind, leaf in zip(leaf_types(whole.type), whole.leaves, strict=True)]
        packed = packed_type(function.returns)
        call = f"call {packed} @{function.name}({', '.join(operands)})"
        if packed == "void":
            self.line(call)
            return Value((), ())
        result, count = self.new(call), len(leaf_types(function.returns))
        leaves = [result] if count == 1 else [self.new(f"extractvalue {packed} {result}, {k}") for k in range(count)]
        return Value(function.returns, tuple(leaves))

    def mathematics(self, word: str, *values: Value) -> Value:
        """A function of reals that LLVM knows."""
        kind = values[0].type
        for value in values[1:]:
            kind = self.common(kind, value.type)
        kind = "double" if kind in (BOOL, INTEGER) else kind
        operands = ", ".join(f"{kind} {self.scalar(value, kind)}" for value in values)
        return Value(kind, (self.new(f"call {kind} @llvm.{word}.{'f64' if kind == 'double' else 'f32'}({operands})"),))

    def word_sqrt(self, x: Value) -> Value:
        return self.mathematics("sqrt", x)

    def word_log(self, x: Value) -> Value:
        return self.mathematics("log", x)

    def word_pow(self, x: Value, y: Value) -> Value:
        return self.mathematics("pow", x, y)

    def word_abs(self, x: Value) -> Value:
        if x.type == INTEGER:
            return Value(INTEGER, (self.new(f"call i64 @llvm.abs.i64(i64 {x.leaves[0]}, i1 false)"),))
        return self.mathematics("fabs", x)

    def word_floor(self, x: Value) -> Value:
        return self.converted(self.mathematics("floor", x), INTEGER)

    def word_int(self, x: Value) -> Value:
        return self.converted(x, INTEGER)

    def word_real(self, x: Value) -> Value:
        return self.converted(x, self.real)

    def word_min(self, a: Value, b: Value) -> Value:
        """a if a < b else b, of NaN and a number the second."""
        return self.smaller("lt", a, b)

    def word_max(self, a: Value, b: Value) -> Value:
        """a if a > b else b, of NaN and a number the second."""
        return self.smaller("gt", a, b)

    def smaller(self, word: str, a: Value, b: Value) -> Value:
        kind = self.common(a.type, b.type)
        a, b = self.converted(a, kind), self.converted(b, kind)
        return self.selected(self.compared(word, a, b), a, b)

    def word_len(self, array: Value) -> Value:
        return Value(INTEGER, array.leaves[1:2])

    def word_load(self, array: Value, place: Value) -> Value:
        return self.loaded(array.type.element, self.flat_address(array, place))

    def word_store(self, array: Value, place: Value, value: Value) -> Value:
        self.put(array.type.element, self.flat_address(array, place), value)
        return Value((), ())

    def flat_address(self, array: Value, place: Value) -> str:
        stored = STORED[array.type.element]
        return self.new(f"getelementptr inbounds {stored}, ptr {array.leaves[0]}, i64 {self.scalar(place, INTEGER)}")

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
        if key not in self.module.written:
            self.module.written[key] = exponential(self.real)
        return self.called(self.module.written[key], [self.converted(x, self.real)])


def exponential(real: str) -> Function:
    """exp(x), with the same bits on every device."""
    numbers = EXPONENTIALS["float64" if real == "double" else "float32"]
    bits, bias = (64, 1023) if real == "double" else (32, 127)
    lines = []

    def new(text: str) -> str:
        lines.append(f"  %t{len(lines)} = {text}")
        return f"%t{len(lines) - 1}"

    def do(word: str, a: str, b: str | float) -> str:
        return new(f"{word} {real} {a}, {b if isinstance(b, str) else number(b, real)}")

    lowest, highest = number(numbers.lowest, real), number(numbers.highest, real)
    x = new(f"select i1 {do('fcmp olt', '%x', lowest)}, {real} {lowest}, {real} %x")
    x = new(f"select i1 {do('fcmp ogt', x, highest)}, {real} {highest}, {real} {x}")
    shifted = do("fadd", do("fmul", x, numbers.per_two), numbers.shift)
    n = do("fsub", shifted, numbers.shift)
    r = do("fsub", do("fsub", x, do("fmul", n, numbers.high)), do("fmul", n, numbers.low))
    first, *others = numbers.coefficients
    total = number(first, real)
    for coefficient in others:
        total = do("fadd", do("fmul", total, r), coefficient)
    # 2^n: n stands in the lowest bits of `shifted`
    exponent = new(f"shl i{bits} {new(f'bitcast {real} {shifted} to i{bits}')}, {numbers.mantissa}")
    power = new(f"bitcast i{bits} {new(f'add i{bits} {exponent}, {bias << numbers.mantissa}')} to {real}")
    result = do("fmul", total, power)
    head = f"define internal {real} @exponential({real} %x) nounwind alwaysinline {{"
    return Function("exponential", real, "\n".join([head, *lines, f"  ret {real} {result}", "}", ""]))
