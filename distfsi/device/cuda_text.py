"""The second writer: a driver and all the formulas it reaches -> CUDA C, from the folded trees of device/llvm_text.py.

A driver that is a loop `for i in range(begin, end):` over independent items becomes a kernel with one thread per item.
The text is C++20 for NVRTC and, with device/host.h in front, for a compiler of the host; device/runtime.h gives it its
types. What a driver is called with fixes the types of its kernel's parameters, as it does on the CPU.
"""

from __future__ import annotations

import ast
import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from distfsi.device.emit import Emission, callees_first, number_names
from distfsi.device.exponential import EXPONENTIALS
from distfsi.device.fold import Bound, Callee, NotInSubset, Source, parameters_of
from distfsi.formulas.subset import Varying

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
C_TYPES = {"float64": "double", "float32": "float", "bool": "bool", "int64": "long long", "int32": "int"}
C_TYPES |= {"int8": "signed char", "uint8": "unsigned char"}
THREADS = 128  # in a block, of kernels with one thread per item
TAKEN = frozenset(  # words of C++ and of device/runtime.h
    """alignas and asm auto bool case catch char class const default delete do double enum explicit export extern false
    float friend goto inline int integer item length long mutable namespace new not operator or pack private protected
    public real register requires short signed sizeof static struct switch template this throw true try typedef typename
    union unsigned using virtual void volatile xor load store""".split()  # noqa: SIM905
) | {*WORDS.values()}


@cache
def runtime_text(real: str) -> str:
    """device/runtime.h for one real type, with the numbers of the exponential."""
    numbers = EXPONENTIALS[real]
    names = ("lowest", "highest", "per_two", "shift", "high", "low")
    lines = [f"constexpr real EXP_{name.upper()} = {number(getattr(numbers, name), real)};" for name in names]
    coefficients = ", ".join(number(c, real) for c in numbers.coefficients)
    lines.append(f"__device__ constexpr real EXP_COEFFICIENTS[] = {{{coefficients}}};")
    head = f"typedef {C_TYPES[real]} real;\n"
    return head + (Path(__file__).parent / "runtime.h").read_text().replace("// EXP_NUMBERS", "\n".join(lines))


def number(value: float, real: str) -> str:
    """A literal of the real type."""
    if math.isnan(value) or math.isinf(value):
        raise NotInSubset(f"{value} has no literal in C")
    return f"{np.float32(value)!s}f" if real == "float32" else repr(float(value))


def kernel_text(
    driver: Callable,
    constants: Mapping[str, object],
    bindings: Mapping[str, Bound],
    real: str,
    arguments: Sequence[object],
) -> str:
    """The CUDA C of a driver's kernel `NAME_kernel(begin, end, …)`, for arguments like `arguments`, which are flat, the
    numbers of the scene behind them.

    An array becomes its address and its shape; all others are passed by value. Raises NotInSubset.
    """
    emission = Emission(constants, bindings)
    emission.root(driver)
    *callees, (source, tree) = callees_first(emission.functions)
    functions = [Writer(s, real).function(t) for s, t in callees] + [Writer(source, real).driver(tree)]
    names = [argument.arg for argument in tree.args.args[2:]]
    values = [value_of(safe(name), argument) for name, argument in zip(names, arguments, strict=True)]
    shell = (
        f'extern "C" __global__ void __launch_bounds__(THREADS, 1)\n'
        f"{driver.__name__}_kernel({parameters(names, arguments)})\n"
        f"{{\n    {driver.__name__}({', '.join(['integer(begin)', 'integer(end)', *values])});\n}}"
    )
    return in_namespace(real, [f"constexpr int THREADS = {THREADS};", *functions, shell])


def text_by_hand(
    driver: Callable,
    constants: Mapping[str, object],
    bindings: Mapping[str, Bound],
    real: str,
    arguments: Sequence[object],
) -> str:
    """The CUDA C of a kernel whose loops are written by hand, with the formulas and numbers that it is made for."""
    written, names = driver.__by_hand__, parameters_of(driver)
    emission, formulas = formulas_by_hand(driver, constants, bindings)
    scalars = number_names(len(emission.numbers))
    integers = {name: value for name, value in constants.items() if type(value) in (int, bool)}
    integers |= written.block(constants, dict(zip(names, arguments, strict=False)))
    lines = [f"constexpr int {name} = {int(value)};" for name, value in integers.items()]
    lines += [f"#define HAS_{name}" for name in integers]
    lines += [
        f"constexpr real HALF = {number(0.5, real)};",
        f"#define PARAMETERS {parameters([*names, *scalars], arguments)}",
        f"#define NUMBERS pack({', '.join(scalars)})",
    ]
    functions = callees_first(emission.functions, [callee.name for callee in formulas.values()])
    parts = [Writer(source, real).function(tree) for source, tree in functions]
    for name, callee in formulas.items():
        numbers = ", numbers" if callee.takes_numbers else ""
        call = f"return {callee.name}(values...{numbers});"
        parts.append(f"DEVICE auto {name}(const auto &numbers, auto... values)\n{{\n    {call}\n}}")
    file = Path(inspect.getfile(driver)).parent / written.file
    return in_namespace(real, ["\n".join(lines), "\n\n".join(parts), file.read_text()])


def formulas_by_hand(
    driver: Callable, constants: Mapping[str, object], bindings: Mapping[str, Bound]
) -> tuple[Emission, dict[str, Callee]]:
    """The formulas that a hand-written kernel calls, as far as a scene binds them, by the names in which it does."""
    emission, names = Emission(constants, bindings), [n for n in driver.__by_hand__.formulas if n in bindings]
    return emission, {n: emission.add_bound(n) for n in names}


def numbers_of(
    driver: Callable, constants: Mapping[str, object], bindings: Mapping[str, Bound]
) -> tuple[float | Varying, ...]:
    """What the scene measures, in the order in which the driver's kernel gets it. Raises NotInSubset."""
    if hasattr(driver, "__by_hand__"):
        emission, _ = formulas_by_hand(driver, constants, bindings)
    else:
        emission = Emission(constants, bindings)
        emission.root(driver)
    return tuple(emission.numbers.values())


def in_namespace(real: str, parts: Sequence[str]) -> str:
    """A whole module text: what the emitted parts need, then the parts."""
    return "\n\n".join([runtime_text(real).rstrip(), "namespace distfsi {", *parts, "}  // namespace distfsi"]) + "\n"


def parameters(names: Sequence[str], arguments: Sequence[object]) -> str:
    """Declarations of a kernel's parameters: of each array its address and lengths, of all else the value."""
    declared = ["long long begin", "long long end"]
    for name, argument in zip(map(safe, names), arguments, strict=True):
        kind, dimensions = c_type(argument), getattr(argument, "ndim", 0)
        declared.append(f"{kind} {'*' if dimensions else ''}{name}")
        declared += [f"long long {name}_{axis}" for axis in range(dimensions)]
    return ", ".join(declared)


def value_of(name: str, argument: object) -> str:
    """What the parameters of an argument are made into."""
    kind, dimensions = c_type(argument), getattr(argument, "ndim", 0)
    if dimensions:
        lengths = ", ".join(f"{name}_{axis}" for axis in range(dimensions))
        return f"Array<{kind}, {dimensions}>{{{name}, {{{lengths}}}}}"
    return f"integer({name})" if kind in ("long long", "int") else name


def c_type(argument: object) -> str:
    """The type of a number or of the values of an array."""
    return C_TYPES[str(dtype_of(argument))]


def dtype_of(argument: object) -> np.dtype:
    """The type of an array or a number."""
    dtype = getattr(argument, "dtype", None)
    return np.asarray(argument).dtype if dtype is None else dtype


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
        if bounds != f"range({wanted[0]}, {wanted[1]})":
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
            return [line for name, item in pairs for line in self.workspace(name.id, item)]
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
        name = safe(target.id)
        if any(name in scope for scope in self.scopes):
            return [f"assign({name}, {value});"]
        self.scopes[-1].add(name)
        return [f"auto {name} = {value};"]

    @staticmethod
    def is_workspace(node: ast.expr) -> bool:
        return isinstance(node, ast.Call) and node.func.id == "workspace"

    def workspace(self, name: str, call: ast.Call) -> list[str]:
        if not isinstance(call.args[0], ast.Constant):
            raise self.refuse("the size of a workspace must be fixed by the scene")
        size, name = call.args[0].value, safe(name)
        self.scopes[-1].add(name)
        return [f"real {name}_values[{size}];", f"const Array<real, 1> {name}{{{name}_values, {{{size}}}}};"]

    def if_lines(self, node: ast.If) -> list[str]:
        lines = [f"if ({self.expression(node.test)})", *self.nested(node.body)]
        return [*lines, "else", *self.nested(node.orelse)] if node.orelse else lines

    def while_lines(self, node: ast.While) -> list[str]:
        return [f"while ({self.expression(node.test)})", *self.nested(node.body)]

    def for_lines(self, node: ast.For) -> list[str]:
        name = safe(node.target.id)
        if any(name in scope for scope in self.scopes):
            raise self.refuse(f"{name} runs over a range, but has a value already")
        if not (isinstance(node.iter, ast.Call) and node.iter.func.id == "range"):
            raise self.refuse("loops run over a range")
        bounds = [self.expression(bound) for bound in node.iter.args]
        first, end = bounds[:2] if len(bounds) > 1 else ("integer(0)", bounds[0])
        step, sign = "integer(1)", "<"
        if len(bounds) == 3:
            if not isinstance(node.iter.args[2], ast.Constant):
                raise self.refuse("the step of a range must be fixed by the scene")
            step, sign = bounds[2], "<" if node.iter.args[2].value > 0 else ">"
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
        if math.isinf(node.value):
            return "infinity()" if node.value > 0.0 else "-infinity()"
        return number(node.value, self.real)

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
        return f"{WORDS.get(node.func.id, node.func.id)}({', '.join(map(self.expression, node.args))})"

    def attribute(self, node: ast.Attribute) -> str:
        return f"{self.expression(node.value)}.{node.attr}" + ("()" if node.attr == "size" else "")

    def subscript(self, node: ast.Subscript) -> str:
        value = self.expression(node.value)
        if isinstance(node.value, ast.Attribute):
            return f"{value}[{node.slice.value}]"
        if isinstance(node.slice, ast.Constant):
            return f"item<{node.slice.value}>({value})"
        return f"{value}({self.indices(node.slice)})"

    def indices(self, node: ast.expr) -> str:
        indices = node.elts if isinstance(node, ast.Tuple) else [node]
        if any(isinstance(index, ast.Constant) and index.value < 0 for index in indices):
            raise self.refuse("an index below zero")
        return ", ".join(str(i.value) if isinstance(i, ast.Constant) else self.expression(i) for i in indices)
