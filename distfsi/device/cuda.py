"""CUDA through CuPy as what runs a GPU's kernels: compiled by NVRTC, kept on disk, launched on two streams.

Copies between host and device go through pinned memory where the host's array lies in it (`pinned`). No GPU was at hand
when this was written: device/host.py stands in for it in the tests, all but this file.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from distfsi.device import nvrtc
from distfsi.device.cuda_text import dtype_of
from distfsi.device.gpu import Gpu, Queue
from distfsi.device.kernel import Kernel, Launch

STATIC_SHARED = 48 * 1024  # bytes of shared memory that a kernel gets unasked


class NoGpu(Exception):
    """There is no GPU, or what drives it is missing."""


def gpu_count() -> int:
    """How many GPUs this process sees. Raises NoGpu."""
    return _cupy().cuda.runtime.getDeviceCount()


def gpu_name(ordinal: int) -> str:
    """Name, architecture and memory of a GPU."""
    properties = _cupy().cuda.runtime.getDeviceProperties(ordinal)
    architecture = f"sm_{properties['major']}{properties['minor']}"
    return f"{properties['name'].decode()} ({architecture}, {properties['totalGlobalMem'] / 2**30:.0f} GiB)"


def gpu_of(local_rank: int, direct: bool = False) -> Gpu:
    """The GPU of a rank: its number on the node, modulo the GPUs that it sees. Raises NoGpu and CompileError.

    `direct`: messages lie in its memory, which MPI must be able to take.
    """
    nvrtc.library()
    return Gpu(CupyRuntime(local_rank % gpu_count()), direct)


def _cupy() -> Any:
    try:
        import cupy

        if cupy.cuda.runtime.getDeviceCount() == 0:
            raise NoGpu("no GPU is visible")
    except ImportError as error:
        raise NoGpu("CuPy is not installed: pip install 'distfsi[cuda12]' or 'distfsi[cuda13]'") from error
    except RuntimeError as error:
        raise NoGpu(f"CUDA cannot be used: {error}") from error
    return cupy


class CupyRuntime:
    """One GPU and two of its streams."""

    def __init__(self, ordinal: int):
        self._cupy = _cupy()
        self._device = self._cupy.cuda.Device(ordinal)
        self._device.use()
        self.architecture = f"sm_{self._device.compute_capability}"
        self._streams = {queue: self._cupy.cuda.Stream(non_blocking=True) for queue in Queue}

    def compile(self, kernel: Kernel, arguments: Sequence[Any]) -> Any:
        path = nvrtc.cubin(kernel.name, kernel.text(arguments), self.architecture)
        function = self._cupy.RawModule(path=str(path)).get_function(f"{kernel.name}_kernel")
        shared = kernel.launch(arguments).shared
        if shared > STATIC_SHARED:
            function.max_dynamic_shared_size_bytes = shared
        return function

    def launch(self, compiled: Any, launch: Launch, count: int, arguments: Sequence[Any], queue: Queue) -> None:
        values: list[Any] = [np.int64(0), np.int64(count)]
        for argument in arguments:
            if isinstance(argument, self._cupy.ndarray):
                values += [argument, *map(np.int64, argument.shape)]
            else:
                values.append(dtype_of(argument).type(argument))
        with self._streams[queue]:
            compiled((launch.blocks(count),), (launch.threads,), tuple(values), shared_mem=launch.shared)

    def empty(self, shape: tuple[int, ...], dtype: np.dtype) -> Any:
        with self._streams[Queue.MAIN]:
            return self._cupy.empty(shape, dtype)

    def zeros(self, shape: tuple[int, ...], dtype: np.dtype) -> Any:
        with self._streams[Queue.MAIN]:
            return self._cupy.zeros(shape, dtype)

    def pinned(self, count: int, dtype: np.dtype) -> np.ndarray:
        import cupyx

        return cupyx.empty_pinned(max(count, 1), dtype)[:count]

    def upload(self, array: Any, host: np.ndarray, queue: Queue) -> None:
        if host.size:
            array.set(host, stream=self._streams[queue])

    def download(self, host: np.ndarray, array: Any, queue: Queue) -> None:
        if host.size:
            array.get(stream=self._streams[queue], out=host, blocking=False)

    def order(self, first: Queue, then: Queue) -> None:
        self._streams[then].wait_event(self._streams[first].record())

    def synchronise(self, queue: Queue) -> None:
        self._streams[queue].synchronize()

    def mark(self, queue: Queue) -> Any:
        return self._streams[queue].record()

    def seconds_between(self, first: Any, then: Any) -> float:
        then.synchronize()
        return 1e-3 * self._cupy.cuda.get_elapsed_time(first, then)
