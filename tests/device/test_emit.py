"""The formula subset: what each construct is emitted as."""

import ast
import math

import numpy as np
import pytest

from distfsi.device import cpu, emit
from distfsi.device.llvm_text import module_of
from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.device.source import Bound
from distfsi.formulas.subset import static_range
from emitted import (
    GAMMA,
    HALF,
    INFINITE,
    SWITCH,
    WEIGHTS,
    N,
    body_of,
    both,
    constants_are_folded,
    cubed,
    early_return,
    exp,
    exponentials_of,
    floor,
    log,
    material,
    pow,
    scaled,
    sqrt,
    text_of,
    three_arguments,
    two_materials,
)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path_factory.getbasetemp() / "kernels"))


# ---- constructs ------------------------------------------------------------------------------------------------------


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
