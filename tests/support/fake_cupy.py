"""As much of CuPy as device/cuda.py uses, with the host in the place of the GPU: arrays, streams, modules.

A module's file is a library that device/host.py compiled. Streams do everything at once; what is checked here are the
calls, their arguments, and that streams, not the device, order them.
"""

from __future__ import annotations

import ctypes
import sys
import time as clock
from collections import Counter
from types import ModuleType, SimpleNamespace

import numpy as np

calls: Counter = Counter()


class Array:
    """A cupy.ndarray."""

    def __init__(self, memory):
        self._memory = memory
        self.shape, self.dtype, self.ndim = memory.shape, memory.dtype, memory.ndim

    def reshape(self, count):
        return Array(self._memory.reshape(count))

    def __getitem__(self, part):
        assert isinstance(part, slice)
        return Array(self._memory[part])

    def set(self, host, stream=None):
        assert isinstance(stream, Stream) and host.dtype == self.dtype and host.shape == self.shape
        calls["set"] += 1
        self._memory[...] = host

    def get(self, stream=None, order="C", out=None, blocking=True):
        assert isinstance(stream, Stream) and not blocking and out.flags.c_contiguous
        calls["get"] += 1
        out[...] = self._memory


class Event:
    """A cupy.cuda.Event that has been recorded."""

    def __init__(self):
        self.time, self.waited_for = clock.perf_counter(), False

    def synchronize(self):
        self.waited_for = True


def elapsed(first, then):
    """[ms] as cupy.cuda.get_elapsed_time."""
    assert then.waited_for
    return 1e3 * (then.time - first.time)


class Stream:
    """A cupy.cuda.Stream."""

    current: list[Stream] = []

    def __init__(self, non_blocking=False):
        assert non_blocking

    def __enter__(self):
        Stream.current.append(self)

    def __exit__(self, *_):
        Stream.current.pop()

    def record(self):
        return Event()

    def wait_event(self, event):
        assert isinstance(event, Event)

    def synchronize(self):
        calls["synchronize"] += 1


class RawKernel:
    """A cupy.RawKernel; 48 KiB of shared memory are free, more has to be asked for."""

    max_dynamic_shared_size_bytes = 48 * 1024

    def __init__(self, library, name):
        self._launch = getattr(library, f"launch_{name}")

    def __call__(self, grid, block, args, *, shared_mem=0):
        assert Stream.current and shared_mem <= self.max_dynamic_shared_size_bytes and block[0] <= 1024
        values = [self._value(argument) for argument in args]
        pointers = (ctypes.c_void_p * len(values))(*(ctypes.addressof(value) for value in values))
        calls["launch"] += 1
        self._launch(pointers, *grid, *block, shared_mem, True, False)

    @staticmethod
    def _value(argument):
        if isinstance(argument, Array):
            return ctypes.c_void_p(argument._memory.ctypes.data)
        assert isinstance(argument, np.generic)
        return np.ctypeslib.as_ctypes_type(argument.dtype)(argument.item())


class RawModule:
    """A cupy.RawModule made from a file."""

    def __init__(self, *, path):
        self._library = ctypes.CDLL(path)

    def get_function(self, name):
        return RawKernel(self._library, name.removesuffix("_kernel"))


def empty(shape, dtype):
    assert Stream.current
    return Array(np.empty(shape, dtype))


def zeros(shape, dtype):
    assert Stream.current
    return Array(np.zeros(shape, dtype))


def install(monkeypatch, gpus=2):
    """Make `import cupy` and `import cupyx` find this."""
    device = lambda ordinal: SimpleNamespace(use=lambda: None, compute_capability="90", id=ordinal)  # noqa: E731
    properties = {"name": b"none", "major": 9, "minor": 0, "totalGlobalMem": 2**36}
    runtime = SimpleNamespace(getDeviceCount=lambda: gpus, getDeviceProperties=lambda ordinal: properties)
    cupy, cupyx = ModuleType("cupy"), ModuleType("cupyx")
    cupy.ndarray, cupy.empty, cupy.zeros, cupy.RawModule = Array, empty, zeros, RawModule
    cupy.cuda = SimpleNamespace(Stream=Stream, Device=device, runtime=runtime, get_elapsed_time=elapsed)
    cupyx.empty_pinned = np.empty
    monkeypatch.setitem(sys.modules, "cupy", cupy)
    monkeypatch.setitem(sys.modules, "cupyx", cupyx)
