"""The formula subset: what is refused, and in which words."""

import pytest

from distfsi.device import emit
from distfsi.device.source import Bound, NotInSubset
from distfsi.formulas.subset import static_range
from emitted import (
    OPEN,
    N,
    early_return,
    floor,
    scaled,
    text_of,
    three_arguments,
)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path_factory.getbasetemp() / "kernels"))


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
        NotInSubset, match=r"emitted.py, line \d+: scaled__first_material is also .*test_refusals.py, line"
    ):
        emission.add(scaled, Bound(scaled), "__first_material")
