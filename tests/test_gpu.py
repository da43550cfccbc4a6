"""A fluid on a GPU's queues and memory, which the host stands in for: the bits of the CPU on any number of ranks."""

import numpy as np
import pytest

from distfsi.device.gpu import Gpu
from distfsi.device.host import HostArray, HostRuntime
from launch import ROOT

SCRIPT = ROOT / "tests/mpi_gpu.py"


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.full)])
def test_fluid_scenes_have_the_bits_of_the_cpu(mpiexec, ranks):
    assert mpiexec(ranks, SCRIPT, "scenes").count("same bits") == 3 * ranks


def test_every_wait_copy_and_order_is_needed(mpiexec):
    """On 2 ranks."""
    assert mpiexec(2, SCRIPT, "mutants").count("found") == 14


def test_arrays_of_the_device_stay_there():
    array = Gpu(HostRuntime()).array(np.arange(3.0))
    assert isinstance(array, HostArray)
    for misuse in (np.asarray, np.sum, lambda a: a + 1.0, lambda a: np.zeros(3) + a):
        with pytest.raises(TypeError):
            misuse(array)
