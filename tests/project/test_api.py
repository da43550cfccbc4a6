"""distfsi from Python: the bits of the command, arrays equal to the files, errors with their faults."""

import json
import subprocess
import sys

import numpy as np
import pytest

import distfsi
from distfsi.output.fields import read_cells, read_particles, series
from distfsi.output.history import read_history
from launch import ENVIRONMENT, ROOT
from results import results

SOD = ROOT / "inputs/sod.toml"
TINY = {
    "domain.cells": 16,
    "performance.block_cells": 8,
    "performance.tile_cells": 8,
    "time.maximum_steps": 4,
    "gauges.middle": {"kind": "point", "position": 0.5},
}


def tiny(directory, **more):
    return distfsi.load(SOD, TINY | {"output.directory": str(directory)} | more)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The results of a run in this process."""
    return distfsi.run(tiny(tmp_path_factory.mktemp("here")), threads=1, progress=False)


def test_a_run_has_the_bits_of_the_command(tmp_path, made):
    changes = ["domain.cells=16", "performance.block_cells=8", "performance.tile_cells=8", "time.maximum_steps=4"]
    changes += ['gauges.middle={kind="point", position=0.5}', f"output.directory={tmp_path}"]
    command = [sys.executable, "-m", "distfsi", SOD, *(word for change in changes for word in ("--set", change))]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    assert results(tmp_path) == results(made.directory)


def test_results_are_what_is_in_the_files(made):
    assert made.status == "done" and repr(made).endswith(": done>")
    history = read_history(made.directory / "history.csv")
    assert np.array_equal(made.history["time"], history["time [s]"]) and made.history.units["time"] == "s"
    assert len(made.history["limited by"]) == len(made.history["time"])
    (time, path) = series(made.directory, "cells")[-1]
    cells = made.cells()
    assert cells.time == time == made.times()[-1] and made.cells(0.0).time == 0.0
    _, fields, lower, spacing = read_cells(path)
    assert set(cells) == set(fields) and cells.units["density"] == "kg/m³"
    assert all(np.array_equal(cells[name], fields[name], equal_nan=True) for name in cells)
    assert np.array_equal(cells.centers[0], lower[0] + (np.arange(16) + 0.5) * spacing[0])
    assert list(made.gauges) == ["middle"] and made.gauges["middle"].units["pressure"] == "Pa"
    assert made.scene == tiny(made.directory)
    assert made.scene.origin == tiny(made.directory).origin


def test_data_frames_and_datasets(made):
    frame = made.history.to_pandas()
    assert np.array_equal(frame["time [s]"], made.history["time"])
    dataset = made.cells().to_xarray()
    assert dataset["pressure"].dims == ("z", "y", "x") and dataset["pressure"].attrs["units"] == "Pa"
    assert np.array_equal(dataset["x"], made.cells().centers[0])


def test_particles(tmp_path):
    scene = distfsi.load(
        ROOT / "inputs/plate_impact.toml", {"time.maximum_steps": 2, "output.directory": str(tmp_path)}
    )
    result = distfsi.run(scene, threads=1, progress=False)
    _, columns = read_particles(series(tmp_path, "particles")[-1][1])
    particles = result.particles()
    assert set(particles) == set(columns)
    assert all(np.array_equal(particles[name], columns[name]) for name in columns)
    assert np.array_equal(particles.to_pandas()["velocity_x"], columns["velocity"][:, 0])


def test_ranks_are_started(tmp_path, made):
    result = distfsi.run(tiny(tmp_path), ranks=2, threads=1, progress=False)
    assert result.journal["ranks"] == 2
    assert results(tmp_path) == results(made.directory)


def test_errors_hold_all_faults(tmp_path):
    with pytest.raises(distfsi.InputError) as caught:
        distfsi.load(SOD, {"domain.cells": -1, "time.cfl": 3.0})
    assert len(caught.value.faults) == 2 and "domain.cells" in caught.value.faults[0]
    with pytest.raises(distfsi.InputError, match="no run has left"):
        distfsi.open(tmp_path)
    (tmp_path / "run.json").write_text(json.dumps({"status": "done"}))
    with pytest.raises(distfsi.InputError, match="does not tell the input"):
        _ = distfsi.open(tmp_path).scene
    with pytest.raises(KeyError, match="has no column 'nonsense', but"):
        _ = tiny_table(tmp_path)["nonsense"]


def tiny_table(directory):
    (directory / "history.csv").write_text("step,time [s]\n0,0.0\n")
    return distfsi.open(directory).history


@pytest.mark.parametrize("ranks", [None, 2])
def test_a_run_that_ends_early_raises_what_it_means(tmp_path, ranks):
    """Of the ranks that it starts, and of this process."""
    scene = tiny(tmp_path, **{"time.wall_clock_limit": "1 ms"})
    with pytest.raises(distfsi.Stopped, match="stopped"):
        distfsi.run(scene, ranks=ranks, threads=1, progress=False)
    assert distfsi.open(tmp_path).status == "stopped"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.5, "1.5"),
        (True, "true"),
        (None, "none"),
        ("5 kg", '"5 kg"'),
        ([1, (2.0, "a")], '[1, [2.0, "a"]]'),
        (np.array([1.0, 2.0]), "[1.0, 2.0]"),
        ({"kind": "point", "at": [0.5]}, '{"kind" = "point", "at" = [0.5]}'),
    ],
)
def test_values_become_toml(value, text):
    assert distfsi.api._as_toml(value) == text


def test_the_package_is_imported_at_once():
    """Names of the interface are found when they are asked for."""
    program = "import sys, distfsi; print('numpy' in sys.modules, 'run' in dir(distfsi), callable(distfsi.run))"
    done = subprocess.run([sys.executable, "-c", program], env=ENVIRONMENT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "True"]
