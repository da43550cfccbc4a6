"""An output directory belongs to one run at a time, and a run touches only what runs have made."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from test_kills import contents

from distfsi.commands.line import main
from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output import manifest
from distfsi.output.directory import held
from distfsi.output.history import read_history
from distfsi.scene import load
from launch import ROOT, SUPPORT

SOD = ROOT / "inputs" / "sod.toml"
TINY = ("domain.cells=16", "performance.block_cells=8", "performance.tile_cells=8", "time.maximum_steps=2")
GAUGE = 'gauges.middle={kind="point", position=0.5}'
FOREIGN = {
    "cells-2025-reference.vtkhdf": b"not a field file of this run",
    "restart-99backup.h5": b"nor a restart file",
    "gauges/measured.csv": b"time,pressure\n",
    "restart-0.h5": b"",
    "earlier-7": b"a file",
}


def go(directory, *settings, restart=None):
    """Run a tiny tube in this process."""
    run(load(SOD, [*TINY, f"output.directory={directory}", *settings]), Communicator(), 1, restart)


def put(directory, files):
    """Lay down these files."""
    for name, content in files.items():
        (directory / name).parent.mkdir(parents=True, exist_ok=True)
        (directory / name).write_bytes(content)


def test_what_no_run_has_made_stays(tmp_path):
    """Beside the files of a run, whatever it is called; also while these are set aside, and when they are removed."""
    put(tmp_path, FOREIGN)
    for _ in range(3):
        go(tmp_path, GAUGE)
        assert contents(tmp_path).items() >= FOREIGN.items()
    assert (tmp_path / "earlier-9" / "gauges" / "middle.csv").exists()
    (tmp_path / "earlier-8" / "mine.txt").write_text("mine")
    main(["clean", str(tmp_path)])
    found = contents(tmp_path)
    assert {name for name in found if name.startswith("earlier-")} == {"earlier-8/mine.txt", "earlier-7"}
    assert found.items() >= FOREIGN.items()


@pytest.mark.parametrize(
    "name",
    ["history.csv", "restart-00000007.h5", "cells-000000.vtkhdf", "gauges/middle.csv", "run.json", "summary.png"],
)
@pytest.mark.parametrize("restart", [None, "auto"])
def test_what_a_run_would_overwrite_is_named(tmp_path, name, restart):
    """In a folder where there was no run; nothing is touched."""
    put(tmp_path, {name: b"mine"})
    with pytest.raises(InputError, match=f"{name}: no run has made it, and this one would overwrite it"):
        go(tmp_path, GAUGE, restart=restart)
    assert contents(tmp_path) == {name: b"mine"}


def test_results_are_moved_only_when_the_new_run_can_begin(tmp_path, monkeypatch):
    """Not where there is no such GPU, nor where the first state cannot be built."""
    go(tmp_path)
    before = contents(tmp_path)
    scene = load(SOD, [*TINY, f"output.directory={tmp_path}"])
    with pytest.raises(InputError, match="--gpu"):
        run(scene, Communicator(), 1, None, True)
    assert contents(tmp_path) == before

    def fails(*_, **__):
        raise MemoryError

    monkeypatch.setattr("distfsi.execution.Simulation.of", fails)
    with pytest.raises(MemoryError):
        go(tmp_path)
    assert contents(tmp_path) == before
    with pytest.raises(MemoryError):
        go(tmp_path / "new" / "folder")
    assert not (tmp_path / "new").exists()


def test_what_was_set_aside_is_told_with_its_size(tmp_path, capfd):
    go(tmp_path)
    go(tmp_path)
    told = capfd.readouterr().out
    assert f"the results of an earlier run are now in {tmp_path}/earlier-1 (" in told
    assert f"distfsi clean {tmp_path}" in told
    main(["info", str(tmp_path)])
    assert "earlier-1: results that were set aside, " in capfd.readouterr().out
    main(["clean", str(tmp_path), "--dry-run"])
    assert (tmp_path / "earlier-1" / "history.csv").exists()
    main(["clean", str(tmp_path)])
    assert "removed" in capfd.readouterr().out and not (tmp_path / "earlier-1").exists()
    main(["clean", str(tmp_path)])
    assert "nothing was set aside" in capfd.readouterr().out


def test_a_manifest_leads_nowhere_else(tmp_path):
    """Names that lead out of the directory are no files of a run."""
    (tmp_path / "mine.txt").write_text("mine")
    lines = [{"run": "x"}, {"file": "../mine.txt"}, {"file": str(tmp_path / "mine.txt")}, {"aside": "../elsewhere"}]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "manifest.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    go(tmp_path / "out")
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_a_line_that_was_cut_short_is_none(tmp_path):
    manifest.begin(tmp_path)
    manifest.claim(tmp_path / "history.csv")
    with (tmp_path / "manifest.jsonl").open("a") as file:
        file.write('{"file": "mine')
    manifest.claim(tmp_path / "run.json")
    assert list(manifest.read(tmp_path).files) == ["history.csv", "run.json"]


# ---- one run per directory -------------------------------------------------------------------------------------------

HOLD = """
import sys, time
from pathlib import Path
from distfsi.output.directory import held
from one_rank import OneRank
with held(Path(sys.argv[1]), OneRank()):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the directory as a run does."""
    path = os.pathsep.join([str(ROOT), str(SUPPORT)])
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": path},
    )
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()


def test_a_second_run_is_refused_with_both_named(tmp_path, holder):
    """And what is there stays; a dead owner, however it died, holds nothing."""
    told = rf"is in use by process {holder.pid} on .*, started .*; this is process {os.getpid()} on .*, started "
    for restart in (None, "auto"):
        with pytest.raises(InputError, match=told):
            go(tmp_path, restart=restart)
    assert set(contents(tmp_path)) == {"run.lock"}
    holder.kill()
    holder.wait()
    assert (tmp_path / "run.lock").exists()
    go(tmp_path)
    assert not (tmp_path / "run.lock").exists()


def test_a_file_that_is_no_lock_stays(tmp_path):
    (tmp_path / "run.lock").write_text("mine")
    with pytest.raises(InputError, match="has a file run.lock that no run has made"):
        go(tmp_path)
    assert contents(tmp_path) == {"run.lock": b"mine"}


def test_a_directory_that_stays_empty_is_removed(tmp_path):
    class OneRank:
        rank = 0

        def broadcast(self, value):
            return value

    with held(tmp_path / "a" / "b", OneRank()):
        assert (tmp_path / "a" / "b").is_dir()
    assert list(tmp_path.iterdir()) == []


# ---- going on --------------------------------------------------------------------------------------------------------


def test_a_finished_run_is_extended(tmp_path):
    """Fields, history and gauges are appended; the rows and files that were there are there."""
    go(tmp_path, GAUGE, "output.history_every=1")
    before = contents(tmp_path)
    go(tmp_path, GAUGE, "output.history_every=1", "time.maximum_steps=5", restart="auto")
    after = contents(tmp_path)
    assert read_history(tmp_path / "history.csv")["step"].tolist() == [0, 1, 2, 3, 4, 5]
    for name in ("history.csv", "gauges/middle.csv"):
        assert after[name].startswith(before[name]) and len(after[name]) > len(before[name])
    fields = {name for name in before if name.startswith("cells-")}
    assert all(after[name] == before[name] for name in fields)
    assert len([name for name in after if name.startswith("cells-")]) == len(fields) + 1
    assert not list(tmp_path.glob("earlier-*"))


def test_a_finished_run_that_goes_on_to_the_same_end_stays(tmp_path):
    go(tmp_path, GAUGE)
    before = contents(tmp_path)
    go(tmp_path, GAUGE, restart="auto")
    after = contents(tmp_path)
    changing = {"run.json", "status.txt", "summary.png", "manifest.jsonl", "performance.csv"}
    assert {n: c for n, c in after.items() if n not in changing} == {
        n: c for n, c in before.items() if n not in changing
    }


def test_without_a_restart_file_results_are_set_aside(tmp_path):
    """auto begins at the start then; it does not write over what there is."""
    go(tmp_path, "output.restart_at_end=false")
    assert not list(tmp_path.glob("restart-*"))
    before = contents(tmp_path)
    go(tmp_path, restart="auto")
    aside = contents(tmp_path / "earlier-1")
    assert all(aside[name] == content for name, content in before.items() if name != "manifest.jsonl")


def test_results_of_another_run_are_not_joined(tmp_path):
    """Neither with a restart file of theirs nor with one that was put there."""
    go(tmp_path / "one")
    go(tmp_path / "other")
    foreign = tmp_path / "other" / "restart-00000002.h5"
    before = contents(tmp_path / "one")
    with pytest.raises(InputError, match=f"{foreign}: is not of the run whose results are in {tmp_path}/one"):
        go(tmp_path / "one", "time.maximum_steps=3", restart=str(foreign))
    assert contents(tmp_path / "one") == before
    go(tmp_path / "new", "time.maximum_steps=3", restart=str(foreign))
    (tmp_path / "one" / "restart-00000002.h5").write_bytes(foreign.read_bytes())
    with pytest.raises(InputError, match="is not of the run"):
        go(tmp_path / "one", "time.maximum_steps=3", restart="auto")


def test_a_scene_of_the_same_kind_with_another_number_is_refused(tmp_path):
    go(tmp_path)
    with pytest.raises(
        InputError, match="time.end, time.maximum_steps, time.cfl, and the numbers of ranks and threads"
    ):
        go(tmp_path, "fluid.phases.gas.gamma=1.3", restart="auto")


@pytest.mark.parametrize(
    ("name", "spoilt", "told"),
    [
        ("history.csv", lambda text: text.replace("\n1,", "\nx,", 1), "line 3: is no row of this file"),
        ("history.csv", lambda text: text.replace("step", "Step", 1), "has other columns"),
        ("gauges/middle.csv", lambda text: text.replace(",", "", 3), "has other columns"),
        ("cells.vtkhdf.series", lambda text: text[:-9], "is no list of field files"),
        ("cells.vtkhdf.series", lambda text: None, "is missing, though there are field files"),
        ("cells-000000.vtkhdf", lambda text: None, "cells-000000.vtkhdf: is missing"),
    ],
)
def test_damaged_files_are_not_continued(tmp_path, name, spoilt, told):
    """Nothing is removed or overwritten before all are known to be sound."""
    go(tmp_path, GAUGE, "output.history_every=1")
    path = tmp_path / name
    text = spoilt(path.read_text(errors="replace"))
    path.unlink() if text is None else path.write_text(text)
    before = contents(tmp_path)
    with pytest.raises(InputError, match=told):
        go(tmp_path, GAUGE, "output.history_every=1", "time.maximum_steps=3", restart="auto")
    assert contents(tmp_path) == before


# ---- the stop file ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["", ".", "..", "../stop", "/etc/hostname", "a" * 256, "a\\u0000b", "below/stop"])
def test_a_stop_file_lies_in_the_directory(tmp_path, name):
    with pytest.raises(
        InputError,
        match="output.stop_file .*(; expected the name of a file, which lies in the output|has no character NUL)",
    ):
        load(SOD, [f'output.stop_file="{name}"', f"output.directory={tmp_path}/out"])
    assert list(tmp_path.iterdir()) == []


def test_a_stop_file_may_be_named_by_its_path(tmp_path):
    scene = load(SOD, [f"output.stop_file={tmp_path}/halt", f"output.directory={tmp_path}"])
    assert scene.output.stop_file == "halt"


@pytest.mark.parametrize("make", ["a directory", "a file with words", "a link"])
def test_only_an_empty_stop_file_is_removed(tmp_path, make):
    stop = tmp_path / "stop"
    if make == "a directory":
        stop.mkdir()
    elif make == "a link":
        stop.symlink_to(tmp_path / "elsewhere")
    else:
        stop.write_text("mine")
    with pytest.raises(InputError, match="output.stop_file: .* is there and no empty file"):
        go(tmp_path)
    assert os.path.lexists(stop)


def test_files_that_runs_write_are_no_stop_files(tmp_path):
    with pytest.raises(InputError, match=r"output.stop_file: history.csv is the name of a file that runs write"):
        go(tmp_path, "output.stop_file=history.csv")
