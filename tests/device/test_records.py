"""Numbers of a scene, records and laws in the kernel subset."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from distfsi.device import cpu, emit
from distfsi.device.host import HostKernel
from distfsi.device.kernel import Kernel
from distfsi.device.markers import driver, helper
from distfsi.device.source import Bound, NotInSubset
from distfsi.formulas.subset import static_range
from emitted import GAMMA, HALF, N, body_of, both, first_material, second_material, text_of


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path_factory.getbasetemp() / "kernels"))


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
