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
from typing import Any

from distfsi.device.emit import Emission
from distfsi.device.llvm_expressions import Expressions
from distfsi.device.llvm_types import (
    INTEGER,
    REALS,
    Function,
    Slot,
    Type,
    Value,
    array_of,
    leaf_types,
    packed_type,
)
from distfsi.device.llvm_values import DECLARED
from distfsi.device.source import Bound, Source
from distfsi.device.trees import called, name_of, stored_names
from distfsi.narrowing import of_kind, present

LOOPS = (ast.For, ast.While)


@dataclass
class Module:
    """The functions that a driver reaches, each for the types it is called with."""

    folded: Mapping[str, tuple[Source, ast.FunctionDef]]
    real: str
    written: dict[tuple[object, ...], Function] = field(default_factory=dict)
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
    driver: Callable[..., Any],
    constants: Mapping[str, object],
    bindings: Mapping[str, Bound | type],
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


class Writer(Expressions):
    """Writes one folded function."""

    def __init__(self, module: Module, source: Source, tree: ast.FunctionDef):
        super().__init__(module, source)
        self.module, self.tree = module, tree
        self.loops: list[tuple[str, str]] = []  # where `continue` and `break` go
        self.returns: Type | None = None
        self.returned = False
        branches = any(isinstance(node, (ast.If, *LOOPS)) for node in ast.walk(tree))
        times = Counter(name for name, _ in stored_names(tree, ())) + Counter(a.arg for a in tree.args.args)
        self.changing = {name for name, n in times.items() if n > 1} if branches else set()

    def function(self, name: str, types: tuple[Type, ...]) -> Function:
        """The function as `name`, for arguments of such types."""
        self.scopes = [{}]
        parameters: list[str] = []
        alias = "noalias " if self.source.kind == "row" else ""
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

    # ---- statements --------------------------------------------------------------------------------------------------

    def statements(self, body: Sequence[ast.stmt]) -> None:
        for statement in body:
            if self.ended:
                return
            getattr(self, f"write_{type(statement).__name__.lower()}")(statement)

    def nested(self, body: Sequence[ast.stmt], **names: Value | Slot) -> None:
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
            value = self.converted(present(value), self.returns)
        self.give_back(value)

    def give_back(self, value: Value | None) -> None:
        for memory in self.owned:
            self.line(f"call void @free(ptr {memory})")
        leaves, packed = () if value is None else value.leaves, packed_type(self.returns)
        if value is not None and len(leaves) > 1:
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
            item = of_kind(ast.Subscript, target)
            array = self.value(item.value)
            self.put(array_of(array).element, self.address(array, self.indices(item.slice)), value)

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
        if not (isinstance(node.iter, ast.Call) and called(node.iter) == "range"):
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
        self.nested(node.body, **{name_of(node.target): Value(INTEGER, (i,))})
        self.loops.pop()
        self.go(next_)
        self.start(next_)
        self.line(f"{following} = add nsw i64 {i}, {step}")
        mark = f", !llvm.loop {self.module.loop()}" if self.source.kind == "row" else ""
        self.line(f"br label %{head}{mark}")
        self.start(after)
