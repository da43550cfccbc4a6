"""Runs that are stopped, killed or diverge, and what goes on from them: the same files as of a run left alone."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import psutil
import pytest
from vtkmodules.vtkIOHDF import vtkHDFReader

from distfsi.errors import Diverged, InputError, Stopped
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output import requests
from distfsi.output.checksum import add_checksum
from distfsi.output.fields import read_cells, read_particles, series
from distfsi.output.history import read_history
from distfsi.output.restart import FORMAT, Restart, newest_restart
from distfsi.scene import load
from distfsi.simulation import Simulation
from launch import ENVIRONMENT, ROOT, SUPPORT, run_ranks
from results import results

SCRIPT = SUPPORT / "mpi_restart.py"
TUBE = ROOT / "inputs/steel_tube.toml"
STEPS = 120
COARSE = (
    "domain.cells=[28, 28]",
    "domain.upper=['56 mm', '56 mm']",
    "solid.bodies.tube.spacing=1.2 mm",
    "performance.block_cells=[8, 16]",
    "performance.tile_cells=[8, 4]",
    f"time.maximum_steps={STEPS}",
    "output.fields_every=3e-7",
    "output.history_every=3",
    "output.peaks=true",
    'gauges.wall={kind="point", position=["36 mm", "1 mm"]}',
    'gauges.tube={kind="body", body="tube", every="2e-7 s"}',
    'gauges.plane={kind="plane", axis="y", position="1 mm", every="1 us"}',
)


def overrides(directory, *more):
    return [*COARSE, f"output.directory={directory}", *more]


def words(directory, *more, restart=None):
    """The command line's words that run the coarse tube."""
    sets = [word for override in overrides(directory, *more) for word in ("--set", override)]
    return ["run", TUBE, "--threads", "1", *sets, *(["--restart", restart] if restart else [])]


def run_here(directory, *more, restart=None):
    """Run the coarse tube in this process."""
    return run(load(TUBE, overrides(directory, *more)), Communicator(), 1, restart)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The results of the coarse tube, left alone on one rank."""
    directory = tmp_path_factory.mktemp("undisturbed")
    run_here(directory)
    return results(directory)


def before_step(monkeypatch, number, act):
    """Call `act(simulation)` before a simulation of this process takes its step of this number."""
    step = Simulation.step

    def prepared(simulation):
        if simulation.steps == number - 1:
            act(simulation)
        step(simulation)

    monkeypatch.setattr(Simulation, "step", prepared)


# ---- stopping --------------------------------------------------------------------------------------------------------


def test_restarts_on_other_numbers_of_ranks(undisturbed, tmp_path, monkeypatch):
    """One rank, stopped after a random step, goes on as two, stopped again as four, stopped again as one."""
    stops = sorted(random.sample(range(1, STEPS), 3))
    before_step(monkeypatch, stops[0], lambda _: os.kill(os.getpid(), signal.SIGTERM))
    with pytest.raises(Stopped, match=f"after {stops[0]} steps by a signal"):
        run_here(tmp_path)
    monkeypatch.undo()
    for ranks, stop in zip((2, 4), stops[1:], strict=True):
        run_ranks(ranks, [SCRIPT, stop, *words(tmp_path, restart="auto")], timeout=120.0, code=75)
    run_here(tmp_path, restart="auto")
    assert results(tmp_path) == undisturbed, stops
    assert [path.name for path in sorted(tmp_path.glob("restart*"))] == [
        f"restart-{n:08d}.h5" for n in (stops[2], STEPS)
    ]


def test_wall_clock_and_stop_file(undisturbed, tmp_path, monkeypatch):
    """Both stop a run with a restart file; the stop file is then gone."""
    monkeypatch.setattr(requests, "SECONDS_BETWEEN_LOOKS", 0.0)
    with pytest.raises(Stopped, match="after 1 steps by time.wall_clock_limit") as stopped:
        run_here(tmp_path, "time.wall_clock_limit=1 us")
    assert stopped.value.exit_code == 75
    before_step(monkeypatch, 40, lambda _: (tmp_path / "stop").touch())
    with pytest.raises(Stopped, match="after 40 steps by the file .*stop, state in"):
        run_here(tmp_path, restart="auto")
    assert not (tmp_path / "stop").exists()
    run_here(tmp_path, restart=str(newest_restart(tmp_path)))
    assert results(tmp_path) == undisturbed


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        (
            "sod",
            ("domain.cells=50", "performance.block_cells=16", "performance.tile_cells=8", "fluid.precision=float32"),
        ),
        ("plate_impact", ()),
    ],
)
def test_a_fluid_and_a_solid_alone(tmp_path, monkeypatch, name, changes):
    """With single precision, partly filled blocks, and an end that the restart puts off."""

    def go(directory, *more, restart=None):
        given = [f"output.directory={directory}", *changes, *more]
        run(load(ROOT / "inputs" / f"{name}.toml", given), Communicator(), 1, restart)

    go(tmp_path / "undisturbed", "time.maximum_steps=40")
    before_step(monkeypatch, 13, lambda _: os.kill(os.getpid(), signal.SIGUSR1))
    with pytest.raises(Stopped):
        go(tmp_path / "stopped", "time.maximum_steps=20")
    monkeypatch.undo()
    go(tmp_path / "stopped", "time.maximum_steps=40", restart="auto")
    assert results(tmp_path / "stopped") == results(tmp_path / "undisturbed")


class Launched:
    """Two ranks that run the coarse tube while the test does something to them."""

    def __init__(self, directory, *more, restart=None):
        launcher = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
        command = [launcher, "-n", "2", sys.executable, "-m", "distfsi", *words(directory, *more, restart=restart)]
        self.history = directory / "history.csv"
        self.before = self.rows()
        self.process = subprocess.Popen(
            list(map(str, command)),
            env=os.environ | ENVIRONMENT,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )

    def rows(self):
        return self.history.read_bytes() if self.history.exists() else b""

    def wait_until_running(self):
        """Until it has written to its history, or has ended."""
        deadline = time.monotonic() + 60.0
        while self.rows() == self.before and self.process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.002)

    def ranks(self):
        """The processes that compute."""
        return [child for child in self.everyone() if "distfsi" in child.cmdline() and "mpiexec" not in child.name()]

    def everyone(self):
        return psutil.Process(self.process.pid).children(recursive=True)

    def kill(self):
        """Kill the launcher and all it has started at once."""
        victims = self.everyone()
        self.process.kill()
        for victim in victims:
            victim.kill()
        psutil.wait_procs(victims, 10.0)
        return self.process.communicate()[0]


def test_signals_through_mpiexec(undisturbed, tmp_path):
    """SIGUSR1 and SIGTERM to mpiexec stop all ranks with a restart file and exit code 75; the run goes on."""
    for number, restart in ((signal.SIGUSR1, None), (signal.SIGTERM, "auto")):
        launched = Launched(tmp_path, restart=restart)
        launched.wait_until_running()
        launched.process.send_signal(number)
        output, _ = launched.process.communicate(timeout=60.0)
        assert launched.process.returncode == 75, output
        assert output.count("with --restart auto goes on") == 1
        assert "Traceback" not in output
    run_ranks(2, ["-m", "distfsi", *words(tmp_path, restart="auto")], timeout=120.0)
    assert results(tmp_path) == undisturbed


# ---- dying -----------------------------------------------------------------------------------------------------------


def check_that_all_listed_files_open(directory):
    """With VTK, and hold all cells and particles."""
    for kind in ("cells", "particles"):
        for _, path in series(directory, kind):
            reader = vtkHDFReader()
            reader.SetFileName(str(path))
            reader.Update()
            data = reader.GetOutputDataObject(0)
            count = 28 * 28 if kind == "cells" else len(read_particles(path)[1]["id"])
            assert data.GetNumberOfCells() == count > 0, path
    for path in directory.glob("restart-*.h5"):
        assert Restart(path).step > 0


@pytest.mark.parametrize("kills", [4, pytest.param(50, marks=[pytest.mark.full, pytest.mark.timeout(1800)])])
def test_killed_at_any_moment(undisturbed, tmp_path, kills):
    """kill -9 of all ranks at random moments, the run going on from the newest restart file each time."""
    often = "output.restart_every=0.02"
    for number in range(kills):
        launched = Launched(tmp_path, often, restart="auto")
        if number % 8 == 0:
            time.sleep(random.uniform(0.0, 3.0))
        else:
            launched.wait_until_running()
            time.sleep(random.uniform(0.0, 0.5))
        output = launched.kill()
        assert "Traceback" not in output, output
        check_that_all_listed_files_open(tmp_path)
        if launched.process.returncode == 0:
            assert results(tmp_path) == undisturbed
            shutil.rmtree(tmp_path)
    run_ranks(2, ["-m", "distfsi", *words(tmp_path, often, restart="auto")], timeout=120.0)
    assert results(tmp_path) == undisturbed


def test_one_dead_rank_takes_the_others_along(tmp_path):
    launched = Launched(tmp_path, "time.maximum_steps=100000", "time.end=1")
    launched.wait_until_running()
    ranks = launched.ranks()
    assert len(ranks) == 2
    ranks[1].kill()
    assert launched.process.wait(timeout=5.0) != 0
    assert not psutil.wait_procs(ranks, timeout=1.0)[1]
    launched.process.communicate()


# ---- diverging -------------------------------------------------------------------------------------------------------

FALL = """
[domain]
lower = [0, 0]
upper = [1, 1]
cells = [16, 12]
gravity = [0, GRAVITY]
[time]
end = 1
[fluid.phases.air]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "air"
density = 1.2
pressure = 1e5
[performance]
block_cells = [8, 4]
"""


def test_a_diverging_run_tells_where_and_when_and_exits_with_3(tmp_path):
    """Told once, after the step was tried again; the last state that is valid lies in a restart file."""
    scene = tmp_path / "fall.toml"
    scene.write_text(FALL.replace("GRAVITY", "-1e160"))
    changes = (f"output.directory={tmp_path}", "output.restart_every=0")
    output = run_ranks(
        2, ["-m", "distfsi", scene, *(word for change in changes for word in ("--set", change))], timeout=60.0, code=3
    )
    assert output.count("the fluid has no valid state at t = ") == 1
    assert "in the cell at (0.03125, 0.0416667) m: density_1 nan" in output
    assert "8 attempts failed" in output
    assert "Traceback" not in output
    time, cells, *_ = read_cells(series(tmp_path, "cells")[-1][1])
    restart = newest_restart(tmp_path)
    assert f"the last restart file is {restart}" in output
    assert time == Restart(restart).time and np.isfinite(cells["density"]).all()


def test_the_last_valid_state_is_kept(undisturbed, tmp_path, monkeypatch):
    """A particle that becomes invalid is named, and so is the last restart file, from which the run goes on."""

    def spoil(simulation):
        simulation.solid.columns["sound_speed"][simulation.solid.columns["id"] == 17] = np.nan

    before_step(monkeypatch, 30, spoil)
    with pytest.raises(
        Diverged, match=r"(?s)solid particle 17 of body .* has no valid state at t = .*restart-00000029.h5$"
    ):
        run_here(tmp_path, "output.restart_every=1 ns")
    assert series(tmp_path, "particles")[-1][0] == Restart(tmp_path / "restart-00000029.h5").time
    monkeypatch.undo()
    run_here(tmp_path, restart="auto")
    assert results(tmp_path) == undisturbed


# ---- restart files ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """The directory of a coarse tube that was stopped after its first step."""
    directory = tmp_path_factory.mktemp("stopped")
    with pytest.raises(Stopped):
        run_here(directory, "time.wall_clock_limit=1 us")
    return directory


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("fluid.phases.air.gamma=1.3", "fluid.phases.air.eos.gamma: 1.3; was 1.4 in"),
        ("domain.cells=[27, 28]", r"domain.cells: \(27, 28\); was \(28, 28\) in"),
        ("time.scheme=rk2", "time.scheme: 'rk2'; was 'rk3' in"),
        ('gauges.wall={kind="body", body="tube"}', "holds another kind of 'gauge wall'"),
        ("solid.bodies.tube.strength=none", "solid.bodies.tube.strength: NoStrength; was JohnsonCook in"),
        ("domain.x=['symmetry', 'wall']", r"domain.boundaries.0: .*'wall'\); was .*'outflow'\) in"),
    ],
)
def test_another_scene_is_refused(stopped, change, told):
    """With every key that differs, and the restart file stays."""
    before = newest_restart(stopped).read_bytes()
    with pytest.raises(InputError, match=told):
        run_here(stopped, change, restart="auto")
    assert newest_restart(stopped).read_bytes() == before


def test_what_is_no_physics_may_change(stopped, tmp_path, capsys, undisturbed):
    """End, output, gauges and blocks: the cells have the same bits, and a change of time is told."""
    origin = str(newest_restart(stopped))
    changes = ("title=other", "time.end=1 ms", "performance.block_cells=[14, 14]", "output.fields_every=0", "gauges={}")
    run_here(tmp_path, *changes, restart=origin)
    assert "time.end: 0.001; was 2e-05" in capsys.readouterr().out
    (tmp_path / "undisturbed").write_bytes(undisturbed[max(name for name in undisturbed if name.startswith("cells-"))])
    _, expected, *_ = read_cells(tmp_path / "undisturbed")
    _, found, *_ = read_cells(series(tmp_path, "cells")[-1][1])
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
    drifts = {name: column for name, column in read_history(tmp_path / "history.csv").items() if "drift" in name}
    assert max(np.abs(column).max() for column in drifts.values()) < 1e-13


def test_an_incomplete_restart_file_is_passed_over(tmp_path):
    """auto takes the one before; without any that is complete it refuses rather than start anew and remove them."""
    for step in (5, 7):
        path = tmp_path / f"restart-{step:08d}.h5"
        with h5py.File(path, "w") as file:
            file.attrs.update(format=FORMAT, step=step, run="a")
            file["scene"], file["simulation/values/time"], file["simulation/values/steps"] = "{}", 0.5, step
        add_checksum(path, Communicator())
    newest = tmp_path / "restart-00000007.h5"
    assert newest_restart(tmp_path) == newest
    newest.write_bytes(newest.read_bytes()[:500])
    assert newest_restart(tmp_path) == tmp_path / "restart-00000005.h5"
    (tmp_path / "restart-00000005.h5").write_bytes(b"")
    with pytest.raises(InputError, match="restart-00000005.h5: is no complete restart file"):
        newest_restart(tmp_path)
    with pytest.raises(InputError, match="missing.h5: is no complete restart file"):
        run_here(tmp_path / "out", restart="missing.h5")
    assert not (tmp_path / "out").exists()
