"""The wheel, installed into an empty environment: every command works in an empty folder."""

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from distfsi.commands.study import STUDIES
from launch import ROOT


@pytest.fixture(scope="module")
def programs(tmp_path_factory) -> Path:
    """The folder of programs of a new environment that holds the wheel; the dependencies are those of this one."""
    folder = tmp_path_factory.mktemp("wheel")
    environment = folder / "environment"
    venv.create(environment, symlinks=True)
    (site,) = environment.glob("lib/python*/site-packages")
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"))  # no .pth files in there are followed
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", ROOT, "--no-deps", "--no-build-isolation", "--wheel-dir", folder], check=True)
    (wheel,) = folder.glob("*.whl")
    subprocess.run([*pip, "--python", environment, "install", "--no-deps", "--no-index", wheel], check=True)
    return environment / "bin"


@pytest.fixture
def execute(programs, tmp_path):
    """`execute(*words)` executes `distfsi *words` in an empty folder; what it printed."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment["LD_LIBRARY_PATH"] = f"{sys.prefix}/lib:{environment.get('LD_LIBRARY_PATH', '')}"  # an MPI of PyPI

    def execute(*words: str) -> str:
        ended = subprocess.run(
            [programs / "distfsi", *words], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended.stdout

    return execute


def test_an_example_is_run_in_an_empty_folder(programs, execute, tmp_path):
    script = "import distfsi, distfsi.scene.shipped as s; print(distfsi.__file__, s.shipped_inputs(), sep='\\n')"
    found = subprocess.run(
        [programs / "python", "-c", script], cwd=tmp_path, env={}, check=True, capture_output=True, text=True
    )
    assert all(Path(line).is_relative_to(programs.parent) for line in found.stdout.splitlines())
    assert len(execute("examples").splitlines()) == 2 * len(list((ROOT / "inputs").glob("*.toml")))
    assert execute("examples", "sod") == "sod.toml\n"
    assert execute("check", "sod.toml").startswith("Sod's shock tube\n")
    execute("sod.toml", "--threads", "1", "--set", "domain.cells=50")
    assert "ended" in execute("info", "out/sod")
    assert "out/sod/plots/history.png" in execute("plot", "out/sod").splitlines()
    assert '"title"' in execute("schema")
    assert execute("doctor").startswith("distfsi")
    assert {path.name for path in tmp_path.iterdir()} == {"sod.toml", "out"}


def test_a_study_is_run_in_an_empty_folder(execute, tmp_path):
    execute("study", "shock_bubble_speed", "--quick")
    assert {path.name for path in tmp_path.iterdir()} <= {"out"}


@pytest.mark.full
@pytest.mark.parametrize("study", STUDIES)
def test_every_study_has_a_quick_size(execute, study):
    execute("study", *study.split(), "--quick")
