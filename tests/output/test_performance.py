"""Where the time goes: timers of the parts of a step, and the file that tells of them."""

import json
import time as clock
from types import SimpleNamespace

import numpy as np
import pytest

from distfsi.device.gpu import Gpu, Queue
from distfsi.device.host import HostRuntime
from distfsi.device.timers import UNREAD, Timers
from distfsi.diagnostics.performance import Performance
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output.history import read_history
from distfsi.scene import load
from distfsi.step import parts_of
from launch import ROOT

FLUID = ("time step", "exchange", "stage", "output")
COUPLED = ("time step", "exchange", "stage", "geometry", "merge", "flux", "forces", "solid", "output")


class Clock:
    """A device whose moments the test sets."""

    def __init__(self):
        self.now = 0.0

    def mark(self):
        return self.now

    def seconds_between(self, first, then):
        return then - first


def test_what_an_inner_part_takes_is_not_the_outer_ones():
    device = Clock()
    timers = Timers(device)
    device.now = 5.0  # belongs to no part
    with timers("outer"):
        device.now += 1.0
        with timers("inner"):
            device.now += 2.0
        device.now += 4.0
    device.now += 8.0
    with timers("inner"):
        device.now += 16.0
    assert timers.lap() == {"outer": 5.0, "inner": 18.0}
    assert timers.lap() == {}


def test_a_part_that_goes_on_counts_in_both_laps():
    device = Clock()
    timers = Timers(device)
    with timers("part"):
        device.now += 1.0
        assert timers.lap() == {"part": 1.0}
        device.now += 2.0
    assert timers.lap() == {"part": 2.0}


def test_many_moments_are_read_before_they_pile_up():
    device = Clock()
    timers = Timers(device)
    for _ in range(3 * UNREAD):
        with timers("part"):
            device.now += 1.0
        assert len(timers._moments) <= UNREAD + 2
    assert timers.lap() == {"part": 3.0 * UNREAD}


@pytest.mark.parametrize("late", [True, False])
def test_kernels_of_a_gpu_count_in_the_part_that_asks_for_them(late):
    """Even where the host waits for them in another one."""
    runtime = HostRuntime(late)
    gpu = Gpu(runtime)
    timers = Timers(gpu)
    with timers("asks"):
        runtime.launch(lambda *_: clock.sleep(0.05), SimpleNamespace(), 1, (), Queue.MAIN)
    with timers("waits"):
        gpu.download(gpu.zeros(1))
    seconds = timers.lap()
    assert seconds["asks"] >= 0.05 > seconds["waits"]


class Ranks:
    """Two ranks seen from the first: the other takes twice as long for all."""

    def concatenate(self, rows):
        return np.concatenate([rows, 2.0 * rows])


def test_a_row_tells_the_mean_and_the_slowest_rank():
    device = Clock()
    performance = Performance(("a", "b"), timers := Timers(device), Ranks())
    for _ in range(2):
        with timers("a"):
            device.now += 2.0
        row = dict(zip(performance.columns, performance.row(7, 0.5), strict=True))
        assert (row["step"], row["time [s]"], row["a mean [s]"], row["a maximum [s]"]) == (7, 0.5, 3.0, 4.0)
        assert (row["b mean [s]"], row["b maximum [s]"]) == (0.0, 0.0)
    assert performance.sums == {"a": 6.0, "b": 0.0}


@pytest.mark.parametrize(("name", "parts"), [("sod", FLUID), ("gas_piston", COUPLED)])
def test_a_run_tells_where_its_time_went(tmp_path, name, parts):
    """A row for each of the history; all parts there are have taken some time, and together not more than all."""
    changes = ("domain.cells=40", "time.maximum_steps=7", "output.history_every=3", f"output.directory={tmp_path}")
    scene = load(ROOT / f"inputs/{name}.toml", changes)
    assert parts_of(scene) == parts
    run(scene, Communicator(), 1)
    rows = read_history(tmp_path / "performance.csv")
    assert rows["step"].tolist() == read_history(tmp_path / "history.csv")["step"].tolist() == [0, 3, 6, 7]
    means = {part: rows.pop(f"{part} mean [s]") for part in parts}
    maxima = {part: rows.pop(f"{part} maximum [s]") for part in parts}
    assert {*rows} == {"step", "time [s]", "wall clock [s]"}
    assert all((means[part][1:] > 0.0).all() and (means[part] == maxima[part]).all() for part in parts)
    assert (sum(means.values()) <= rows["wall clock [s]"] + 1e-5).all()
    told = json.loads((tmp_path / "run.json").read_text())["seconds by part"]
    assert told == {part: pytest.approx(means[part].sum(), abs=1e-3) for part in parts}
