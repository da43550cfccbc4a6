"""Signals stop a run at any time from the first import on, with a restart file, exit code 75 and a true run.json; a
second interrupt ends it at once."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.memory import available_memory
from distfsi.mesh.communicator import Communicator
from distfsi.output import picture
from distfsi.output.restart import newest_restart
from distfsi.scene import load
from launch import ENVIRONMENT, ROOT, run_ranks

SOD = ROOT / "inputs" / "sod.toml"
ENDLESS = ("domain.cells=64", "performance.block_cells=8", "performance.tile_cells=8", "time.end=1e9", "time.cfl=0.01")
SIGNALS = ("SIGINT", "SIGHUP", "SIGTERM", "SIGUSR1")


class Started:
    """A run on so many ranks; one is started without a launcher."""

    def __init__(self, directory: Path, ranks: int, *settings: str):
        launcher = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
        sets = [
            word for setting in (*ENDLESS, f"output.directory={directory}", *settings) for word in ("--set", setting)
        ]
        words = [sys.executable, "-m", "distfsi", "run", str(SOD), "--threads", "1", *sets]
        self.directory = directory
        self.process = subprocess.Popen(
            words if ranks == 1 else [launcher, "-n", str(ranks), *words],
            env=os.environ | ENVIRONMENT,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )

    def ranks(self) -> list[psutil.Process]:
        """The processes that compute."""
        everyone = [psutil.Process(self.process.pid), *psutil.Process(self.process.pid).children(recursive=True)]
        return [one for one in everyone if "distfsi" in one.cmdline() and "mpiexec" not in one.name()]

    def wait_for(self, happens) -> None:
        """Until that is so, or the run has ended."""
        deadline = time.monotonic() + 60.0
        while not happens() and self.process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.01)

    def is_listening(self) -> bool:
        """Whether all ranks note SIGUSR1."""

        def notes(one: psutil.Process) -> bool:
            try:
                status = Path(f"/proc/{one.pid}/status").read_text()
            except OSError:
                return False
            caught = int(next(line for line in status.splitlines() if line.startswith("SigCgt")).split()[1], 16)
            return bool(caught >> (signal.SIGUSR1 - 1) & 1)

        ranks = self.ranks()
        return bool(ranks) and all(map(notes, ranks))

    def has_begun(self) -> bool:
        """Whether it makes steps."""
        history = self.directory / "history.csv"
        return history.exists() and history.read_bytes().count(b"\n") > 2

    def end(self) -> str:
        """Wait for its end; what it said."""
        try:
            return self.process.communicate(timeout=60.0)[0]
        except subprocess.TimeoutExpired:
            for one in [*psutil.Process(self.process.pid).children(recursive=True), self.process]:
                one.kill()
            raise AssertionError(f"still running: {self.process.communicate()[0]}") from None


def assert_stopped(started: Started) -> None:
    """With a restart file that is sound, 75, and the truth in run.json."""
    told = started.end()
    assert started.process.returncode == 75, told
    assert "Traceback" not in told and told.count("by a signal, state in") == 1, told
    assert json.loads((started.directory / "run.json").read_text())["status"] == "stopped"
    assert newest_restart(started.directory) is not None
    assert not (started.directory / "run.lock").exists()


@pytest.mark.parametrize("name", SIGNALS)
def test_a_signal_during_the_imports(tmp_path, name):
    started = Started(tmp_path, 1)
    started.wait_for(started.is_listening)
    assert not (tmp_path / "run.json").exists()
    started.process.send_signal(getattr(signal, name))
    assert_stopped(started)


PASSED_ON = [(name, ranks) for name in SIGNALS for ranks in (1, 2, 4) if name != "SIGHUP" or ranks == 1]


@pytest.mark.parametrize(
    ("name", "ranks"),
    [("SIGINT", 2), *[pytest.param(*case, marks=pytest.mark.full) for case in PASSED_ON]],
)
@pytest.mark.parametrize("when", ["imports", "any time"])
def test_a_signal_to_the_launcher(tmp_path, name, ranks, when):
    """That of a keyboard goes to all that it has started, others reach them by mpiexec, which does not pass a hangup on
    but ends of it."""
    started = Started(tmp_path, ranks)
    started.wait_for(started.is_listening)
    if when == "any time":
        time.sleep(random.uniform(0.0, 4.0))
    started.process.send_signal(getattr(signal, name))
    assert_stopped(started)


def test_a_second_interrupt_ends_at_once(tmp_path):
    started = Started(tmp_path, 1, "output.restart_every=0")
    started.wait_for(started.is_listening)
    started.process.send_signal(signal.SIGINT)
    time.sleep(0.05)
    started.process.send_signal(signal.SIGINT)
    begun = time.monotonic()
    started.end()
    assert time.monotonic() - begun < 1.0
    assert started.process.returncode == -signal.SIGINT


def test_a_hangup_that_is_ignored_stays_ignored(tmp_path):
    """As under nohup."""
    started = Started(tmp_path, 1, "time.wall_clock_limit=6 s") if ignore_hangups() else None
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    started.wait_for(started.has_begun)
    started.process.send_signal(signal.SIGHUP)
    assert "time.wall_clock_limit, state in" in started.end()


def ignore_hangups() -> bool:
    """From now on, as do processes that are started."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    return True


def test_the_wall_clock_counts_from_the_start_of_the_program(tmp_path):
    """So that imports and compilation belong to it: a limit that they take up ends the run after its first step."""
    words = ["-m", "distfsi", SOD, "--threads", 1, "--set", f"output.directory={tmp_path}"]
    limit = ["--set", "time.wall_clock_limit=0.05", "--set", "time.end=1e9"]
    told = run_ranks(1, [*words, *limit], timeout=60.0, code=75)
    assert "after 1 steps by time.wall_clock_limit" in told


def test_a_picture_that_fails_is_told_and_the_run_is_done(tmp_path, monkeypatch, capsys):
    def fails(_):
        raise RuntimeError("no such font")

    monkeypatch.setattr(picture, "draw_summary", fails)
    run(load(SOD, ["domain.cells=16", "time.maximum_steps=2", f"output.directory={tmp_path}"]), Communicator(), 1)
    told = capsys.readouterr().out
    assert "warning: no picture could be drawn: RuntimeError: no such font" in told
    assert f"results in {tmp_path}\n" in told
    assert json.loads((tmp_path / "run.json").read_text())["status"] == "done"


def test_a_run_that_does_not_fit_into_memory_is_refused(tmp_path):
    """With the figure, before anything is allocated or made."""
    scene = load(SOD, ["domain.cells=100_000_000_000", f"output.directory={tmp_path / 'out'}"])
    with pytest.raises(
        InputError, match=r"domain.cells: 1e\+11 cells take .* GB at the least, and .* GB of memory are free"
    ):
        run(scene, Communicator(), 1)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("limit", "available"), [("max", None), ("3000000", 1e6), ("1000000", 0.0)])
def test_memory_is_that_of_the_control_group(tmp_path, limit, available):
    (tmp_path / "memory.max").write_text(limit + "\n")
    (tmp_path / "memory.current").write_text("2000000\n")
    found = available_memory(tmp_path)
    assert found > 1e6 if available is None else found == available


def test_a_reader_that_has_gone_does_not_end_a_run(tmp_path):
    """Nor does a terminal: what is written into a closed pipe is an error of the same kind."""
    words = ["run", str(SOD), "--set", "domain.cells=16", "--set", f"output.directory={tmp_path}"]
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([sys.executable, "-m", "distfsi", *words], stdout=writing, stderr=subprocess.PIPE, timeout=60)
    os.close(writing)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "run.json").read_text())["status"] == "done"
