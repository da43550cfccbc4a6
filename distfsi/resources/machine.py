"""What a run would find on these ranks: MPI, GPUs, HDF5, threads, room on the disk. `distfsi doctor`."""

from __future__ import annotations

import platform
import shutil
from pathlib import Path
from typing import Any

from distfsi import __version__
from distfsi.device import cuda, nvrtc
from distfsi.device.cache import cache_directory, cache_faults
from distfsi.direct import refusal
from distfsi.mesh.communicator import Communicator
from distfsi.output.storage import parallel_hdf5
from distfsi.simulation import threads_of_rank


def main(communicator: Communicator) -> None:
    """Collective. Rank 0 prints what all ranks found."""
    own = {
        "node": platform.node(),
        "threads": threads_of_rank(communicator),
        "GPU": gpu_of_rank(communicator),
    }
    ranks = communicator.allgather(own)
    if communicator.rank == 0:
        print("\n".join(f"{name:10} {text}" for name, text in report(communicator, ranks)), flush=True)


def report(communicator: Communicator, ranks: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """Names and findings."""
    nodes = len({rank["node"] for rank in ranks})
    lines = [
        ("distfsi", f"{__version__}, Python {platform.python_version()}"),
        ("MPI", f"{communicator.library}; {communicator.size} ranks on {nodes} nodes, as the launcher started"),
        ("MPI + GPU", cuda_aware(communicator)),
        ("HDF5", parallel_hdf5()),
        ("compiler", compiler()),
        ("kernels", "; ".join(cache_faults()) or f"kept in {cache_directory()}, {room(cache_directory())}"),
        ("results", f"here, {room(Path.cwd())}"),
    ]
    found = [f"{rank['node']}, {rank['threads']} threads, {rank['GPU']}" for rank in ranks]
    return lines + [(f"rank {number}", what) for number, what in enumerate(found)]


def gpu_of_rank(communicator: Communicator) -> str:
    """The GPU that `run --gpu` takes on this rank, and whether a message from its memory arrives; or why there is
    none."""
    try:
        ordinal = communicator.local_rank % cuda.gpu_count()
        why = refusal(communicator)
        tried = f"no messages from its memory ({why})" if why else "a message from its memory arrives"
        return f"GPU {ordinal}: {cuda.gpu_name(ordinal)}, {tried}"
    except cuda.NoGpu as error:
        return f"no GPU ({error})"


def cuda_aware(communicator: Communicator) -> str:
    """Whether the MPI says that it takes memory of GPUs; runs do not need it, as messages go through the host."""
    says = {True: "says that it takes memory of GPUs", False: "does not take memory of GPUs", None: "does not tell"}
    default = "unless run --gpu-aware-mpi asks for it, messages go through pinned memory of the host"
    return f"the library {says[communicator.takes_gpu_memory()]}; {default}"


def compiler() -> str:
    """What compiles kernels for GPUs."""
    try:
        return f"NVRTC {nvrtc.version()}"
    except nvrtc.CompileError as error:
        return str(error)


def room(directory: Path) -> str:
    """Free bytes where a directory is or would be."""
    existing = next(parent for parent in (directory, *directory.absolute().parents) if parent.exists())
    return f"{shutil.disk_usage(existing).free / 2**30:.1f} GiB free"
