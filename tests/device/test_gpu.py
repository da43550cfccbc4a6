"""Fluids and solids on a GPU's queues and memory, which the host stands in for: the bits of the CPU on any number of
ranks."""

import filecmp
import sys

import numpy as np
import pytest

import fake_cupy
import mpi_gpu
from distfsi import direct
from distfsi.device import cuda, host
from distfsi.device.gpu import Gpu
from distfsi.device.host import HostArray, HostRuntime
from distfsi.errors import InputError
from distfsi.execution import gpu_of_rank, run
from distfsi.mesh.communicator import Communicator
from distfsi.resources import works
from distfsi.scene import load
from distfsi.simulation import Simulation
from launch import ROOT, SUPPORT

SCRIPT = SUPPORT / "mpi_gpu.py"


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.full)])
def test_fluid_scenes_have_the_bits_of_the_cpu(mpiexec, ranks):
    assert mpiexec(ranks, SCRIPT, "scenes").count("same bits") == 3 * ranks


def test_solids_have_the_bits_of_the_cpu(mpiexec):
    """Both forms, on 2 ranks: particles change ranks, bonds are cut, there is debris."""
    assert mpiexec(2, SCRIPT, "solids").count("same bits") == 2 * 2


def test_a_coupled_scene_has_the_bits_of_the_cpu(mpiexec):
    """50 steps of the coarse steel tube with peaks, and one more after a restart, on 2 ranks; and by the paper's
    coupling 20."""
    assert mpiexec(2, SCRIPT, "coupled").count("same bits") == 2 * 2


@pytest.mark.full
def test_a_run_leaves_the_files_of_the_cpu(monkeypatch, tmp_path):
    """Bonded particles in a fluid."""
    monkeypatch.setattr("distfsi.execution.gpu_of", lambda rank, direct: Gpu(HostRuntime()))
    changes = (*mpi_gpu.COARSE, "solid.form=total_lagrangian", "output.schlieren=true", "time.maximum_steps=8")
    for name in ("cpu", "gpu"):
        given = (*changes, "output.fields_every=3e-7", f'output.directory="{tmp_path / name}"')
        run(load(ROOT / "inputs/steel_tube.toml", given), Communicator(), 1, on_gpu=name == "gpu")
    own = {"run.json", "status.txt", "performance.csv", "manifest.jsonl"}  # these name the run and its time
    files = sorted({path.name for path in (tmp_path / "cpu").glob("*.*") if path.suffix != ".h5"} - own)
    assert "history.csv" in files and "particles-000001.vtkhdf" in files
    assert filecmp.cmpfiles(tmp_path / "cpu", tmp_path / "gpu", files, shallow=False) == (files, [], [])


@pytest.mark.parametrize("form", ["updated_lagrangian", "total_lagrangian"])
def test_a_step_of_a_solid_copies_no_columns(form):
    """What goes between host and device in a step in which no particle changes blocks."""
    runtime, sizes = HostRuntime(), []
    simulation = Simulation.of(works.copper(16, 2, form), Communicator(), device=Gpu(runtime))
    simulation.step()
    for name, place in (("upload", 1), ("download", 0)):
        copy = getattr(runtime, name)
        setattr(runtime, name, lambda *a, copy=copy, place=place: (sizes.append(a[place].size), copy(*a)))
    simulation.step()
    assert simulation.solid.count == 256
    assert 0 < max(sizes) < 64


def test_every_wait_copy_and_order_is_needed(mpiexec):
    """On 2 ranks, with messages of the host and of the device; without the order before packing, that ends the run."""
    assert mpiexec(2, SCRIPT, "mutants").count("found") == 2 * (6 + 4 + 4 + 2)
    with pytest.raises(AssertionError, match="(?s)exit code.*begun"):
        mpiexec(2, SCRIPT, "fatal")


def test_arrays_of_the_device_stay_there():
    array = Gpu(HostRuntime()).array(np.arange(3.0))
    assert isinstance(array, HostArray)
    for misuse in (np.asarray, np.sum, lambda a: a + 1.0, lambda a: np.zeros(3) + a):
        with pytest.raises(TypeError):
            misuse(array)


@pytest.mark.gpu
@pytest.mark.parametrize("ranks", [1, 2])
def test_scenes_on_a_gpu_have_the_bits_of_the_cpu(mpiexec, ranks):
    """But for the last bits of powers and logarithms, which solids need."""
    printed = mpiexec(ranks, SCRIPT, "gpu")
    assert printed.count("same bits on") == printed.count("close on") == 3 * ranks


# ---- CuPy ------------------------------------------------------------------------------------------------------------


def on_the_host(name, text, architecture):
    """In the place of machine code: a library of the host."""
    assert architecture == "sm_90"
    return host.library(name, f"{text}\nHOST_LAUNCH({name})\n")


def test_the_calls_of_cupy(monkeypatch):
    """A whole fluid by way of device/cuda.py, with CuPy replaced: the bits of the CPU."""
    fake_cupy.install(monkeypatch)
    monkeypatch.setattr(cuda.nvrtc, "cubin", on_the_host)
    scene = mpi_gpu.scene(("air", "helium"), 2, riemann="adaptive")
    results = []
    for device in (None, cuda.gpu_of(3)):
        simulation = Simulation.of(scene, Communicator(), 1, device=device)
        for _ in range(3):
            simulation.step()
        results.append(simulation.fluid.state)
    assert np.array_equal(*results)
    assert all(fake_cupy.calls[name] > 9 for name in ("set", "get", "launch", "synchronize"))


def test_a_rank_without_gpu_says_why(monkeypatch):
    monkeypatch.setitem(sys.modules, "cupy", None)
    with pytest.raises(cuda.NoGpu, match="CuPy is not installed"):
        cuda.gpu_of(0)
    fake_cupy.install(monkeypatch, gpus=0)
    with pytest.raises(cuda.NoGpu, match="no GPU is visible"):
        cuda.gpu_of(0)


def test_a_run_without_gpu_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "cupy", None)
    with pytest.raises(InputError, match="CuPy is not installed"):
        gpu_of_rank(Communicator())


# ---- messages of a GPU's memory --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("says", "code", "why"),
    [
        (False, "", "does not take memory of GPUs"),
        (None, "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "failed: SIGSEGV"),
        (True, "raise SystemExit('it arrived otherwise')", "failed: it arrived otherwise"),
        (True, "import time; time.sleep(60)", "not arrived after"),
        (True, "import os; raise SystemExit(any('PMI' in name for name in os.environ))", ""),
    ],
)
def test_mpi_is_tried_in_another_process(monkeypatch, tmp_path, says, code, why):
    """Whatever that process dies of, with nothing in its environment that would make it a rank of this run."""
    python = tmp_path / "python"
    python.write_text(f"#!{sys.executable}\n{code}\n")
    python.chmod(0o700)
    monkeypatch.setenv("PMI_RANK", "1")
    monkeypatch.setattr(direct, "PATIENCE", 4.0)
    monkeypatch.setattr(direct.sys, "executable", str(python))
    communicator = Communicator()
    monkeypatch.setattr(communicator, "takes_gpu_memory", lambda: says)
    refusal = direct.refusal(communicator)
    assert why in refusal and bool(why) == bool(refusal)


def test_a_message_arrives_or_does_not(monkeypatch):
    """From memory of a device to another one's, by MPI."""
    communicator, gpu = Communicator(), Gpu(HostRuntime(), direct=True)
    assert direct.arrives(communicator, gpu)
    monkeypatch.setattr(communicator, "pass_on", lambda outgoing, incoming: None)
    assert not direct.arrives(communicator, gpu)


@pytest.mark.parametrize(("why", "arrives", "fault"), [("no", True, "no"), ("", False, "otherwise"), ("", True, "")])
def test_messages_of_a_gpus_memory_are_asked_for_and_tried(monkeypatch, why, arrives, fault):
    gpu = Gpu(HostRuntime(), direct=True)
    monkeypatch.setattr("distfsi.execution.gpu_of", lambda rank, direct: gpu)
    monkeypatch.setattr("distfsi.execution.refusal", lambda communicator: why)
    monkeypatch.setattr("distfsi.execution.arrives", lambda communicator, gpu: arrives)
    if fault:
        with pytest.raises(InputError, match=f"--gpu-aware-mpi: .*{fault}"):
            gpu_of_rank(Communicator(), direct=True)
    else:
        assert gpu_of_rank(Communicator(), direct=True) is gpu
