"""No bit of any result has changed: what runs leave behind has the digests in digests.json, on one rank and on two.

Compared are the arrays of the restart file (state of the cells, columns of the particles, books, what watchers keep),
of the last fields, and the columns of the history and of gauges, floats with all their bits. Left out are the text of
the scene in the restart file, balance.csv (how evenly ranks share the work), and where those balls of a solid's
particles point that have no radius: nothing reads it. Of integer sums the total counts, for some have a row per rank.

The table tells the machine that it was made on. Kernels have the same bits on all CPUs: no fast math, no contraction of
a * b + c, an exponential of our own. But pow and log (walls in a gas, Johnson-Cook, concrete) are those of the C
library, which has others for CPUs with fused multiplication; and the powers of numpy, with which walls and charges are
set up, have other bits with vectors of 512 bits. So on another machine only the cases of EVERYWHERE, which have none of
them, are compared with the table; the others run on one rank and on two, which must agree, and warn that this is all.

`python tests/support/digests.py [case ...]` writes the table anew, for results that are meant to change. Where only
names have changed, they belong into RENAMED in digests.py.
"""

import warnings

import pytest

from digests import CASES, differences, machine, read_table, run_case

FAST = ("cantilever", "thin_plate", "tnt_air", "sod float32", "steel_tube gauges")
FAST_ON_TWO = ("sod float32", "steel_tube gauges")

EVERYWHERE = {
    "cantilever",
    "carbuncle",
    "cavitation",
    "interface",
    "leblanc",
    "noh",
    "piston",
    "plate_impact",
    "sedov",
    "shock_bubble",
    "sod",
    "taylor_bar",
    "verney_shell",
    "water_air",
    "sod float32",
    "sedov float32",
    "sod hll",
    "sedov rusanov",
    "water_air five_equation",
}


@pytest.fixture(scope="module")
def table():
    return read_table()


def cases(fast):
    """All cases, those that are not `fast` for `-m full`."""
    return [name if name in fast else pytest.param(name, marks=pytest.mark.full) for name in CASES]


def compare(table, name, ranks, tmp_path):
    """Run a case and compare it with the table, or where the table says nothing, with the other number of ranks."""
    found = run_case(CASES[name], ranks, tmp_path / f"{ranks}")
    expected, here, there = table["digests"][name], machine(), table["machine"]
    if here != there and name not in EVERYWHERE:
        unlike = ", ".join(f"{key} {here[key]}, there {there[key]}" for key in here if here[key] != there.get(key))
        warnings.warn(
            f"{name}: not compared with digests.json, which is of another machine ({unlike}), but 1 rank with 2",
            stacklevel=2,
        )
        expected = run_case(CASES[name], 3 - ranks, tmp_path / f"{3 - ranks}")
    unlike = differences(expected, found)
    assert not unlike, f"{name} on {ranks} rank(s): {len(unlike)} of {len(found)} arrays differ\n" + "\n".join(unlike)


@pytest.mark.parametrize("name", cases(FAST))
def test_one_rank_leaves_the_bits_of_the_table(table, tmp_path, name):
    compare(table, name, 1, tmp_path)


@pytest.mark.parametrize("name", cases(FAST_ON_TWO))
def test_two_ranks_leave_the_bits_of_the_table(table, tmp_path, name):
    compare(table, name, 2, tmp_path)


def test_the_table_has_all_cases(table):
    assert list(table["digests"]) == list(CASES)
