"""The formula subset: what each construct is emitted as, what is refused, and where compiled modules are kept."""

import ast
import math
import subprocess
import sys
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from distfsi.device import cpu, emit
from distfsi.device.fingerprint import fingerprint
from distfsi.device.host import HostKernel
from distfsi.device.kernel import Kernel
from distfsi.device.llvm_text import module_of
from distfsi.device.llvm_types import REALS, Array
from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.device.native import Native
from distfsi.device.source import Bound, NotInSubset
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import Symbol, chosen
from launch import ROOT

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


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path_factory.getbasetemp() / "kernels"))


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


# ---- constructs ------------------------------------------------------------------------------------------------------


def constants_are_folded(x):
    scale = 2.0 * HALF + 3.0
    return x * scale - 4.0 / 8.0


def identities(x, y):
    return (x + 0.0, 0.0 + x, x - 0.0, 0.0 - x, x * 0.0, 0.0 * x, x * 1.0, 1.0 * x, 0.0 / x, x / 1.0, x - y)


def branches(x):
    if SWITCH and N > 1:
        y = x + 1.0
    elif SWITCH or N == 7:
        y = x + 2.0
    else:
        y = x + 3.0
    return y if not SWITCH else -y


def early_return(x):
    if SWITCH:
        return 1.0
    return nobody(x)


def unrolled_loop(x):
    total = x
    for d in static_range(1, N):
        total = total + WEIGHTS[d] * x
    return total


def generators(x):
    powers = tuple(x * WEIGHTS[d] for d in static_range(N))
    weighted = sum(powers[d] for d in static_range(N))
    pairs = sum(sum(WEIGHTS[i] * powers[j] for j in static_range(i)) for i in static_range(N))
    return (weighted, *(powers[d] for d in static_range(N)), *(x, 2.0 * x), pairs)


def empty_sum(x):
    return x + sum(WEIGHTS[d] * x for d in static_range(0))


def weightless(x):
    return x + sum(WEIGHTS[d] * x for d in static_range(N))


def tuple_constants(x):
    a, b = WEIGHTS[0], WEIGHTS[-1]
    return x * a + (1.0, 2.0, 3.0)[1] * b


def three_arguments(a, b, c):
    return a + 10.0 * b + 100.0 * c


def star_in_a_call(x):
    return three_arguments(*(x * WEIGHTS[d] for d in static_range(3)))


def constant_pair(x):
    return (-GAMMA * HALF, 0.0)


def calls_a_constant(x):
    level, slope = constant_pair(x)
    return x * slope + level


def drops_a_constant(x):
    level, slope = constant_pair(x)
    return x + slope


def scaled(x):
    return GAMMA * x


def material(x):
    return scaled(x) + GAMMA


def two_materials(x):
    return first_material(x) - second_material(x)


def choices(a, b):
    smaller, larger = min(a, b), max(a, b)
    return (smaller, larger, a if a < b and a > 0.0 or not b >= 0.0 else b, abs(a))


def mathematics(x):
    return (sqrt(x), exp(-x), log(x), pow(x, 0.3))


def test_constants_are_folded():
    assert body_of(constants_are_folded) == ["return x * 4.0 - 0.5"]
    assert both(constants_are_folded, 3.0) == 11.5


def test_arithmetic_with_zero_and_one_vanishes():
    assert body_of(identities) == ["return (x, x, x, -x, 0.0, 0.0, x, x, 0.0, x, x - y)"]
    both(identities, 3.0, 4.0)


@pytest.mark.parametrize(
    ("switch", "n", "lines"),
    [
        (True, 2, ["y = x + 1.0", "return -y"]),
        (True, 1, ["y = x + 2.0", "return -y"]),
        (False, 7, ["y = x + 2.0", "return y"]),
    ],
)
def test_branches_on_constants_are_resolved(switch, n, lines):
    assert body_of(branches, SWITCH=switch, N=n) == lines
    both(branches, 0.3, constants={"SWITCH": switch, "N": n})


def test_what_follows_a_return_is_not_emitted():
    assert body_of(early_return, SWITCH=True) == ["return 1.0"]


def test_static_loops_are_unrolled():
    weights = (0.5, 1.0, 0.0)
    lines = ["total = x", "total = total + numbers_[0] * x", "total = total", "return total"]
    assert body_of(unrolled_loop, N=3, WEIGHTS=weights) == lines
    assert both(unrolled_loop, 2.0, constants={"N": 3, "WEIGHTS": weights}) == 4.0


def test_generators_and_stars_are_written_out():
    constants = {"N": 3, "WEIGHTS": (1.0, 2.0, 4.0)}
    assert both(generators, 3.0, constants=constants) == (21.0, 3.0, 6.0, 12.0, 3.0, 6.0, 42.0)
    assert both(star_in_a_call, 1.0, constants=constants) == 421.0
    nodes = list(ast.walk(ast.parse("\n".join(body_of(generators, **constants)[:-1]))))
    assert not [node for node in nodes if isinstance(node, (ast.For, ast.GeneratorExp, ast.Starred))]


def test_sums_of_nothing_vanish():
    assert body_of(empty_sum) == ["return x"]
    assert body_of(weightless, N=2, WEIGHTS=(0.0, 0.0)) == ["return x"]


def test_tuples_of_constants_can_be_indexed():
    assert body_of(tuple_constants, WEIGHTS=(3.0, 5.0)) == ["return x * numbers_[0] + numbers_[1]"]
    assert both(tuple_constants, 1.0, constants={"WEIGHTS": (3.0, 5.0)}) == 13.0


def test_a_callee_that_returns_a_constant_is_inlined():
    constants = {"GAMMA": 4.0}
    assert body_of(calls_a_constant, **constants) == ["return numbers_[0]"]
    assert both(calls_a_constant, 1.0, constants=constants) == -2.0
    assert "constant_pair" not in text_of(calls_a_constant, constants)


def test_numbers_that_vanish_are_not_given():
    assert both(drops_a_constant, 1.0, constants={"GAMMA": 4.0}) == 1.0


def test_bound_formulas_keep_their_own_constants():
    """Both materials use one formula, which uses a helper: each gets them under names and with constants of its own."""
    bindings = {
        "first_material": Bound(material, {"GAMMA": 3.0}),
        "second_material": Bound(material, {"GAMMA": 5.0}),
    }
    assert both(two_materials, 2.0, bindings=bindings) == 9.0 - 15.0
    text = text_of(two_materials, {}, bindings)
    for name in (
        "material__first_material",
        "material__second_material",
        "scaled__first_material",
        "scaled__second_material",
    ):
        assert text.count(f"define internal double @{name}.") == 1


def test_a_formula_used_twice_is_emitted_once():
    bindings = {"first_material": Bound(scaled), "second_material": Bound(scaled)}
    text = text_of(two_materials, {"GAMMA": 3.0}, bindings)
    assert both(two_materials, 2.0, constants={"GAMMA": 3.0}, bindings=bindings) == 0.0
    assert text.count("@two_materials.0(") == text.count("define internal double @scaled__first_material.") == 1


def test_choices_mean_the_same_as_in_python():
    assert both(choices, -1.0, 2.0) == (-1.0, 2.0, 2.0, 1.0)
    assert both(choices, 1.0, 2.0) == (1.0, 2.0, 1.0, 1.0)
    assert both(choices, 1.0, -2.0) == (-2.0, 1.0, 1.0, 1.0)


def test_minimum_and_maximum_take_the_second_unless_the_first_wins():
    """Also with NaN, on every device: a if a < b else b."""
    nan = math.nan
    smaller, larger, *_ = both(choices, nan, 1.0)
    assert smaller == larger == 1.0
    smaller, larger, *_ = both(choices, 1.0, nan)
    assert math.isnan(smaller)
    assert math.isnan(larger)


def test_mathematics_agrees_with_python():
    assert both(mathematics, 0.7) == pytest.approx((0.7**0.5, math.exp(-0.7), math.log(0.7), 0.7**0.3), rel=1e-15)


# ---- kernels ---------------------------------------------------------------------------------------------------------


def cubed(x):
    return x * x * x


@helper
def wrapped(i, n):
    if i < 0:
        i = 0
    while i >= n:
        i -= n
    return i


@row
def cube_row(A, B, n):
    for i in range(n):
        store(B, i, cubed(load(A, i)) + HALF)


@driver
def cube_all(A, B, out):
    n = A.shape[0]
    if N > 1:
        cube_row(A, B, n)
    C = workspace(n)
    for i in range(n):
        C[i] = 0.0
    for i in range(2 * n):
        C[wrapped(i, n)] += B[wrapped(i, n)]
    for i in range(len(C)):
        out[i] = C[i] if i % 2 == 0 else real(int(floor(C[i])))


real = float


@pytest.mark.parametrize("kind", ["float64", "float32"])
def test_kernels_loop_branch_and_index(kind):
    A = np.array([0.1, 0.2, 1.5], kind)
    B, out = np.zeros_like(A), np.zeros_like(A)
    cpu.build([cube_all], {"N": 2}, real=kind).cube_all(A, B, out)
    expected = A**3 + 0.5
    assert pytest.approx(expected, rel=1e-6) == B
    assert out == pytest.approx([2.0 * expected[0], math.floor(2.0 * expected[1]), 2.0 * expected[2]], rel=1e-6)
    plain_B, plain_out = np.zeros(3), np.zeros(3)
    emit.plain(cube_all, {"N": 2})(A.astype(float), plain_B, plain_out)
    assert plain_out == pytest.approx(out, rel=1e-6)


@driver
def sometimes_set(n, out):
    if n > 5:
        n = 5
    out[0] = n


def test_a_constant_given_in_one_branch_is_no_constant():
    for n in (3, 9):
        out = np.zeros(1)
        cpu.build([sometimes_set], {}).sometimes_set(n, out)
        assert out[0] == min(n, 5)


# ---- precision -------------------------------------------------------------------------------------------------------


def many_literals(x):
    scale = 0.1 if SWITCH else 0.2
    y = (x + 3.7) * scale + max(x, 0.25) * WEIGHTS[0] + pow(x, 0.5) + exp(-x) + sqrt(x) + log(x + 2.0)
    return (y if y > 1e-3 else 0.0, min(y, INFINITE))


def test_single_precision_stays_single():
    constants = {"SWITCH": True, "WEIGHTS": (1.5,)}
    text = text_of(many_literals, constants, real="float32")
    assert not [line for line in text.splitlines() if "double" in line and not line.startswith("declare")]
    assert module_of(many_literals, constants, {}, "float32", ("float", "float"))[1].returns == ("float", "float")


@row
def exponentials(A, B, n):
    for i in range(n):
        store(B, i, exp(load(A, i)))


@driver
def exponentials_of(A, B):
    exponentials(A, B, A.size)


@pytest.mark.parametrize(("kind", "limit", "tolerance"), [("float64", 690.0, 4e-16), ("float32", 80.0, 1.2e-7)])
def test_exponential_is_accurate(kind, limit, tolerance):
    A = np.concatenate([np.linspace(-limit, limit, 200001), np.geomspace(1e-30, 1.0, 1000)]).astype(kind)
    B = np.empty_like(A)
    cpu.build([exponentials_of], {}, real=kind).exponentials_of(A, B)
    exact = np.exp(A.astype(np.longdouble))
    assert np.max(np.abs(B / exact - 1.0)) < tolerance


def test_exponential_outside_its_range():
    A = np.array([0.0, -0.0, -np.inf, -1e4, 1e4, np.inf, np.nan])
    B = np.empty_like(A)
    cpu.build([exponentials_of], {}).exponentials_of(A, B)
    assert B[0] == B[1] == 1.0
    assert np.all((B[2:4] > 0.0) & (B[2:4] < 1e-300))
    assert np.all((B[4:6] > 1e300) & np.isfinite(B[4:6]))
    assert np.isnan(B[6])


# ---- refusals --------------------------------------------------------------------------------------------------------


def branches_at_run_time(x):
    if x > 0.0:
        return x
    return -x


def loops_at_run_time(x):
    for _ in range(3):
        x = x * x
    return x


def loops_while(x):
    while x > 1.0:
        x = 0.5 * x
    return x


def adds_in_place(x):
    y = x
    y += 1.0
    return y


def writes_into_its_argument(x):
    x[0] = 1.0
    return x[0]


def adds_an_integer(x):
    return x + 2


def compares_with_an_integer(x):
    return x if x > 2 else 3.0


def chooses_an_integer(x):
    return x if x > 2.0 else 3


def passes_an_integer(x):
    return max(x, 1)


def takes_an_attribute(x):
    return x.real


def uses_an_unknown_name(x):
    return x * unknown  # noqa: F821


def uses_an_open_symbol(x):
    return x * OPEN


def calls_an_unknown_formula(x):
    return unknown(x)  # noqa: F821


def calls_a_method(x):
    return x.conjugate()


def calls_a_value(x):
    y = x
    return y(x)


def calls_with_a_keyword(x):
    return three_arguments(x, x, c=x)


def compares_in_a_chain(x):
    return 1.0 if 0.0 < x < 1.0 else x


def compares_identity(x):
    return 1.0 if x is N else x


def takes_a_power(x):
    return x**2.0


def inverts(x):
    return ~x


def expands_a_value(x):
    y = scaled(x)
    return three_arguments(*y)


def expands_a_runtime_generator(x):
    return sum(y for y in x)


def skips_in_a_generator(x):
    return sum(x for d in static_range(3) if d > 1)


def indexes_at_run_time(x, i):
    return x[i]


def loops_to_a_runtime_bound(x, n):
    return sum(x for d in static_range(n))


def has_a_lambda(x):
    return (lambda y: y)(x)


def has_no_effect(x):
    x * 2.0
    return x


def assigns_twice_at_once(x):
    a = b = x
    return a + b


def formats(x):
    return f"{x}"


def floors(x):
    return x - floor(x)


REFUSALS = {
    branches_at_run_time: "does not branch at run time",
    loops_at_run_time: "static_range only",
    loops_while: "static_range only",
    adds_in_place: r"no \+=",
    writes_into_its_argument: "does not write into its arguments",
    adds_an_integer: r"write 2\.0",
    compares_with_an_integer: r"write 2\.0",
    chooses_an_integer: r"write 3\.0",
    passes_an_integer: r"write 1\.0",
    takes_an_attribute: "no attributes",
    uses_an_unknown_name: "unknown is neither a local name nor fixed",
    uses_an_open_symbol: "OPEN is neither a local name nor fixed",
    calls_an_unknown_formula: "unknown is not a formula",
    calls_a_method: "plain names",
    calls_a_value: "y is a local value",
    calls_with_a_keyword: "without keywords",
    compares_in_a_chain: "one comparison at a time",
    compares_identity: "operator Is ",
    takes_a_power: "operator Pow ",
    inverts: "operator Invert ",
    expands_a_value: "a star needs a tuple",
    expands_a_runtime_generator: "expected .* static_range",
    skips_in_a_generator: "expected .* static_range",
    indexes_at_run_time: "index must be fixed",
    loops_to_a_runtime_bound: "bounds of static_range must be fixed",
    has_a_lambda: "plain names",
    has_no_effect: "no effect",
    assigns_twice_at_once: "one target",
    formats: "JoinedStr is not in the subset",
    floors: "floor is not a formula",
}


@pytest.mark.parametrize("function", REFUSALS, ids=lambda function: function.__name__)
def test_refusals_name_the_place(function):
    with pytest.raises(NotInSubset, match=REFUSALS[function]) as refusal:
        text_of(function, {"N": 3, "GAMMA": 2.0})
    message, first = str(refusal.value), function.__code__.co_firstlineno
    assert message.startswith(f"{__name__} line ")
    line = int(message.split(" line ")[1].split(",")[0])
    assert first < line <= first + 4
    assert f"in {function.__name__}:" in message


def test_an_open_formula_is_refused():
    with pytest.raises(NotInSubset, match=r"distfsi\.formulas\.symbols line \d+"):
        text_of(early_return, {"SWITCH": False})


def test_two_formulas_of_one_name_are_refused():
    def elsewhere(x):
        return 2.0 * x

    elsewhere.__name__ = "scaled__first_material"
    emission = emit.Emission({"GAMMA": 2.0}, {"first_material": Bound(scaled)})
    emission.add(elsewhere)
    with pytest.raises(
        NotInSubset, match=r"test_emit.py, line \d+: scaled__first_material is also .*test_emit.py, line"
    ):
        emission.add(scaled, Bound(scaled), "__first_material")


# ---- numbers and records ---------------------------------------------------------------------------------------------


class Window(NamedTuple):
    start: np.ndarray
    step: float


class Pair(NamedTuple):
    left: Window
    weight: float


@dataclass(frozen=True)
class Spring:
    """A law: numbers and formulas of them."""

    stiffness: float
    rest: float

    def stretch(self, x):
        return x - self.rest

    def force(self, x):
        return -self.stiffness * self.stretch(x) + HALF * self.rest


class Softer(Spring):
    """A law that has its fields and a formula from another one."""

    def stretch(self, x):
        return HALF * (x - self.rest)


@dataclass(frozen=True)
class Nothing:
    """A law without numbers."""

    def force(self, x):
        return self.half(x)

    def half(self, x):
        return HALF * x


class Memory(NamedTuple):
    """What a material remembers: the scene says what that is."""


class Remembered(NamedTuple):
    strain: np.ndarray
    damage: np.ndarray


@driver
def remember(begin, end, memory: Memory):
    for i in range(begin, end):
        held = tuple(memory[k][i] for k in static_range(N))
        for k in static_range(N):
            memory[k][i] = held[k] + HALF * held[0]


def arithmetic_of_numbers(x):
    return x * (1.0 / GAMMA) + (GAMMA - 1.0) * -GAMMA / 2.0


def ratio_of_numbers(x):
    return x * (GAMMA / GAMMA) + (HALF / GAMMA - 1.0) * x


def choice_by_a_number(x):
    y = x if GAMMA > 1.0 else -x
    if GAMMA:
        return y + GAMMA
    return y


@helper
def value_at(window: Window, i):
    return window.start[i] * window.step


@driver
def walk(begin, end, pair: Pair, out):
    for i in range(begin, end):
        out[i] = value_at(pair.left, i) + pair.weight * float_of(pair)


@helper
def step_of(i, window: Window):
    return window.step + i


@driver
def makes_windows(begin, end, start, out):
    for i in range(begin, end):
        out[i] = value_at(Window(step=2.0, start=start), i) + step_of(i, Window(start, 0.5))


@driver
def makes_half_a_window(begin, end, start, out):
    out[0] = value_at(Window(start=start), 0)


@driver
def makes_another_record(begin, end, start, out):
    out[0] = value_at(Pair(left=start, weight=1.0), 0)


@helper
def float_of(pair: Pair):
    return pair.left.step


@driver
def pull(begin, end, springs, out):
    for i in range(begin, end):
        spring = tuple(springs[i, k] for k in static_range(2))
        out[i] = first_material(spring, HALF)


def two_springs(x):
    return first_material(x) + second_material(x)


def test_arithmetic_among_numbers_is_done_once_in_double():
    assert body_of(arithmetic_of_numbers, GAMMA=3.0) == ["return x * numbers_[0] + numbers_[1]"]
    emission = emit.Emission({"GAMMA": 3.0}, {})
    emission.add(arithmetic_of_numbers)
    assert emission.numbers == {
        "(1.0 / given['GAMMA'])": 1.0 / 3.0,
        "(((given['GAMMA'] - 1.0) * -given['GAMMA']) / 2.0)": -3.0,
    }


def test_a_number_over_itself_is_one():
    assert body_of(ratio_of_numbers, GAMMA=3.0) == ["return x + numbers_[0] * x"]


def test_numbers_decide_at_run_time_but_for_zero():
    assert both(choice_by_a_number, 2.0, constants={"GAMMA": 3.0}) == 5.0
    assert both(choice_by_a_number, 2.0, constants={"GAMMA": 0.5}) == -1.5
    assert body_of(choice_by_a_number, GAMMA=0.0) == ["y = -x", "return y"]


def test_records_are_flattened_for_both_writers():
    out, start = np.zeros(3), np.array([1.0, 2.0, 3.0])
    pair = Pair(Window(start, 2.0), 10.0)
    cpu.build([walk], {}).walk(0, 3, pair, out)
    assert out.tolist() == [22.0, 24.0, 26.0]
    kernel = Kernel(walk, {}, {}, "float64")
    other = np.zeros(3)
    HostKernel(kernel)(3, kernel.given((pair, other)))
    assert other.tolist() == out.tolist()


def test_records_are_made_where_they_are_handed_on():
    out, start = np.zeros(3), np.array([1.0, 2.0, 3.0])
    cpu.build([makes_windows], {}).makes_windows(0, 3, start, out)
    assert out.tolist() == [2.5, 5.5, 8.5]


@pytest.mark.parametrize(
    ("function", "why"),
    [(makes_half_a_window, "Window has the fields start, step"), (makes_another_record, "window is no Pair")],
)
def test_a_record_has_all_fields_and_the_class_of_its_parameter(function, why):
    with pytest.raises(NotInSubset, match=why):
        text_of(function)


@driver
def push(begin, end, out):
    for i in range(begin, end):
        law = tuple(0.0 for _ in static_range(N))
        out[i] = first_material(law, out[i])


def test_a_law_may_have_no_numbers():
    out = np.array([3.0])
    cpu.build([push], {"N": 0}, {"first_material": Bound.from_table(Nothing, "force")}).push(0, 1, out)
    assert out.tolist() == [Nothing().force(3.0)]


def test_the_scene_chooses_a_record_whose_fields_have_numbers():
    memory = Remembered(np.array([1.0, 2.0]), np.array([10.0, 20.0]))
    cpu.build([remember], {"N": 2}, {"Memory": Remembered}).remember(0, 2, memory)
    assert (memory.strain.tolist(), memory.damage.tolist()) == ([1.5, 3.0], [10.5, 21.0])


def springs(first, second):
    return {"first_material": Bound.of(first, "force"), "second_material": Bound.of(second, "force")}


def test_a_law_gives_its_formulas_its_numbers():
    bindings = {
        "first_material": Bound.of(Spring(2.0, 1.0), "force"),
        "second_material": Bound.of(Spring(5.0, 3.0), "force"),
    }
    assert both(two_springs, 4.0, bindings=bindings) == (-6.0 + 0.5) + (-5.0 + 1.5)
    other = {
        "first_material": Bound.of(Spring(7.0, 2.0), "force"),
        "second_material": Bound.of(Spring(1.0, 4.0), "force"),
    }
    assert text_of(two_springs, {}, bindings) == text_of(two_springs, {}, other)
    assert Spring(2.0, 1.0).force(4.0) == -5.5


def test_a_law_may_come_from_a_table():
    out = np.zeros(2)
    twice = cpu.build([pull], {}, {"first_material": Bound.from_table(Softer, "force")})
    twice.pull(0, 2, np.array([[2.0, 1.0], [5.0, 3.0]]), out)
    assert out.tolist() == [Softer(2.0, 1.0).force(HALF), Softer(5.0, 3.0).force(HALF)]
    cpu.build([pull], {}, {"first_material": Bound(Spring.force)}).pull(0, 2, np.array([[2.0, 1.0], [5.0, 3.0]]), out)
    assert out.tolist() == [Spring(2.0, 1.0).force(HALF), Spring(5.0, 3.0).force(HALF)]


# ---- modules and their cache -----------------------------------------------------------------------------------------


def test_the_module_is_named_by_its_text():
    names = [Native(scaled, {"GAMMA": gamma}, {}, "float64").module.__name__ for gamma in (1.4, 1.4, 1.5, 0.0)]
    assert names[0] == names[1] == names[2] != names[3]
    assert Native(scaled, {"GAMMA": 1.4}, {}, "float32").module.__name__ != names[0]


def test_the_text_names_the_source():
    text = text_of(material, {"GAMMA": 1.4})
    for function in (material, scaled):
        place = f"; {__name__}.py, line {function.__code__.co_firstlineno}\n"
        assert f"{place}define internal double @{function.__name__}.0(" in text


def test_two_scenes_live_side_by_side():
    """What a scene measures is given to one module at run time; a number that is 0 is folded away."""
    assert text_of(scaled, {"GAMMA": 1.4}) == text_of(scaled, {"GAMMA": 1.5}) != text_of(scaled, {"GAMMA": 0.0})
    values = [cpu.build([scaled], {"GAMMA": gamma}).scaled(1.0) for gamma in (1.4, 1.5, 1.4)]
    assert values == [1.4, 1.5, 1.4]


def test_a_text_made_before_is_found_without_folding(monkeypatch):
    assert cpu.build([scaled], {"GAMMA": 1.25}).scaled(2.0) == 2.5
    monkeypatch.setattr(Native, "_module_text", None)
    assert cpu.build([scaled], {"GAMMA": 1.25, "N": 3}).scaled(2.0) == 2.5


def test_the_fingerprint_tells_all_that_a_text_depends_on(monkeypatch):
    first, second = Bound(material, {"GAMMA": 3.0}), Bound(scaled, {"GAMMA": 5.0})
    bindings = {"first_material": first, "second_material": second}
    before = fingerprint(two_materials, {"GAMMA": 1.0}, bindings, "float64")
    other_number = bindings | {"first_material": Bound(material, {"GAMMA": 4.0})}
    assert before == fingerprint(two_materials, {"GAMMA": 1.0}, other_number, "float64")
    assert before == fingerprint(two_materials, {"GAMMA": 2.0, "N": 2}, bindings, "float64")  # neither is looked at
    others = [
        fingerprint(two_materials, {}, bindings | {"first_material": Bound(material, {"GAMMA": 0.0})}, "float64"),
        fingerprint(two_materials, {"GAMMA": 1.0}, bindings, "float32"),
        fingerprint(two_materials, {"GAMMA": 1.0}, bindings | {"first_material": second}, "float64"),
        fingerprint(two_materials, {"GAMMA": 1.0}, bindings | {"second_material": Bound(scaled)}, "float64"),
    ]
    monkeypatch.setitem(globals(), "scaled", cubed)  # which `material` calls
    others.append(fingerprint(two_materials, {"GAMMA": 1.0}, bindings, "float64"))
    plain_number = fingerprint(constants_are_folded, {}, {}, "float64")
    monkeypatch.setitem(globals(), "HALF", 0.25)
    assert len({before, *others}) == 1 + len(others)
    assert fingerprint(constants_are_folded, {}, {}, "float64") != plain_number


PROGRAM = """
import sys
import numpy as np
from distfsi.device import cpu
from distfsi.device.native import compilation
from test_emit import exponentials_of
B = np.zeros(1)
cpu.build([exponentials_of], {}).exponentials_of(np.zeros(1), B)
print(B[0], compilation.made)
"""


def test_a_second_process_finds_the_compiled_module(tmp_path, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}:{ROOT / 'tests'}")
    runs = [
        subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=120, check=True).stdout
        for _ in range(2)
    ]
    assert [run.split() for run in runs] == [["1.0", "1"], ["1.0", "0"]]
    assert len(list(tmp_path.glob("exponentials_of_*.py"))) == 1


def test_bodies_of_other_types_have_other_names_in_every_process():
    """Processes leave machine code for each other; what is called alike there would be taken for one function."""
    kernel = Native(exponentials_of, {}, {}, "float64")
    doubles, floats = ((Array(element, 1),) * 2 for element in ("float64", "float32"))
    names = [kernel.body(types)[0] for types in (doubles, floats, doubles)]
    assert names[0] == names[2] != names[1]
