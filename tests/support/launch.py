"""Starts ranks the way a user does, and lets no test hang."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import psutil

SUPPORT = Path(__file__).parent  # what several tests share, and what they run
ROOT = SUPPORT.parent.parent

# One compute thread per rank; and what Open MPI needs to start more ranks than cores, or as root.
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PYTHONPATH": str(ROOT),
}


def run_ranks(ranks: int, arguments: Sequence[str], timeout: float, code: int | None = 0) -> str:
    """Run `python arguments...` on so many ranks; its output (stdout and stderr).

    Fails when the exit code is not `code` (None: any), or when the ranks have not ended after `timeout` [s]; then all
    are killed.
    """
    launcher = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    command = [launcher, "-n", str(ranks), sys.executable, *map(str, arguments)]
    process = subprocess.Popen(
        command, env=os.environ | ENVIRONMENT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    try:
        output, _ = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        for child in [*psutil.Process(process.pid).children(recursive=True), process]:
            child.kill()
        output, _ = process.communicate()
        raise AssertionError(f"still running after {timeout} s: {command}\n{output}") from None
    assert code in (None, process.returncode), f"exit code {process.returncode}, not {code}: {command}\n{output}"
    return output
