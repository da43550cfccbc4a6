"""What is conserved is conserved, with the same bits on 1, 2 and 4 ranks; and what ranks cost is told."""

import json

import pytest

from launch import SUPPORT
from mpi_conservation import BOXES

NAMES = list(BOXES)


def on_ranks(mpiexec, ranks, names):
    printed = mpiexec(ranks, SUPPORT / "mpi_conservation.py", *names)
    lines = [json.loads(line) for line in printed.splitlines() if line.startswith("{")]
    return {line.pop("name"): line for line in lines}


@pytest.mark.parametrize("names", [NAMES[:3], pytest.param(NAMES[3:], marks=pytest.mark.full)], ids=["plane", "space"])
def test_boxes_keep_everything_on_any_number_of_ranks(mpiexec, names):
    """Mass of each phase, momentum (with the impulse of walls; not along r) and energy to 1e-12 of the sum of
    absolute values."""
    found = {ranks: on_ranks(mpiexec, ranks, names) for ranks in (1, 2, 4)}
    for name in names:
        drifts = {key: value for key, value in found[1][name].items() if key.startswith("drift")}
        assert len(drifts) == 2 + len(BOXES[name][0]) + (name != "around an axis")
        assert max(map(abs, drifts.values())) < 1e-12, drifts
        assert found[1][name] == found[2][name] == found[4][name]
    for ranks, lines in found.items():
        costs = lines["costs"]
        assert (costs["bytes_sent_per_step"] > 0) == (costs["messages_per_step"] > 0) == (ranks > 1)
        assert costs["bytes_sent_per_step"] >= costs["bytes_sent_per_step_most_of_a_rank"]
        assert 0.0 < costs["packing_seconds_per_step"] < costs["step_seconds"]
        assert costs["imbalance_of_cells"] < 0.5
