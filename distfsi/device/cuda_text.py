"""The second writer: a driver and all the formulas it reaches -> CUDA C, from the folded trees of device/llvm_text.py.

A driver that is a loop `for i in range(begin, end):` over independent items becomes a kernel with one thread per item.
The text is C++20 for NVRTC and, with device/host.h in front, for a compiler of the host; device/runtime.h gives it its
types. What a driver is called with fixes the types of its kernel's parameters, as it does on the CPU.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.device.cuda_writer import Writer, number, safe
from distfsi.device.emit import Emission, callees_first, number_names
from distfsi.device.exponential import EXPONENTIALS
from distfsi.device.markers import ByHand
from distfsi.device.source import Bound, Callee, parameters_of
from distfsi.formulas.subset import Varying
from distfsi.narrowing import of_kind

C_TYPES = {"float64": "double", "float32": "float", "bool": "bool", "int64": "long long", "int32": "int"}
C_TYPES |= {"int8": "signed char", "uint8": "unsigned char"}
THREADS = 128  # in a block, of kernels with one thread per item


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


def kernel_text(
    driver: Callable[..., Any],
    constants: Mapping[str, object],
    bindings: Mapping[str, Bound | type],
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
    driver: Callable[..., Any],
    constants: Mapping[str, object],
    bindings: Mapping[str, Bound | type],
    real: str,
    arguments: Sequence[object],
) -> str:
    """The CUDA C of a kernel whose loops are written by hand, with the formulas and numbers that it is made for."""
    written, names = by_hand(driver), parameters_of(driver)
    emission, formulas = formulas_by_hand(driver, constants, bindings)
    scalars = number_names(len(emission.numbers))
    integers = {name: int(value) for name, value in constants.items() if isinstance(value, int)}
    integers |= written.block(constants, dict(zip(names, arguments, strict=False)))
    lines = [f"constexpr int {name} = {value:d};" for name, value in integers.items()]
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


def by_hand(driver: Callable[..., Any]) -> ByHand:
    """How a driver's kernel is written by hand."""
    return of_kind(ByHand, getattr(driver, "__by_hand__", None))


def formulas_by_hand(
    driver: Callable[..., Any], constants: Mapping[str, object], bindings: Mapping[str, Bound | type]
) -> tuple[Emission, dict[str, Callee]]:
    """The formulas that a hand-written kernel calls, as far as a scene binds them, by the names in which it does."""
    emission, names = Emission(constants, bindings), [n for n in by_hand(driver).formulas if n in bindings]
    return emission, {n: emission.add_bound(n) for n in names}


def numbers_of(
    driver: Callable[..., Any], constants: Mapping[str, object], bindings: Mapping[str, Bound | type]
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
