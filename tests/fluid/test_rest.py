"""Tiles at rest are not computed, and the result is the same to the bit."""

import functools
import re

import numpy as np
import pytest

from distfsi.device.markers import helper
from distfsi.fluid.kernels import tile as kernels
from launch import SUPPORT
from mpi_rest import SCENES, cells_of, digest, follow, simulation_of


@helper
def never_uniform(U, u, su, sz, sy, n, m, l):
    return False


LONG = ("falling", "space", "tube")  # kernels of their own, twice: they take minutes to compile


@functools.cache
def rested(name):
    """A scene as users run it."""
    return follow(name)


@functools.cache
def computed(name):
    """A scene with all tiles computed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "is_uniform", never_uniform)
        return follow(name)


def scenes():
    """The names of all scenes, the long ones for the full tier."""
    return [pytest.param(name, marks=pytest.mark.full if name in LONG else ()) for name in [*SCENES, "tube"]]


@pytest.mark.parametrize("name", scenes())
def test_rest_changes_no_bit(name):
    """Cells, time steps and the whole row of the history, in which each wall has its impulse."""
    (found, share), (expected, none) = rested(name), computed(name)
    assert none == 0.0  # without the look at the values nothing rests, so this does compare
    for what, values in expected.items():
        np.testing.assert_array_equal(found[what], values, err_msg=what)
    assert digest(found) == digest(expected)
    assert share == 0.0 if name in ("falling", "away from the axis") else share > 0.2


def stirred(name):
    """Cells of a scene in which, after 3 steps, something else than a stage writes into a quiet block."""
    simulation = simulation_of(name)
    fluid = simulation.fluid
    for _ in range(3):
        simulation.step()
    start, calm = fluid.snapshot()["cells"]["state"].copy(), fluid.rest.calm.copy()
    last = simulation.blocks.local_count - 1
    fluid.cells(last)[:, :, 5:7, 8:9] *= 2.0
    fluid.wake(np.arange(last + 1) == last)
    for _ in range(6):
        simulation.step()
    written = cells_of(simulation)
    fluid.restore(fluid.snapshot() | {"cells": {"state": start}})
    for _ in range(6):
        simulation.step()
    return written, cells_of(simulation), calm[fluid.tiling.block == last]


def test_what_is_written_from_outside_wakes(monkeypatch):
    """A quiet block into which something is written, and a fluid that is restored."""
    *found, calm = stirred("corner")
    assert calm.all()
    monkeypatch.setattr(kernels, "is_uniform", never_uniform)
    for with_rest, without in zip(found, stirred("corner")[:2], strict=True):
        assert with_rest.tobytes() == without.tobytes()


def test_blocks_with_covered_cells_are_looked_at():
    """The coupling writes into their cells before every stage."""
    simulation = simulation_of("tube")
    for _ in range(10):
        simulation.step()
    fluid, blocks = simulation.fluid, simulation.blocks
    covered = [fluid.active(simulation.coupling.covered, block).any() for block in range(blocks.local_count)]
    near_solid = np.array(covered)[fluid.tiling.block]
    assert near_solid.any()
    assert fluid.rest.calm.any()
    assert not fluid.rest.calm[near_solid].any()


@pytest.mark.parametrize(
    ("ranks", "names"),
    [
        (2, ("corner",)),
        pytest.param(2, ("space",), marks=pytest.mark.full),
        (4, ("corner", "periodic", "inflow", "interface")),
        pytest.param(4, ("tube",), marks=pytest.mark.full),
    ],
)
def test_rest_on_several_ranks(mpiexec, ranks, names):
    """The same bits, and as much at rest as on one rank."""
    printed = dict(re.findall(r"^(.+): (\w+ [\d.]+)$", mpiexec(ranks, SUPPORT / "mpi_rest.py", *names), re.MULTILINE))
    assert printed == {name: f"{digest(computed(name)[0])} {rested(name)[1]:.6f}" for name in names}


def test_cut_changes_no_bit_of_the_cells():
    """Whatever the blocks and tiles."""
    found = [rested(name)[0] for name in ("corner", "large blocks", "thin tiles")]
    for other in found[1:]:
        for what in ("cells", "time steps"):
            np.testing.assert_array_equal(other[what], found[0][what], err_msg=what)
