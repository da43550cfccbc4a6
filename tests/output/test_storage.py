"""The ways to write HDF5 give the same files; full disks and unusable folders end a run on all ranks with a message."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import h5py
import pytest
from test_output import contents, read_with_vtk, same

import launch
from distfsi.errors import InputError
from distfsi.output.directory import held
from distfsi.output.fields import read_cells, series
from distfsi.output.history import read_history
from distfsi.output.storage import storage
from launch import SUPPORT
from one_rank import OneRank

SCRIPT = SUPPORT / "mpi_output.py"
NOBODY = 65534  # a user without rights
SOD = (
    "run",
    launch.ROOT / "inputs/sod.toml",
    *("--threads", 1),
    *("--set", "performance.block_cells=[128]"),
    *("--set", "output.fields_every=0.01"),
    *("--set", "output.history_every=1"),
)
LIMITED = """
import resource, runpy, sys
from mpi4py import MPI  # starts up with files of its own
limit = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
runpy.run_module("distfsi", run_name="__main__")
"""


def same_files(one: Path, other: Path) -> int:
    """Compare all files of two folders, the HDF5 files by what they hold; how many there are."""
    files = sorted(path.relative_to(one) for path in one.rglob("*.vtkhdf*"))
    assert sorted(path.relative_to(other) for path in other.rglob("*.vtkhdf*")) == files
    for file in files:
        if file.suffix == ".series":
            assert (one / file).read_text() == (other / file).read_text()
        else:
            assert same(contents(one / file), contents(other / file)), file
    return len(files)


@pytest.fixture(scope="module")
def written(mpiexec, tmp_path_factory) -> Path:
    """What mpi_output.py writes on one rank."""
    directory = tmp_path_factory.mktemp("mpi-io")
    mpiexec(1, SCRIPT, directory, seconds=120)
    return directory


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_rank_0_alone_writes_the_same_files(mpiexec, written, tmp_path, ranks):
    mpiexec(ranks, SCRIPT, tmp_path, "gather", seconds=120)
    assert same_files(written, tmp_path) > 20


@pytest.fixture
def parallel_hdf5(monkeypatch):
    """Ranks start in an environment made by launch/install-parallel-hdf5.sh: this one, or PARALLEL_HDF5_PYTHON's."""
    python = os.environ.get("PARALLEL_HDF5_PYTHON", sys.executable if h5py.get_config().mpi else None)
    if python is None:
        pytest.skip('NOT RUN: output.hdf5 = "mpio" is untested here; set PARALLEL_HDF5_PYTHON to a Python that has it')
    own = str(Path(sys.executable).parent)  # its mpiexec may belong to another MPI
    monkeypatch.setenv("PATH", os.pathsep.join(p for p in os.environ["PATH"].split(os.pathsep) if p != own))
    monkeypatch.setattr(sys, "executable", python)


@pytest.mark.full
@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("hdf5", ["mpio", "mpi-io", "gather"])
def test_parallel_hdf5_writes_the_same_files(mpiexec, written, tmp_path, parallel_hdf5, hdf5, ranks):
    """So do the other ways with that h5py, whose HDF5 may be older."""
    mpiexec(ranks, SCRIPT, tmp_path, hdf5, seconds=120)
    assert same_files(written, tmp_path) > 20


def test_parallel_hdf5_is_refused_where_it_is_missing(monkeypatch):
    monkeypatch.setattr(h5py, "get_config", lambda: SimpleNamespace(mpi=False))
    with pytest.raises(InputError, match=r'output.hdf5: "mpio" needs .*install-parallel-hdf5.sh .*"mpi-io"'):
        storage("mpio", None)


# ---- full disks ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def complete(mpiexec, tmp_path_factory) -> Path:
    """The run of SOD with room for all its files."""
    directory = tmp_path_factory.mktemp("complete")
    mpiexec(2, "-m", "distfsi", *SOD, "--set", f"output.directory={directory}")
    return directory


def assert_failed_well(output: str, file: str, cause: str, directory: Path, complete: Path) -> int:
    """One message and no traceback; what is listed is what the complete run has; how many files that is."""
    (message,) = [line for line in output.splitlines() if "could not be written" in line]
    assert f"{directory}/{file}" in message and cause in message and "MB are free there" in message
    assert "Traceback" not in output
    listed = series(directory, "cells")
    for time, path in listed:
        assert read_with_vtk(path).GetNumberOfCells() == 400
        assert read_cells(path)[0] == time
        assert same(contents(path), contents(complete / path.name))
    assert not list(directory.glob("*.vtkhdf.tmp"))
    return len(listed)


@pytest.mark.parametrize("rank_in_need", [0, 1])
def test_all_ranks_see_the_error_of_one(mpiexec, tmp_path, rank_in_need):
    """Small files are written, large ones only where the rank with the limit does not write; what is there stays."""
    output = mpiexec(2, SCRIPT.with_name("mpi_storage.py"), tmp_path, rank_in_need, seconds=60)
    mpi_io_small, mpi_io, gather_small, gather = (line for line in output.splitlines() if ": " in line)
    assert mpi_io_small.endswith("40: written") and gather_small.endswith("40: written")
    assert "mpi-io.h5.tmp could not be written: File too large" in mpi_io
    assert ("could not be written: File too large" in gather) == (rank_in_need == 0)
    with h5py.File(tmp_path / "mpi-io.h5") as file:
        assert file["values"][()].tolist() == list(range(80))


@pytest.mark.parametrize(
    ("hdf5", "limit", "file", "frames"),
    [("mpi-io", 12_000, "cells-000000.vtkhdf.tmp", 0), ("gather", 45_000, "history.csv", 8)],
)
def test_a_file_that_grows_too_large(mpiexec, complete, tmp_path, hdf5, limit, file, frames):
    """The system's limit on the size of a file stops the first field file, or the history after a while."""
    words = (*SOD, "--set", f"output.directory={tmp_path}", "--set", f"output.hdf5={hdf5}")
    output = mpiexec(2, "-c", LIMITED, limit, *words, exit_code=74, seconds=60)
    assert assert_failed_well(output, file, "File too large", tmp_path, complete) >= frames
    if frames:
        history, whole = read_history(tmp_path / "history.csv"), read_history(complete / "history.csv")
        assert history["time [s]"].tolist() == whole["time [s]"][: len(history["time [s]"])].tolist()


@pytest.fixture
def mounted(tmp_path):
    """`mounted(options)`: a small file system of its own; only root can make one."""
    mounts = []

    def mount(options: str) -> Path:
        folder = tmp_path / f"mount{len(mounts)}"
        folder.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
        if os.getuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
            pytest.skip("NOT RUN: needs the right to mount a small file system")
        mounts.append(folder)
        return folder

    yield mount
    for folder in mounts:
        subprocess.run(["umount", str(folder)], check=True)


def run_until_the_disk_is_full(mpiexec, hdf5: str, directory: Path, complete: Path) -> None:
    words = (*SOD, "--set", f"output.directory={directory}", "--set", f"output.hdf5={hdf5}")
    output = mpiexec(2, "-m", "distfsi", *words, exit_code=74, seconds=60)
    assert assert_failed_well(output, "", "No space left on device", directory, complete) >= 5


@pytest.mark.parametrize("hdf5", ["mpi-io", "gather"])
def test_a_disk_that_runs_full(mpiexec, complete, mounted, hdf5):
    run_until_the_disk_is_full(mpiexec, hdf5, mounted("size=400k") / "out", complete)


@pytest.mark.full
def test_a_disk_that_runs_full_under_parallel_hdf5(mpiexec, mounted, tmp_path, parallel_hdf5):
    mpiexec(2, "-m", "distfsi", *SOD, "--set", f"output.directory={tmp_path}")
    run_until_the_disk_is_full(mpiexec, "mpio", mounted("size=1300k") / "out", tmp_path)


# ---- unusable folders ------------------------------------------------------------------------------------------------


def assert_refused(mpiexec, directory: Path, cause: str) -> None:
    output = mpiexec(2, "-m", "distfsi", *SOD, "--set", f"output.directory={directory}", exit_code=2, seconds=60)
    (line,) = [line for line in output.splitlines() if line]
    assert line == f"output.directory: {directory} cannot be written to: {cause}"


def test_a_file_in_place_of_the_folder(mpiexec, tmp_path):
    (tmp_path / "out").write_text("mine")
    assert_refused(mpiexec, tmp_path / "out", "it is a file")
    with pytest.raises(InputError, match=f"{tmp_path}/out/below cannot be written to: Not a directory"):
        held(tmp_path / "out" / "below", OneRank()).__enter__()
    assert (tmp_path / "out").read_text() == "mine"


def test_a_folder_without_permission(mpiexec, tmp_path):
    """Root may write everywhere: then another user tries."""
    tmp_path.chmod(0o500)
    if os.getuid() > 0:
        assert_refused(mpiexec, tmp_path / "out", "Permission denied")
        return
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setuid(NOBODY)
            held(tmp_path / "out", OneRank()).__enter__()
        except InputError as error:
            code = 0 if str(error).endswith("cannot be written to: Permission denied") else 2
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_a_read_only_file_system(mpiexec, mounted):
    assert_refused(mpiexec, mounted("size=100k,ro") / "out", "Read-only file system")
