"""Inputs at the edge of what files, numbers and names can be: each is refused in words and at once, or is sound."""

import re
import time

import pytest

from distfsi.commands.line import main
from distfsi.errors import InputError
from distfsi.resources.report import report
from distfsi.scene import load
from distfsi.scene.faults import nearest
from launch import ROOT

INPUTS = {path.stem: path.read_text() for path in sorted((ROOT / "inputs").glob("*.toml"))}
SOD, TUBE = INPUTS["sod"], INPUTS["steel_tube"]
SECONDS = 5.0  # that a refusal may take


def with_line(text, start, instead):
    found, count = re.subn(rf"^{re.escape(start)}.*$", lambda _: instead, text, count=1, flags=re.MULTILINE)
    assert count == 1, start
    return found


def refused(path, *settings):
    """The lines with which an input is refused; within SECONDS."""
    begun = time.perf_counter()
    with pytest.raises(InputError) as told:
        load(path, settings)
    assert time.perf_counter() - begun < SECONDS
    assert told.value.faults
    assert all(len(line) < 1000 for line in told.value.faults)
    return told.value.faults


REGION = "\n[[fluid.regions]]\nphase = 'gas'\ndensity = -1\npressure = 'x'\n"
EDGES = {
    "10^400 cells": (with_line(SOD, "cells", f"cells = {10**400}"), "must be <= 1e+15"),
    "5000 digits": (with_line(SOD, "cells", f"cells = {'9' * 5000}"), "too many digits"),
    "2000 brackets": (with_line(SOD, "cells", f"cells = {'[' * 2000}{']' * 2000}"), "brackets"),
    "2000 brackets in a unit": (with_line(SOD, "lower", f"lower = '1 {'(' * 2000}m{')' * 2000}'"), "not understood"),
    "NUL in a phase": (SOD.replace("[fluid.phases.gas]", '[fluid.phases."g\\u0000as"]'), "NUL"),
    "NUL in a gauge": (SOD + '[gauges."a\\u0000"]\nkind = "point"\nposition = 0.5\n', "NUL"),
    "NUL in a directory": (SOD + '[output]\ndirectory = "a\\u0000b"\n', "output.directory"),
    "1e9 points": (SOD + "[gauges.a]\nkind = 'line'\nfrom = 0\nto = 1\npoints = 1_000_000_000\n", "must be <= 1e+06"),
    "block_cells of 1e30": (SOD + f"[performance]\nblock_cells = {10**30}\n", "must be <= 1e+15"),
    "a gauge of 300 letters": (SOD + f"[gauges.{'a' * 300}]\nkind = 'point'\nposition = 0.5\n", "300 letters"),
    "a folder of 300 letters": (SOD + f"[output]\ndirectory = 'out/{'a' * 300}'\n", "too long"),
    "10000 wrong regions": (SOD + 10_000 * REGION, "more faults"),
    "six phases": (
        SOD + "".join(f"[fluid.phases.{a}]\neos = 'ideal_gas'\ngamma = 1.4\n" for a in "abcde"),
        "fluid.phases: has 6 entries; at most 5",
    ),
    "a law in capitals": (TUBE.replace('eos = "jwl"', 'eos = "JWL"'), "did you mean 'jwl'?"),
}


@pytest.mark.parametrize("name", EDGES)
def test_what_lies_beyond_the_edge_is_refused(tmp_path, name):
    text, words = EDGES[name]
    path = tmp_path / "edge.toml"
    path.write_text(text)
    faults = refused(path)
    assert any(words in line for line in faults), faults
    assert len(faults) < 200


def test_files_that_are_no_input(tmp_path):
    assert "is no UTF-8 text" in refused(_written(tmp_path, b"\xff\xfe\x00"))[0]
    assert "is larger than" in refused(_written(tmp_path, b"#" * 64_000_001))[0]
    assert "no name of a file" in refused("a\0b.toml")[0]
    assert "cannot be read" in refused("a" * 300)[0]
    assert "cannot be read" in refused(tmp_path)[0]


def _written(folder, content):
    path = folder / "input.toml"
    path.write_bytes(content)
    return path


def test_what_lies_within_is_taken(tmp_path):
    """A mark of the byte order; an interval of almost nothing, which means each step; 1 g/cc."""
    scene = load(_written(tmp_path, b"\xef\xbb\xbf" + SOD.encode()), ["output.fields_every=5e-324"])
    assert report(scene).startswith(scene.title)
    assert "did you mean" not in report(scene)
    dense = load(ROOT / "inputs/sod.toml", ['fluid.regions.0.density="1 g/cc"'])
    assert dense.fluid.regions[0].state.density == 1000.0


def test_settings(tmp_path):
    sod = ROOT / "inputs/sod.toml"
    assert "x" in load(sod, ["gauges.x={kind='point', position=0.5}"]).gauges
    assert not load(sod, ["gauges.x={kind='point', position=0.5}", "gauges.x=none"]).gauges
    assert load(ROOT / "inputs/plate_impact.toml", ["solid.bodies.left.strength=none"]).solid.bodies[0].strength
    for setting in (
        f"domain.cells={'[' * 3000}",
        f"fluid.regions.{'9' * 5000}.density=1",
        f"domain.cells={'9' * 5000}",
    ):
        refused(sod, setting)
    assert "no such" in refused(ROOT / "inputs/plate_impact.toml", "solid.bodies.middle=none")[0]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["rnu", "scene.toml"], "did you mean the command 'run'?"),
        (["chekc", "scene.toml"], "did you mean the command 'check'?"),
        (["run", "scene.toml", "--threads", "-1"], "must be >= 1"),
        (["run", "scene.toml", "--threads", "0"], "must be >= 1"),
    ],
)
def test_the_command_line(tmp_path, monkeypatch, capsys, words, told):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_capitals_do_not_hide_a_word():
    assert nearest("JWL", ["jwl", "ideal_gas"]) == "jwl"
    assert nearest("Wall", ["wall", "outflow"]) == "wall"
    assert nearest("x" * 10**6, ["wall"]) is None


# ---- three hundred ---------------------------------------------------------------------------------------------------

VALUES = (
    str(10**400),
    "9" * 5000,
    "-1",
    "nan",
    "inf",
    "1e308",
    "5e-324",
    "true",
    "''",
    f"'{'x' * 300}'",
    "'1 furlong'",
    "'\\u0000'",
    '"a\\u0000"',
    "[]",
    "{}",
    "[[[[]]]]",
    "1979-05-27T07:32:00Z",
    "'-9e999 GPa'",
)


def broken_inputs():
    """Lines of some examples, each with each of VALUES."""
    for name in ("sod", "steel_tube", "plate_impact", "shock_bubble"):
        lines = INPUTS[name].splitlines()
        places = [n for n, line in enumerate(lines) if " = " in line and not line.startswith("#")]
        for n in places:
            key = lines[n].partition(" = ")[0]
            for value in VALUES:
                yield "\n".join([*lines[:n], f"{key} = {value}", *lines[n + 1 :]])


def test_three_hundred_broken_inputs(tmp_path, monkeypatch):
    """Those that are not refused are sound: a report is made of them."""
    monkeypatch.chdir(tmp_path)
    path, count, slowest = tmp_path / "broken.toml", 0, 0.0
    for text in broken_inputs():
        path.write_text(text)
        begun = time.perf_counter()
        try:
            load(path)
        except InputError as error:
            count += len(error.faults) > 0
        slowest = max(slowest, time.perf_counter() - begun)
    assert count >= 300
    assert slowest < SECONDS
    assert [entry.name for entry in tmp_path.iterdir()] == ["broken.toml"]
