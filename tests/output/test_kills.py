"""Runs that are killed before their n-th file operation, and at any step on any number of ranks: nothing is lost, and
what goes on comes to the same bits. `pytest -m full tests/output/test_kills.py --kills 200` kills more often.
"""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from launch import ENVIRONMENT, ROOT, SUPPORT, run_ranks
from results import results

SCENE = ROOT / "inputs" / "sod.toml"
TINY = (
    "domain.cells=16",
    "performance.block_cells=8",
    "performance.tile_cells=8",
    "output.fields_every=1e-9",
    "output.history_every=1",
    "output.restart_every=1 ns",
    'gauges.middle={kind="point", position=0.5}',
    'gauges.line={kind="line", from=0.1, to=0.9, points=3}',
)
MINE = {
    "notes.txt": b"mine",
    "cells-2025-reference.vtkhdf": b"of another year",
    "restart-99backup.h5": b"a copy",
    "gauges/measured.csv": b"time [s],pressure [Pa]\n0,1e5\n",
    "earlier-1/notes.txt": b"not set aside by a run",
}


class Killed:
    """Runs of one kind in one directory, each in a process that is forked from one that has imported all."""

    def __init__(self, directory: Path, restart: str, *settings: str):
        words = [str(SCENE), restart, f"output.directory={directory}", *TINY, *settings]
        self.said = tempfile.TemporaryFile("w+")  # noqa: SIM115
        self.process = subprocess.Popen(
            [sys.executable, str(SUPPORT / "killing.py"), *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.said,  # a file: a pipe that nobody empties would stop the runs
            text=True,
            env=ENVIRONMENT | {"PATH": "/usr/bin:/bin", "HOME": str(Path.home())},
        )

    def run(self, before: int = 0) -> tuple[int, int]:
        """Exit code and number of operations of a run that is killed before this one; 0: not killed."""
        print(before, file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline()
        assert answer, self._words()
        code, count = map(int, answer.split())
        return code, count

    def __enter__(self):
        return self

    def _words(self) -> str:
        self.said.seek(0)
        return self.said.read()

    def __exit__(self, *_):
        self.process.communicate()
        self.said.close()


def contents(directory: Path) -> dict[str, bytes]:
    """All files below a directory by name."""
    return {str(p.relative_to(directory)): p.read_bytes() for p in sorted(directory.rglob("*")) if p.is_file()}


def put(directory: Path, files: dict[str, bytes]) -> None:
    """Have these files, and no others, in a directory."""
    shutil.rmtree(directory, ignore_errors=True)
    for name, content in files.items():
        (directory / name).parent.mkdir(parents=True, exist_ok=True)
        (directory / name).write_bytes(content)


@pytest.fixture
def more_kills(request):
    """How many kills were asked for on the command line, 0 if none were."""
    return request.config.getoption("kills") or 0


def points_of(count: int, wanted: int) -> list[int]:
    """So many of the operations, all over the run."""
    return list(range(1, count + 1)) if wanted >= count else sorted(random.sample(range(1, count + 1), wanted))


@pytest.mark.parametrize("wanted", [3, pytest.param(40, marks=[pytest.mark.full, pytest.mark.timeout(7200)])])
def test_a_start_upon_earlier_results(tmp_path, wanted, more_kills):
    """Killed at any file operation: each earlier file is in the directory or set aside, bytes as they were; what no run
    has made stays where it is; the next start makes the same results as in an empty directory."""
    directory = tmp_path / "out"
    put(directory, MINE)
    with Killed(directory, "none", "time.maximum_steps=2") as first:
        assert first.run()[0] == 0
    earlier = contents(directory)
    assert earlier.items() >= MINE.items()
    made = {name: content for name, content in earlier.items() if name not in MINE and name != "manifest.jsonl"}
    assert {"history.csv", "run.json", "summary.png", "gauges/middle.csv", "gauges/line.csv"} < made.keys()
    with Killed(directory, "none", "time.maximum_steps=3") as second:
        assert second.run()[1] > 100
        undisturbed = results(directory)
        aside = directory / "earlier-2"
        assert {name: content for name, content in contents(aside).items() if name != "manifest.jsonl"} == made
        put(directory, earlier)
        count = second.run()[1]
        points = points_of(count, max(wanted, more_kills))
        for point in points:
            put(directory, earlier)
            assert second.run(point)[0] == -9, point
            found = contents(directory)
            assert found.items() >= MINE.items(), point
            for name, content in made.items():
                assert content in (found.get(name), found.get(f"earlier-2/{name}")), (point, name)
            assert second.run()[0] == 0, point
            found = contents(directory)
            assert found.items() >= MINE.items(), point
            for name, content in made.items():
                assert found[f"earlier-2/{name}"] == content, (point, name)
            assert results(directory) == undisturbed | {"gauges/measured.csv": MINE["gauges/measured.csv"]}, point
    print(f"killed at {len(points)} of {count} operations")


@pytest.mark.parametrize("wanted", [2, pytest.param(30, marks=[pytest.mark.full, pytest.mark.timeout(7200)])])
def test_a_finished_run_that_is_extended(tmp_path, wanted, more_kills):
    """Killed at any file operation, it goes on in the end to the files of a run that was extended undisturbed."""
    directory = tmp_path / "out"
    with Killed(directory, "none", "time.maximum_steps=2") as first:
        assert first.run()[0] == 0
    finished = contents(directory)
    with Killed(directory, "auto", "time.maximum_steps=5") as extended:
        code, count = extended.run()
        assert code == 0
        undisturbed = results(directory)
        points = points_of(count, max(wanted, more_kills))
        for point in points:
            put(directory, finished)
            assert extended.run(point)[0] == -9, point
            assert extended.run()[0] == 0, point
            assert results(directory) == undisturbed, point
    print(f"killed at {len(points)} of {count} operations")


@pytest.mark.parametrize(
    ("steps", "kills"),
    [(120, 4), pytest.param(600, 30, marks=[pytest.mark.full, pytest.mark.timeout(7200)])],
)
def test_a_week_in_a_minute(tmp_path, steps, kills, more_kills):
    """A restart file every ten steps; killed at random moments, each time going on with another number of ranks."""
    script = SUPPORT / "mpi_kills.py"
    steps, kills = (20 * more_kills, more_kills) if more_kills else (steps, kills)
    settings = (
        *("domain.cells=64", "performance.block_cells=8", "performance.tile_cells=8", "time.cfl=0.05", "time.end=10"),
        *(f"time.maximum_steps={steps}", "output.fields_every=0.01", "output.history_every=7"),
        'gauges.middle={kind="point", position=0.5}',
    )
    done = killed = 0

    def go_on(directory: Path, ranks: int, last: int) -> None:
        words = [f"output.directory={directory}", *settings]
        sets = [word for setting in words for word in ("--set", setting)]
        arguments = [script, last, "run", SCENE, "--threads", 1, "--restart", "auto", *sets]
        run_ranks(ranks, arguments, timeout=120.0, code=0 if last == 0 else None)

    go_on(tmp_path / "undisturbed", 1, 0)
    for _ in range(kills):
        done = min(done + random.randint(1, 2 * steps // kills), steps - 1)
        go_on(tmp_path / "killed", random.choice((1, 2, 4)), done)
        killed += 1
    go_on(tmp_path / "killed", 1, 0)
    assert killed == kills
    assert results(tmp_path / "killed") == results(tmp_path / "undisturbed")
