"""The first writer: a driver and all the formulas it reaches -> the LLVM IR of one module, from folded trees.

What a driver is called with fixes the types of its parameters; from there types follow the assignments, and each
function is written once for each list of types it is called with. Integers have 64 bits; an integer with a real of any
size makes a double. A name keeps its type. Nothing here reassociates or contracts arithmetic: the bits are those of the
text, on any machine.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from distfsi.device.emit import Emission
from distfsi.device.fold import Bound, Source, stored_names
from distfsi.device.llvm_types import (
    BOOL,
    INTEGER,
    REALS,
    Array,
    Function,
    Slot,
    Type,
    Value,
    joined,
    leaf_types,
    number,
    packed_type,
    parts_of,
)
from distfsi.device.llvm_values import DECLARED, Values, exponential

ARITHMETIC = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
BITWISE = {ast.BitAnd: "and", ast.BitOr: "or", ast.LShift: "shl", ast.RShift: "ashr"}
COMPARISONS = {ast.Eq: "eq", ast.NotEq: "ne", ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge"}
LOOPS = (ast.For, ast.While)


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
    name = emission.root(driver)
    module = Module(emission.functions, REALS[real])
    return module, module.function(name, types)


class Writer(Values):
    """Writes one folded function."""

    def __init__(self, module: Module, source: Source, tree: ast.FunctionDef):
        super().__init__(source, module.real)
        self.module, self.tree = module, tree
        self.slots: list[str] = []  # what stands at the start of the function
        self.scopes: list[dict[str, Value | Slot]] = []
        self.loops: list[tuple[str, str]] = []  # where `continue` and `break` go
        self.owned: list[str] = []  # memory to free
        self.returns: Type | None = None
        self.returned = False
        branches = any(isinstance(node, (ast.If, *LOOPS)) for node in ast.walk(tree))
        times = Counter(name for name, _ in stored_names(tree, ())) + Counter(a.arg for a in tree.args.args)
        self.changing = {name for name, n in times.items() if n > 1} if branches else set()

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
        text = "\n".join([f"; {self.source.location}", head, "entry:", *self.slots, *self.lines, "}", ""])
        return Function(name, self.returns, text)

    # ---- names -------------------------------------------------------------------------------------------------------

    def found(self, name: str) -> Value | Slot | None:
        return next((scope[name] for scope in reversed(self.scopes) if name in scope), None)

    def assign(self, name: str, value: Value) -> None:
        """Give a name a value; the first assignment in reach declares it."""
        if name not in self.changing:
            self.scopes[-1][name] = value
            return
        variable = self.found(name)
        if variable is None:
            addresses = [f"%{self.name('s')}" for _ in value.leaves]
            pairs = zip(addresses, leaf_types(value.type), strict=True)
            self.slots += [f"  {address} = alloca {kind}" for address, kind in pairs]
            variable = self.scopes[-1][name] = Slot(value.type, tuple(addresses))
        if isinstance(variable, Value):
            raise self.refuse(f"{name} runs over a range, but gets another value")
        if self.common(variable.type, value.type) != variable.type:
            raise self.refuse(f"{name} gets a value of another type")
        value = self.converted(value, variable.type)
        for kind, leaf, address in zip(leaf_types(variable.type), value.leaves, variable.addresses, strict=True):
            self.line(f"store {kind} {leaf}, ptr {address}")

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
            self.put(array.type.element, self.address(array, self.indices(target.slice)), value)

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
            return self.item(whole, node.slice.value)
        *others, chosen = parts_of(whole)
        index = self.integer(node.slice)
        for k, part in reversed(list(enumerate(others))):
            chosen = self.selected(self.new(f"icmp eq i64 {index}, {k}"), part, self.converted(chosen, part.type))
        return chosen

    def indices(self, node: ast.expr) -> list[str]:
        return [self.integer(index) for index in (node.elts if isinstance(node, ast.Tuple) else [node])]

    def value_of_call(self, node: ast.Call) -> Value:
        values = [self.value(argument) for argument in node.args]
        word = getattr(self, f"word_{node.func.id}", None)
        if word is not None:
            return word(*values)
        function = self.module.function(node.func.id, tuple(value.type for value in values))
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
        if key not in self.module.written:
            self.module.written[key] = exponential(self.real)
        return self.called(self.module.written[key], [self.converted(x, self.real)])
