"""Blocks that change hands while a run goes on."""

import csv

import numpy as np
import pytest

from distfsi.mesh import balance
from distfsi.mesh.curve import deal
from launch import ROOT, run_ranks
from results import results

TUBE = ["domain.cells=[64, 64]", "solid.bodies.tube.spacing=0.625 mm", "performance.block_cells=[16, 16]"]
PROGRAM = """
import sys
import numpy as np
from distfsi import execution
from distfsi.commands.line import main

random = np.random.default_rng(7)  # the same on all ranks

class AnyDeal(execution.Balance):
    def watch(self, limit):
        super().watch(limit)
        return random.random(self._blocks.count) ** 8

execution.STEPS_BETWEEN_DEALS, execution.Balance = 4, AnyDeal
main(sys.argv[1:])
"""


def run_tube(directory, ranks):
    changes = [*TUBE, "time.maximum_steps=13", f"output.directory={directory}", "output.history_every=3"]
    options = [word for change in changes for word in ("--set", change)]
    return run_ranks(ranks, ["-c", PROGRAM, "run", ROOT / "inputs/steel_tube.toml", "--threads", "1", *options], 300)


def test_no_bit_depends_on_who_owns_a_block(tmp_path):
    """Blocks change hands again and again, by chance, under a coupled run."""
    run_tube(tmp_path / "alone", 1)
    run_tube(tmp_path / "shared", 4)
    with (tmp_path / "shared/balance.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["step"], row["blocks change hands"]) for row in rows] == [(str(n), "1") for n in range(4, 13, 4)]
    assert results(tmp_path / "shared") == results(tmp_path / "alone")


def test_a_rank_without_blocks_says_nothing_wrong(tmp_path):
    """It tells no work, as numbers of the same type as the others'."""
    changes = ["time.maximum_steps=101", f"output.directory={tmp_path}"]
    words = [word for change in changes for word in ("--set", change)]
    run_ranks(2, ["-m", "distfsi", ROOT / "inputs/sod.toml", "--threads", "1", *words], 120)
    with (tmp_path / "balance.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert 1.0 <= float(row["busiest rank over mean"]) <= 2.0


class Part:
    """All the time goes into the last block."""

    def __init__(self, rank, work):
        self._work, self.rank, self.seconds, self.device = np.array(work), rank, 0.0, self

    def workload(self):
        return self._work


class Ranks:
    """Two ranks seen from the first: the other's rows are given."""

    size = 2

    def __init__(self, others):
        self.others = iter(others)

    def concatenate(self, rows):
        return np.concatenate([rows, next(self.others)])


class Halves:
    owners = deal(np.ones(4), 2)


@pytest.mark.parametrize(
    ("seconds", "work", "moves"),
    [
        ((1.0, 3.0), ([1.0, 1.0], [2.0, 4.0]), True),
        ((1.0, 1.2), ([1.0, 1.0], [1.1, 1.3]), False),  # below the limit
        ((1.0, 3.0), ([0.0, 0.0], [0.0, 6.0]), False),  # one block is all there is to do
    ],
)
def test_blocks_move_only_where_that_helps(seconds, work, moves):
    blocks, part = Halves(), Part(0, work[0])
    blocks.communicator = Ranks([np.array([[seconds[1]]]), np.array(work[1])[:, None]])
    watched = balance.Balance([part], blocks)
    part.seconds = seconds[0]
    costs = watched.watch(1.25)
    assert watched.imbalance == max(seconds) / np.mean(seconds)
    assert (costs is not None) == moves
    if moves:
        assert costs == pytest.approx(sum(seconds) * np.concatenate(work) / np.concatenate(work).sum())
