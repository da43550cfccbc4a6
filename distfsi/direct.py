"""Whether MPI takes messages from the memory of GPUs.

The library is asked, but its yes is no proof, and an MPI that cannot ends the process: so a message is tried in another
one first, `python -m distfsi.direct LOCAL_RANK`.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import numpy as np

from distfsi.device.cuda import gpu_of
from distfsi.device.gpu import Gpu
from distfsi.mesh.communicator import Communicator

VALUES = 2**17  # of a message that is tried: 1 MiB
PATIENCE = 120.0  # seconds for a message within a process that starts
LAUNCHERS = (  # how names begin that tell a process that it is a rank
    "PMI",
    "HYDRA",
    "MPI_LOCAL",
    "MPIEXEC",
    "OMPI_COMM",
    "OMPI_UNIVERSE",
    "OMPI_MCA_ess",
    "OMPI_MCA_orte",
    "ORTE",
    "PRTE",
    "SLURM",
    "PALS",
)


def refusal(communicator: Communicator) -> str:
    """Why messages of this rank may not lie in its GPU's memory; empty where they may."""
    if communicator.takes_gpu_memory() is False:
        return f"{communicator.library} does not take memory of GPUs"
    alone = {name: value for name, value in os.environ.items() if not name.startswith(LAUNCHERS)}
    command = [sys.executable, "-m", "distfsi.direct", str(communicator.local_rank)]
    try:
        tried = subprocess.run(command, env=alone, capture_output=True, text=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return f"a message from a GPU's memory has not arrived after {PATIENCE:.0f} s"
    if tried.returncode == 0:
        return ""
    said = (tried.stderr or tried.stdout).strip().splitlines()
    how = signal.Signals(-tried.returncode).name if tried.returncode < 0 else (said or ["no word"])[-1]
    return f"a message from a GPU's memory failed: {how}"


def arrives(communicator: Communicator, gpu: Gpu) -> bool:
    """Collective. Whether a message from each rank's GPU arrives at the next rank's as it was."""
    values = np.arange(VALUES, dtype=np.float64)
    outgoing, incoming = (gpu.message_memory(VALUES, values.dtype) for _ in range(2))
    with gpu.asynchronous():
        gpu.upload(outgoing, values + communicator.rank)
    gpu.finish_asynchronous()
    communicator.pass_on(outgoing, incoming)
    before = (communicator.rank - 1) % communicator.size
    return all(communicator.allgather(np.array_equal(gpu.download(incoming), values + before)))


if __name__ == "__main__":
    arrived = arrives(Communicator(), gpu_of(int(sys.argv[1]), direct=True))
    sys.exit(None if arrived else "it arrived otherwise than it was sent")
