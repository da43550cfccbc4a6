"""What can be done with values in LLVM IR: conversions, choices, arrays and the words of the subset."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from distfsi.device.exponential import EXPONENTIALS
from distfsi.device.llvm_types import (
    BOOL,
    INTEGER,
    REALS,
    SHORT,
    STORED,
    Array,
    Function,
    Type,
    Value,
    array_of,
    joined,
    leaf_types,
    number,
    packed_type,
    parts_of,
)
from distfsi.device.source import NotInSubset, Source
from distfsi.narrowing import of_kind

# what modules may call; `fabs` and `abs` are those of reals and integers
DECLARED = [f"declare double @llvm.{word}.f64(double)" for word in ("sqrt", "log", "fabs", "floor")]
DECLARED += [f"declare float @llvm.{word}.f32(float)" for word in ("sqrt", "log", "fabs", "floor")]
DECLARED += ["declare double @llvm.pow.f64(double, double)", "declare float @llvm.pow.f32(float, float)"]
DECLARED += ["declare i64 @llvm.abs.i64(i64, i1)", "declare noalias ptr @malloc(i64)", "declare void @free(ptr)"]


class Values:
    """The text of a function, line by line."""

    def __init__(self, source: Source, real: str):
        self.source, self.real = source, real
        self.lines: list[str] = []
        self.block, self.ended, self.count = "entry", False, 0

    def refuse(self, why: str) -> NotInSubset:
        return NotInSubset(f"{self.source.location}, {self.source.function.__name__}: {why}")

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

    # ---- types -------------------------------------------------------------------------------------------------------

    def common(self, a: Type, b: Type) -> Type:
        """The type that holds values of both."""
        if a == b:
            return a
        if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
            return tuple(map(self.common, a, b))
        if not (isinstance(a, str) and isinstance(b, str)):
            raise self.refuse(f"one of two values is {a}, the other {b}")
        return INTEGER if {a, b} <= {BOOL, SHORT, INTEGER} else "double"

    def converted(self, value: Value, kind: Type) -> Value:
        """The value in another type."""
        if value.type == kind:
            return value
        if isinstance(kind, tuple):
            pairs = zip(parts_of(value), kind, strict=True)
            return joined([self.converted(part, part_kind) for part, part_kind in pairs])
        return Value(kind, (self.scalar(value, of_kind(str, kind)),))

    def cast(self, leaf: str, old: str, new: str) -> str:
        if old == new:
            return leaf
        if SHORT in (old, new):
            whole = self.new(f"sext i32 {leaf} to i64") if old == SHORT else self.cast(leaf, old, INTEGER)
            return self.cast(whole, INTEGER, new) if old == SHORT else self.new(f"trunc i64 {whole} to i32")
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

    # ---- choices -----------------------------------------------------------------------------------------------------

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

    def compared(self, word: str, a: Value, b: Value) -> str:
        kind = of_kind(str, self.common(a.type, b.type))
        x, y = self.scalar(a, kind), self.scalar(b, kind)
        if kind in (BOOL, SHORT, INTEGER):
            return self.new(f"icmp {word if word in ('eq', 'ne') else 's' + word} {kind} {x}, {y}")
        return self.new(f"fcmp {'une' if word == 'ne' else 'o' + word} {kind} {x}, {y}")

    def smaller(self, word: str, a: Value, b: Value) -> Value:
        kind = self.common(a.type, b.type)
        a, b = self.converted(a, kind), self.converted(b, kind)
        return self.selected(self.compared(word, a, b), a, b)

    # ---- arrays ------------------------------------------------------------------------------------------------------

    def item(self, whole: Value, k: int) -> Value:
        return self.get(whole, [str(k)]) if isinstance(whole.type, Array) else parts_of(whole)[k]

    def address(self, array: Value, indices: Sequence[str]) -> str:
        data, *lengths = array.leaves
        flat = indices[0]
        for index, length in zip([*indices[1:], *["0"] * (len(lengths) - len(indices))], lengths[1:], strict=True):
            flat = self.new(f"mul i64 {flat}, {length}")
            flat = flat if index == "0" else self.new(f"add i64 {flat}, {index}")
        return self.new(f"getelementptr inbounds {STORED[array_of(array).element]}, ptr {data}, i64 {flat}")

    def get(self, array: Value, indices: Sequence[str]) -> Value:
        """A value of an array, or with fewer indices than axes the array of the rest."""
        element, axes = array_of(array).element, array_of(array).axes
        if len(indices) < axes:
            rest = array.leaves[1 + len(indices) :]
            return Value(Array(element, axes - len(indices)), (self.address(array, indices), *rest))
        return self.loaded(element, self.address(array, indices))

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

    def flat_address(self, array: Value, index: Value) -> str:
        stored = STORED[array_of(array).element]
        return self.new(f"getelementptr inbounds {stored}, ptr {array.leaves[0]}, i64 {self.scalar(index, INTEGER)}")

    # ---- arithmetic and calls ----------------------------------------------------------------------------------------

    def called(self, function: Function, values: Sequence[Value]) -> Value:
        whole = joined(values)
        operands = [f"{kind} {leaf}" for kind, leaf in zip(leaf_types(whole.type), whole.leaves, strict=True)]
        packed = packed_type(function.returns)
        call = f"call {packed} @{function.name}({', '.join(operands)})"
        if packed == "void":
            self.line(call)
            return Value((), ())
        returns: Type = () if function.returns is None else function.returns
        result, count = self.new(call), len(leaf_types(returns))
        leaves = [result] if count == 1 else [self.new(f"extractvalue {packed} {result}, {k}") for k in range(count)]
        return Value(returns, tuple(leaves))

    def mathematics(self, word: str, *values: Value) -> Value:
        """A function of reals that LLVM knows."""
        kind = values[0].type
        for value in values[1:]:
            kind = self.common(kind, value.type)
        kind = "double" if kind in (BOOL, INTEGER) else of_kind(str, kind)
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

    def word_int32(self, x: Value) -> Value:
        return self.converted(x, SHORT)

    def word_real(self, x: Value) -> Value:
        return self.converted(x, self.real)

    def word_min(self, a: Value, b: Value) -> Value:
        """a if a < b else b, of NaN and a number the second."""
        return self.smaller("lt", a, b)

    def word_max(self, a: Value, b: Value) -> Value:
        """a if a > b else b, of NaN and a number the second."""
        return self.smaller("gt", a, b)

    def word_len(self, array: Value) -> Value:
        return Value(INTEGER, array.leaves[1:2])

    def word_load(self, array: Value, index: Value) -> Value:
        return self.loaded(array_of(array).element, self.flat_address(array, index))

    def word_store(self, array: Value, index: Value, value: Value) -> Value:
        self.put(array_of(array).element, self.flat_address(array, index), value)
        return Value((), ())


def exponential(real: str) -> Function:
    """exp(x), with the same bits on every device."""
    numbers = EXPONENTIALS["float64" if real == "double" else "float32"]
    bits, bias = (64, 1023) if real == "double" else (32, 127)
    lines: list[str] = []

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
