"""The files in launch/: sound shell, jobs that start ranks with the right flags and go on after 75, binding."""

import json
import os
import re
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from distfsi import simulation
from distfsi.output.fields import series
from launch import ENVIRONMENT, ROOT, SUPPORT

FOLDER = ROOT / "launch"
SCRIPTS = sorted(path for path in FOLDER.rglob("*") if path.suffix in (".sh", ".sbatch", ".pbs", ".lsf"))
STUB = SUPPORT / "batch_stub.py"
SCENE = """
[domain]
lower = 0
upper = 1
cells = 64
[time]
end = 0.1
[fluid.phases.gas]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "gas"
density = 1
pressure = 1
[[fluid.regions]]
phase = "gas"
density = 0.125
pressure = 0.1
shape = { kind = "half_space", point = 0.5, normal = -1 }
[performance]
block_cells = [16]
"""


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: str(path.relative_to(FOLDER)))
def test_sound_shell(script):
    """By shellcheck where there is one."""
    command = ["shellcheck", "--external-sources"] if shutil.which("shellcheck") else ["bash", "-n"]
    if command[0] == "bash":
        warnings.warn("there is no shellcheck here: only the syntax was checked", stacklevel=1)
    result = subprocess.run([*command, script], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "CUDA_VISIBLE_DEVICES=" not in script.read_text()


def test_the_readme_names_every_file():
    text = (FOLDER / "README.md").read_text()
    files = {str(path.relative_to(FOLDER)) for path in [*SCRIPTS, *FOLDER.rglob("*.def")]}
    assert set(re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)) == files


# ---- batch systems ---------------------------------------------------------------------------------------------------


@pytest.fixture
def cluster(tmp_path):
    """Commands of batch systems, a scene and its output folder; `run` submits a job."""
    programs, log, out = tmp_path / "bin", tmp_path / "log", tmp_path / "out"
    programs.mkdir()
    for name in ("sbatch", "srun", "scontrol", "qsub", "bsub"):
        program = programs / name
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{STUB}" {name} "$@"\n')
        program.chmod(0o755)
    (programs / "activate").write_text(f'PATH="{Path(sys.executable).parent}:$PATH"\n')
    scene = tmp_path / "scene.toml"
    scene.write_text(f'{SCENE}[output]\ndirectory = "{out}"\n')
    path = f"{programs}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = os.environ | ENVIRONMENT | {"PATH": path, "VENV": str(tmp_path), "BATCH_LOG": str(log)}

    def run(*command: object, code: int, script: Path | None = None, **variables: str) -> list:
        """Submit a job, which must end with `code`; the calls of the batch system's commands."""
        log.write_text("")
        result = subprocess.run(
            list(map(str, command)),
            cwd=ROOT,
            env=environment | variables,
            input=script.read_text() if script else None,
            timeout=120,
            capture_output=True,
            text=True,
        )
        assert result.returncode == code, result.stdout + result.stderr
        return [json.loads(line) for line in log.read_text().splitlines()]

    return SimpleNamespace(run=run, scene=scene, out=out)


STOPS_EARLY = ("--set", "time.wall_clock_limit=1e-3")


def test_slurm(cluster):
    """A run that stops early goes back into the queue, and goes on there to its end."""
    script = FOLDER / "slurm" / "cpu.sbatch"
    calls = cluster.run("sbatch", script, cluster.scene, *STOPS_EARLY, code=75)
    assert [call[0] for call in calls] == ["sbatch", "srun", "scontrol"]
    assert calls[-1][1] == ["requeue", "4711"]
    calls = cluster.run("sbatch", script, cluster.scene, code=0)
    assert [call[0] for call in calls] == ["sbatch", "srun"]
    assert series(cluster.out, "cells")[-1][0] == 0.1


@pytest.mark.parametrize(
    ("job", "nodes", "gpus", "cpus"),
    [("cpu", "2", [], "16"), ("1node-4gpu", "1", ["4"], "8"), ("multi-node", "4", ["4"], "8")],
)
def test_flags_of_slurm_jobs(cluster, job, nodes, gpus, cpus):
    script = FOLDER / "slurm" / f"{job}.sbatch"
    (_, options), (_, flags, environment) = cluster.run("sbatch", script, cluster.scene, "--set", "time.end=-1", code=2)
    assert (options["nodes"], options["gpus-per-node"], options["cpus-per-task"]) == ([nodes], gpus, [cpus])
    assert (options["signal"], options["open-mode"], options["requeue"]) == (["USR1@300"], ["append"], True)
    assert flags == {"cpu-bind": ["cores"], "kill-on-bad-exit": ["0"], "wait": ["30"]}
    assert environment == {"gpu_bind": "none" if gpus else None, "cpus": cpus}


def test_pbs(cluster):
    """A run that stops early submits a job that waits for the end of this one."""
    script = "launch/pbs/cpu.pbs"
    first, second = cluster.run("qsub", "-v", f"INPUT={cluster.scene},LIMIT=1e-3", script, code=75)
    assert first[1]["l"] == ["select=2:ncpus=128:mpiprocs=8", "place=scatter:excl", "walltime=04:00:00"]
    assert second[2]["W"] == ["depend=afterany:4711.server"]
    assert second[2]["v"] == [f"INPUT={cluster.scene},LIMIT=1e-3"]
    (call,) = cluster.run("qsub", "-v", f"INPUT={cluster.scene}", script, code=0)
    assert series(cluster.out, "cells")[-1][0] == 0.1


def test_lsf(cluster):
    """LSF itself puts a job back into the queue that exits with 75."""
    script = FOLDER / "lsf" / "cpu.lsf"
    cluster.scene.write_text(cluster.scene.read_text().replace("end = 0.1", "end = 0.1\nwall_clock_limit = 1e-3"))
    ((_, options),) = cluster.run("bsub", script=script, INPUT=str(cluster.scene), code=75)
    assert (options["Q"], options["wa"], options["wt"]) == (["75"], ["USR1"], ["5"])


def test_a_task_of_a_job_array_runs_its_variant(cluster, tmp_path):
    """Slurm, PBS and LSF; the results are those of the sweep's folder."""
    table = tmp_path / "designs.csv"
    table.write_text("title,output.fields_every\nfirst,0.1\nsecond,0.1\n")
    out = ROOT / "out/scene-sweep"
    script = FOLDER / "slurm" / "cpu.sbatch"
    try:
        cluster.run("sbatch", script, cluster.scene, "--table", table, code=0, SLURM_ARRAY_TASK_ID="2")
        assert [path.name for path in sorted(out.iterdir())] == ["002"]
        given = f"INPUT={cluster.scene},TABLE={table}"
        cluster.run("qsub", "-v", given, "launch/pbs/cpu.pbs", code=0, PBS_ARRAY_INDEX="1")
        assert [path.name for path in sorted(out.iterdir())] == ["001", "002"]
        script = FOLDER / "lsf" / "cpu.lsf"
        names = {"INPUT": str(cluster.scene), "TABLE": str(table), "LSB_JOBINDEX": "3"}
        cluster.run("bsub", script=script, code=2, **names)
        (call,) = cluster.run("qsub", "-v", f"{given},INDEX=2,LIMIT=1e-9", "launch/pbs/cpu.pbs", code=0)
        assert call[0] == "qsub"  # it was done before, so nothing has stopped early
    finally:
        shutil.rmtree(out, ignore_errors=True)


# ---- binding ---------------------------------------------------------------------------------------------------------

TELL = """
import os
os.write(1, f"{sorted(os.sched_getaffinity(0))} {os.environ['CUDA_VISIBLE_DEVICES']}\\n".encode())
"""


def bound(*command: object, code: int = 0, **variables: str) -> str:
    """What a command prints whose last words are launch/bind.sh and a Python that tells its CPUs."""
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith(("MPI_", "OMPI_", "SLURM_"))
    }
    environment |= {"CUDA_VISIBLE_DEVICES": "2,3"} | ENVIRONMENT | variables
    words = [*map(str, command), FOLDER / "bind.sh", sys.executable, "-c", TELL]
    result = subprocess.run(words, env=environment, timeout=60, capture_output=True, text=True)
    assert result.returncode == code, result.stderr
    return result.stdout + result.stderr


def test_ranks_of_a_node_share_its_cpus():
    mpiexec = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    lines = bound(mpiexec, "-n", 2).splitlines()
    sets = [json.loads(line.split("] ")[0] + "]") for line in lines]
    assert all(line.endswith("] 2,3") for line in lines)
    cpus = sorted(psutil.Process().cpu_affinity())
    assert sorted(sum(sets, [])) == (cpus if len(cpus) > 1 else cpus * 2)
    assert abs(len(sets[0]) - len(sets[1])) <= 1


def test_cpus_of_ranks_can_be_chosen():
    cpu = psutil.Process().cpu_affinity()[-1]
    assert bound(CPU_SETS=f"999:{cpu}", OMPI_COMM_WORLD_LOCAL_RANK="1") == f"[{cpu}] 2,3\n"
    assert "none for rank 1" in bound(CPU_SETS=str(cpu), SLURM_LOCALID="1", code=1)


def test_binding_needs_a_launcher():
    assert "does not tell the rank" in bound(code=1)


def test_threads_of_ranks_that_share_cores(monkeypatch):
    """Three ranks of one node, two of which may use the same eight cores."""
    monkeypatch.setattr(
        simulation, "psutil", SimpleNamespace(Process=lambda: SimpleNamespace(cpu_affinity=lambda: [*range(8)]))
    )
    others = [(simulation.platform.node(), [8, 9]), (simulation.platform.node(), [*range(8)])]
    assert simulation.threads_of_rank(SimpleNamespace(allgather=lambda own: [own, *others])) == 4
    assert simulation.threads_of_rank(SimpleNamespace(allgather=lambda own: [own, ("elsewhere", own[1])])) == 8


# ---- launcher and library --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["PMI_SIZE", "OMPI_COMM_WORLD_SIZE"])
def test_ranks_that_do_not_know_each_other(tmp_path, name):
    """What each of two ranks does that a launcher of another MPI has started."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    command = [sys.executable, "-m", "distfsi", scene, "--set", f"output.directory={tmp_path / 'out'}"]
    result = subprocess.run(command, env=os.environ | {name: "2"}, cwd=ROOT, timeout=60, capture_output=True, text=True)
    assert result.returncode == 2
    for words in (f"the launcher started 2 ranks ({name})", "each runs alone", "do not match", "mpiexec that belongs"):
        assert words in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "out").exists()


# ---- parallel HDF5 ---------------------------------------------------------------------------------------------------


def test_parallel_hdf5_needs_an_environment_with_the_mpi_of_the_machine(tmp_path):
    script = FOLDER / "install-parallel-hdf5.sh"
    none = subprocess.run([script, tmp_path], capture_output=True, text=True)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "python").symlink_to(sys.executable)
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "libmpi.so.12").touch()
    own = subprocess.run([script, tmp_path], capture_output=True, text=True)
    assert none.returncode == own.returncode == 1
    assert "holds no virtual environment; make it with: MPI=site launch/setup.sh" in none.stderr
    assert "holds an MPI of its own" in own.stderr
