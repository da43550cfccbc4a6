"""Sweeps: which variants they have, that each is run once, and what is collected of them."""

import csv
import subprocess
import sys

import pytest

from distfsi import sweep as sweeps
from distfsi.errors import InputError
from distfsi.output.journal import read_journal
from launch import ENVIRONMENT, ROOT, run_ranks

SOD = ROOT / "inputs/sod.toml"
SETTINGS = (
    *("domain.cells=16..32:2", "fluid.reconstruction=minmod | van_leer"),
    *("performance.block_cells=8", "performance.tile_cells=8", "time.maximum_steps=4"),
    'gauges.middle={kind="point", position=0.6}',
)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("5 kg", ["5 kg"]),
        ("1..5 kg:5", ["1 kg", "2 kg", "3 kg", "4 kg", "5 kg"]),
        ("1 .. 2 : 3", ["1", "1.5", "2"]),
        ("-1..1:3", ["-1", "0", "1"]),
        ("1..100:3 log", ["1", "10", "100"]),
        ("0.1..0.3 g/cm3:2", ["0.1 g/cm3", "0.3 g/cm3"]),
        ("minmod | van_leer", ["minmod", "van_leer"]),
        ("[0, 1]", ["[0, 1]"]),
        ('{kind="point", position=0.5}', ['{kind="point", position=0.5}']),
        ('"out/../here"', ['"out/../here"']),
    ],
)
def test_values(text, values):
    assert sweeps.values_of(text) == values


@pytest.mark.parametrize("text", ["1..5", "a..b:3", "1..:3", "0..1:3 log", "1..2:x"])
def test_what_is_no_range(text):
    with pytest.raises(InputError, match="is no range; expected such as"):
        sweeps.values_of(text)


def test_variants_are_all_combinations(tmp_path):
    sweep = sweeps.plan(SOD, tmp_path, SETTINGS)
    assert sweep.varied == ["domain.cells", "fluid.reconstruction"]
    chosen = [tuple(variant.settings[key] for key in sweep.varied) for variant in sweep.variants]
    assert chosen == [("16", "minmod"), ("16", "van_leer"), ("32", "minmod"), ("32", "van_leer")]
    assert [variant.directory.name for variant in sweep.variants] == ["001", "002", "003", "004"]


def test_a_table_has_a_row_per_variant(tmp_path):
    table = tmp_path / "designs.csv"
    table.write_text('domain.cells,fluid.reconstruction\n16,minmod\n32,"van_leer"\n\n')
    sweep = sweeps.plan(SOD, tmp_path, ["time.maximum_steps=4"], table)
    wanted = [{"domain.cells": "16", "fluid.reconstruction": "minmod", "time.maximum_steps": "4"},
              {"domain.cells": "32", "fluid.reconstruction": "van_leer", "time.maximum_steps": "4"}]  # fmt: skip
    assert [dict(variant.settings) for variant in sweep.variants] == wanted


@pytest.mark.parametrize(
    ("settings", "table", "fault"),
    [
        ((), None, "a sweep needs something that varies"),
        (("domain.cells",), None, "expected key.path=values"),
        (("domain.cells=1..1000:200", "time.cfl=0.1..0.9:100"), None, "at most 10000 variants"),
        ((), "a,b\n1\n", "row 1 has 1 values for 2 keys"),
        ((), "a,b\n", "has no rows below its keys"),
    ],
)
def test_faults(tmp_path, settings, table, fault):
    path = tmp_path / "designs.csv"
    if table is not None:
        path.write_text(table)
    with pytest.raises(InputError, match=fault):
        sweeps.plan(SOD, tmp_path, settings, path if table is not None else None)


def test_faults_of_variants_are_told_before_any_runs(tmp_path):
    sweep = sweeps.plan(SOD, tmp_path / "out", ["time.cfl=0.5 | 3 | 4", "domain.cells=0"])
    with pytest.raises(InputError) as caught:
        sweep.check()
    text = str(caught.value)
    assert "domain.cells" in text and "(in 001, 002, 003)" in text and "time.cfl" in text
    assert not (tmp_path / "out").exists()


def execute(*words, code=0):
    command = [sys.executable, "-m", "distfsi", "sweep", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280, env=ENVIRONMENT | {"PATH": "/usr/bin"})
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


def test_a_sweep(tmp_path):
    """Each variant is run once, or goes on; one that was run on ranks by its number counts."""
    words = [SOD, "-o", tmp_path, *(word for setting in SETTINGS for word in ("--set", setting))]
    assert len(execute(*words, "--list").splitlines()) == 4
    run_ranks(2, ["-m", "distfsi", "sweep", *words, "--only", "2", "--threads", "1"], 120)
    assert read_journal(tmp_path / "002")["ranks"] == 2
    told = execute(*words, "--jobs", "2")
    assert "002: done before" in told and told.count(": done\n") == 3
    assert f"4 of 4 variants done; results in {tmp_path}/sweep.csv, chart in {tmp_path}/sweep.png" in told
    with (tmp_path / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows] == ["done"] * 4
    assert [row["domain.cells"] for row in rows] == ["16", "16", "32", "32"]
    assert all(0.1 <= float(row["middle pressure [Pa]"]) <= 1.0 for row in rows)
    assert execute(*words).count("done before") == 4
    assert "there are 4 variants" in run_ranks(1, ["-m", "distfsi", "sweep", *words, "--only", "5"], 60, code=2)


def test_a_variant_that_fails_is_told_and_the_others_run(tmp_path):
    words = ["--set", "time.smallest_step=1e-9 | 0.999", "--set", "domain.cells=16", "--set", "time.maximum_steps=20"]
    told = execute(SOD, "-o", tmp_path, *words, code=3)
    assert "001: time.smallest_step = 1e-9: done" in told
    assert f"exit code 3, {tmp_path}/002.log" in told and "1 of 2 variants done" in told
