"""Functions of the kernel subset, and what they are emitted as."""

import ast
import math

import pytest

from distfsi.device import cpu, emit
from distfsi.device.llvm_text import module_of
from distfsi.device.llvm_types import REALS
from distfsi.device.markers import driver, load, row, store
from distfsi.device.native import Native
from distfsi.formulas.symbols import Symbol, chosen

exp, floor, log, pow, sqrt = math.exp, math.floor, math.log, math.pow, math.sqrt

N = Symbol("a number of things")
WEIGHTS = Symbol("one weight per thing")
SWITCH = Symbol("a truth value")
GAMMA = Symbol("a constant that each material has")
OPEN = Symbol("a constant that no scene gives")
HALF = 0.5
INFINITE = math.inf
first_material = chosen("first_material", "x -> y")
second_material = chosen("second_material", "x -> y")
nobody = chosen("nobody", "no scene binds this")


def types_of(function, real="float64"):
    """Of reals only."""
    return (REALS[real],) * function.__code__.co_argcount


def text_of(function, constants=None, bindings=None, real="float64"):
    constants, bindings = constants or {}, bindings or {}
    types = types_of(function, real) + (REALS[real],) * len(Native(function, constants, bindings, real).numbers())
    return module_of(function, constants, bindings, real, types)[0].text()


def body_of(function, **constants):
    """The emitted function without its signature, literals in place."""
    emission = emit.Emission(constants, {})
    callee = emission.add(function)
    return [ast.unparse(statement) for statement in emission.functions[callee.name][1].body]


def both(function, *arguments, constants=None, bindings=None):
    """The value, after checking that plain Python and the compiled module agree."""
    constants, bindings = constants or {}, bindings or {}
    compiled = getattr(cpu.build([function], constants, bindings), function.__name__)(*arguments)
    plain = emit.plain(function, constants, bindings)(*arguments)
    assert compiled == pytest.approx(plain, rel=1e-15, abs=0.0, nan_ok=True)
    return compiled


def constants_are_folded(x):
    scale = 2.0 * HALF + 3.0
    return x * scale - 4.0 / 8.0


def early_return(x):
    if SWITCH:
        return 1.0
    return nobody(x)


def three_arguments(a, b, c):
    return a + 10.0 * b + 100.0 * c


def scaled(x):
    return GAMMA * x


def material(x):
    return scaled(x) + GAMMA


def two_materials(x):
    return first_material(x) - second_material(x)


def cubed(x):
    return x * x * x


@row
def exponentials(A, B, n):
    for i in range(n):
        store(B, i, exp(load(A, i)))


@driver
def exponentials_of(A, B):
    exponentials(A, B, A.size)
