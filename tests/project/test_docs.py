"""What the documents show does what they say."""

import re
import subprocess
import sys

import h5py
import numpy as np

from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output.fields import series
from distfsi.output.history import read_history
from distfsi.scene import load
from launch import ROOT

COARSE = ("domain.cells=[40, 40]", "solid.bodies.tube.spacing=1.2 mm", "time.maximum_steps=2", "output.fields_every=0")


def coarse_tube(tmp_path):
    """Directory of two steps of the tube."""
    directory = tmp_path / "out/steel_tube"
    run(load(ROOT / "inputs/steel_tube.toml", [*COARSE, f"output.directory={directory}"]), Communicator(), threads=1)
    return directory


def test_results_say_their_units_and_the_snippet_prints_a_number(tmp_path):
    """docs/paraview.md: cells in bodies hold none. Fields have units; in two dimensions totals are per metre."""
    directory = coarse_tube(tmp_path)
    (snippet,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/paraview.md").read_text(), flags=re.DOTALL)
    told = subprocess.run([sys.executable, "-c", snippet], cwd=tmp_path, capture_output=True, text=True, check=True)
    last_time, highest = map(float, told.stdout.split())
    assert last_time > 0.0
    assert np.isfinite(highest)
    assert highest > 1e9
    for kind, group, units in (
        ("cells", "CellData", {"pressure": "Pa", "density": "kg/m3", "velocity": "m/s"}),
        ("particles", "PointData", {"velocity": "m/s", "stress": "Pa", "energy": "J/kg", "temperature": "K"}),
    ):
        with h5py.File(series(directory, kind)[-1][1]) as file:
            data = file["VTKHDF"][group]
            assert {name: data[name].attrs["units"] for name in units} == units
            assert "units" not in data["volume_fraction" if kind == "cells" else "id"].attrs
    columns = read_history(directory / "history.csv")
    assert {"fluid energy [J/m]", "solid mass [kg/m]", "left momentum_x [N s/m]"} <= set(columns)
    assert not [name for name in columns if name.endswith((" [J]", " [kg]", " [N s]"))]


def test_the_page_on_python_runs(tmp_path):
    """docs/python.md, its blocks one after the other."""
    snippets = re.findall(r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(), flags=re.DOTALL)
    program = "\n".join(snippets).replace("inputs/", f"{ROOT}/inputs/")
    told = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    history, fields, frame, faults = told.stdout.splitlines()
    assert re.fullmatch(r"\S+e-07 s fluid CFL.*", history)
    assert re.fullmatch(r"\S+e-07 \S+ Pa \(\d+, 3\)", fields)
    assert frame == "step {'z': 1, 'y': 40, 'x': 40, 'component': 3}"
    assert faults == "2"
