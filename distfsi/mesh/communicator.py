"""The ranks of a run: who they are, what they tell each other, and how one that fails takes the others down."""

from __future__ import annotations

import ctypes
import itertools
import os
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from mpi4py import MPI

from distfsi.errors import InputError

# What launchers tell their processes about the number of ranks (MPICH and Intel MPI, Open MPI, srun).
LAUNCHER_SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
LAST_WORDS = 0.2  # [s] that launchers get to take what a failing rank has written, before they end it


class Communicator:
    """All ranks of the run. Every method except `abort` is collective: all ranks call it, in the same order.

    `world` is the MPI communicator, for the other modules of this folder and for HDF5's MPI driver.
    """

    def __init__(self) -> None:
        if not MPI.Is_initialized():
            MPI.Init_thread()
        self.world = MPI.COMM_WORLD
        self.rank = self.world.Get_rank()
        self.size = self.world.Get_size()
        node = self.world.Split_type(MPI.COMM_TYPE_SHARED)
        self.local_rank = node.Get_rank()
        self.local_size = node.Get_size()
        node.Free()
        self.library = " ".join(MPI.Get_library_version().splitlines()[0].split(",")[0].split())

    def barrier(self) -> None:
        """Wait for all ranks."""
        self.world.Barrier()

    def broadcast(self, value: Any) -> Any:
        """The (pickled) value of rank 0, on every rank."""
        return self.world.bcast(value)

    def allgather(self, value: Any) -> list[Any]:
        """The (pickled) values of all ranks in rank order, on every rank."""
        return self.world.allgather(value)

    def bring(self, values: Sequence[Any], rank: int) -> list[Any]:
        """The (pickled) `values` of one rank, each in a message of its own, on rank 0; nothing on the others."""
        if self.rank == rank == 0:
            return list(values)
        if self.rank == rank:
            self.world.send(len(values), 0)
            for value in values:
                self.world.send(value, 0)
        if self.rank > 0:
            return []
        return [self.world.recv(source=rank) for _ in range(self.world.recv(source=rank))]

    def concatenate(self, rows: np.ndarray) -> np.ndarray:
        """Rows (n, ...) of all ranks in rank order, on every rank; n may differ, dtype and row shape may not."""
        rows = np.ascontiguousarray(rows)
        counts = np.empty(self.size, dtype=np.int64)
        self.world.Allgather(np.array([rows.nbytes], dtype=np.int64), counts)
        everything = np.empty(counts.sum(), dtype=np.uint8)
        self.world.Allgatherv([rows.reshape(-1).view(np.uint8), MPI.BYTE], [everything, counts, None, MPI.BYTE])
        return everything.view(rows.dtype).reshape(-1, *rows.shape[1:])

    def resliced(self, rows: np.ndarray, count: int) -> np.ndarray:
        """This rank's `count` rows of all ranks' `rows` (n, ...), cut anew in rank order; counts add up to all n."""
        rows = np.ascontiguousarray(rows)
        ends = np.cumsum(self.allgather((len(rows), count)), axis=0)
        before, after = (np.concatenate([[0], column]) for column in ends.T)

        def shared(own: np.ndarray, others: np.ndarray) -> list[np.ndarray]:
            """How many of this rank's rows each of the others has or gets, and where they begin here."""
            first, end = own[self.rank], own[self.rank + 1]
            low, high = np.clip(others[:-1], first, end), np.clip(others[1:], first, end)
            return [high - low, low - first]

        resliced = np.empty((count, *rows.shape[1:]), dtype=rows.dtype)
        row = MPI.BYTE.Create_contiguous(int(np.prod(rows.shape[1:])) * rows.itemsize).Commit()
        self.world.Alltoallv([rows, *shared(before, after), row], [resliced, *shared(after, before), row])
        row.Free()
        return resliced

    def maximum(self, values: np.ndarray) -> np.ndarray:
        """Element-wise largest float64 values over all ranks; a NaN on any rank comes out as inf."""
        values = np.asarray(values, dtype=np.float64)
        # MPI leaves open what MAX makes of a NaN; a comparison may drop it.
        values = np.where(np.isnan(values), np.inf, values)
        largest = np.empty_like(values)
        self.world.Allreduce(values, largest, MPI.MAX)
        return largest

    def write_at(self, path: Path, offsets: Sequence[int], arrays: Sequence[np.ndarray]) -> None:
        """Write this rank's C-contiguous `arrays` (maybe none) at its byte `offsets` into the existing file `path`.

        The data is on disk when this returns. Raises OSError on all ranks when one of them cannot open or write.
        """
        failures: list[str] = []
        with _noting(failures):
            file = MPI.File.Open(self.world, os.fspath(path), MPI.MODE_WRONLY)
        if not failures:  # collective: open on all ranks or on none
            with _noting(failures):
                for offset, array in zip(offsets, arrays, strict=True):
                    _write_whole(file, offset, array)
            for finish in (file.Sync, file.Close):
                with _noting(failures):
                    finish()
        for failure in itertools.chain(*self.allgather(failures)):
            raise OSError(failure)

    def takes_gpu_memory(self) -> bool | None:
        """Whether the MPI library says that messages may lie in a GPU's memory; None when it does not tell."""
        try:
            return bool(ctypes.CDLL(MPI.__file__).MPIX_Query_cuda_support())
        except (OSError, AttributeError):
            return None

    def pass_on(self, outgoing: Any, incoming: Any) -> None:
        """Send the array `outgoing` to the next rank, the last one's to the first; that of the rank before arrives."""
        after, before = (self.rank + 1) % self.size, (self.rank - 1) % self.size
        self.world.Sendrecv(outgoing, after, recvbuf=incoming, source=before)

    def abort(self, code: int) -> None:
        """End all ranks at once; the launcher returns `code` where it can."""
        sys.stdout.flush()
        sys.stderr.flush()
        time.sleep(LAST_WORDS)
        self.world.Abort(code)


@contextmanager
def _noting(failures: list[str]) -> Iterator[None]:
    """Note an error of MPI-IO instead of raising it: the other ranks wait for this one's next collective call."""
    try:
        yield
    except MPI.Exception as error:
        # The end of an error stack is the cause, after words that say nothing.
        failures.append(error.Get_error_string().splitlines()[-1].split(": ")[-1].removeprefix("Other I/O error "))
    except OSError as error:
        failures.append(str(error))


def _write_whole(file: MPI.File, offset: int, array: np.ndarray) -> None:
    status = MPI.Status()
    file.Write_at(offset, [array.reshape(-1).view(np.uint8), MPI.BYTE], status)
    written = status.Get_count(MPI.BYTE)
    if written != array.nbytes:  # all that Open MPI tells of a full disk
        raise OSError(f"only {written} of {array.nbytes} bytes were taken")


def install_abort_on_exception(communicator: Communicator) -> None:
    """From now on an uncaught exception on one rank ends all ranks, with the exception's `exit_code` (default 1)."""

    def report_and_abort(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        lines = "".join(traceback.format_exception(kind, error, trace))
        print(f"rank {communicator.rank}: {lines}", file=sys.stderr)
        communicator.abort(getattr(error, "exit_code", 1))

    sys.excepthook = report_and_abort


def check_launcher(communicator: Communicator) -> None:
    """Raise InputError when a launcher started several ranks that MPI sees as separate runs of one rank each."""
    if communicator.size > 1:
        return
    for name in LAUNCHER_SIZES:
        started = int(os.environ.get(name, 1))
        if started > 1:
            fault = f"the launcher started {started} ranks ({name}), but each runs alone with {communicator.library}"
            own = Path(sys.prefix, "bin", "mpiexec")
            remedy = "use the mpiexec that belongs to this library" + (f": {own}" if own.exists() else "")
            raise InputError([f"{fault}: launcher and MPI library do not match; {remedy}"])
