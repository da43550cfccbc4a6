"""CUDA C on the host: the very text that a GPU runs, compiled by a compiler of the host; for tests where no GPU is.

Needs a C++20 compiler: $CXX, g++, clang++ or the package ziglang.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import shutil
import subprocess
import sys
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.device.cache import file_name, kernel_cache, locked
from distfsi.device.cuda_text import dtype_of
from distfsi.device.gpu import Queue
from distfsi.device.kernel import Kernel, Launch

# No contraction of a * b + c, as on the GPU: the bits are those of the CPU's kernels.
FLAGS = ("-std=c++20", "-O1", "-ffp-contract=off", "-fwrapv", "-fPIC", "-shared", "-w", "-x", "c++")


def compiler() -> list[str]:
    """The command of a C++ compiler. Raises FileNotFoundError."""
    for name in (os.environ.get("CXX"), "g++", "clang++"):
        if name and shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "c++"]
    raise FileNotFoundError("no C++ compiler: install g++, or the package ziglang")


class HostKernel:
    """A kernel that the host runs, its threads one after the other, in one order or the reverse."""

    def __init__(self, kernel: Kernel):
        self.kernel = kernel
        self._compiled: dict[tuple[object, ...], tuple[Callable[..., Any], bool]] = {}

    def __call__(self, count: int, arguments: Sequence[object], reverse: bool = False) -> None:
        """Run the items 0 … count with the arguments that the kernel is `given`; arrays are numpy arrays here."""
        key, launch = self.kernel.signature(arguments), self.kernel.launch(arguments)
        if key not in self._compiled:
            self._compiled[key] = self._compile(arguments)
        values: list[Any] = [ctypes.c_longlong(0), ctypes.c_longlong(count)]
        for argument in arguments:
            values += parameters_of(argument)
        pointers = (ctypes.c_void_p * len(values))(*(ctypes.addressof(value) for value in values))
        function, barriers = self._compiled[key]
        function(pointers, launch.blocks(count), launch.threads, launch.shared, barriers, reverse)

    def _compile(self, arguments: Sequence[object]) -> tuple[Callable[..., Any], bool]:
        """The function that launches the kernel, and whether the kernel has barriers."""
        name = self.kernel.name
        text = f"{self.kernel.text(arguments)}\nHOST_LAUNCH({name})\n"
        return getattr(ctypes.CDLL(str(library(name, text))), f"launch_{name}"), "__syncthreads" in text


class HostArray:
    """An array that only kernels and copies reach, as one on a GPU: it does not become a numpy array by itself."""

    __array_ufunc__ = None

    def __init__(self, memory: np.ndarray):
        self.memory = memory

    shape = property(lambda self: self.memory.shape)
    dtype = property(lambda self: self.memory.dtype)
    ndim = property(lambda self: self.memory.ndim)

    def reshape(self, *shape: int) -> HostArray:
        """The same values in another shape."""
        return HostArray(self.memory.reshape(*shape, copy=False))

    def __getitem__(self, part: slice) -> HostArray:
        """Some of the same values."""
        return HostArray(self.memory[part])

    @property
    def __cuda_array_interface__(self) -> dict[str, object]:
        """Where MPI finds the values."""
        address, type_name = (self.memory.ctypes.data, False), self.memory.dtype.str
        return {"shape": self.shape, "typestr": type_name, "data": address, "version": 3}

    def __array__(self, *_: object, **__: object) -> np.ndarray:
        raise TypeError("an array of the device: get() it")


@dataclass
class Task:
    """Something queued, and what has to be done before it."""

    work: Callable[[], None]
    after: list[Task]
    done: bool = False

    def do(self) -> None:
        """Do it, and before it what it needs."""
        if not self.done:
            self.done = True
            for task in self.after:
                task.do()
            self.work()


class Moment(Task):
    """When all before it is done: `time` [s]."""

    def __init__(self, after: list[Task]):
        super().__init__(self._note, after)
        self.time = 0.0

    def _note(self) -> None:
        self.time = clock.perf_counter()


class HostRuntime:
    """Runs kernels on the host, as late as their order allows or as early; both are legal on a GPU."""

    def __init__(self, late: bool = True):
        self.late = late
        self._last = {queue: Task(lambda: None, [], done=True) for queue in Queue}
        self._reverse = False

    def compile(self, kernel: Kernel, arguments: Sequence[object]) -> HostKernel:
        return HostKernel(kernel)

    def launch(self, compiled: HostKernel, launch: Launch, count: int, arguments: Sequence[Any], queue: Queue) -> None:
        values = [argument.memory if isinstance(argument, HostArray) else argument for argument in arguments]
        self._reverse = not self._reverse
        self._add(queue, partial(compiled, count, values, self._reverse))

    def empty(self, shape: tuple[int, ...], dtype: np.dtype) -> HostArray:
        memory = np.empty(shape, dtype)
        memory.reshape(-1).view(np.uint8)[:] = 0xA5
        return HostArray(memory)

    def zeros(self, shape: tuple[int, ...], dtype: np.dtype) -> HostArray:
        return HostArray(np.zeros(shape, dtype))

    def pinned(self, count: int, dtype: np.dtype) -> np.ndarray:
        return np.empty(count, dtype)

    def upload(self, array: HostArray, host: np.ndarray, queue: Queue) -> None:
        self._add(queue, partial(np.copyto, array.memory, host))

    def download(self, host: np.ndarray, array: HostArray, queue: Queue) -> None:
        self._add(queue, partial(np.copyto, host, array.memory))

    def order(self, first: Queue, then: Queue) -> None:
        self._last[then] = Task(lambda: None, [self._last[then], self._last[first]])

    def synchronise(self, queue: Queue) -> None:
        self._last[queue].do()

    def mark(self, queue: Queue) -> Moment:
        moment = Moment([self._last[queue]])
        self._put(queue, moment)
        return moment

    def seconds_between(self, first: Moment, then: Moment) -> float:
        then.do()
        return then.time - first.time

    def is_idle(self, queue: Queue) -> bool:
        """Whether all in the queue is done."""
        return self._last[queue].done

    def _add(self, queue: Queue, work: Callable[[], None]) -> None:
        self._put(queue, Task(work, [self._last[queue]]))

    def _put(self, queue: Queue, task: Task) -> None:
        self._last[queue] = task
        if not self.late:
            task.do()


def parameters_of(argument: object) -> list[object]:
    """The C parameters that carry an argument: address and lengths of an array, or the value."""
    if isinstance(argument, np.ndarray) and argument.ndim:
        if not argument.flags.c_contiguous:
            raise ValueError("kernels take contiguous arrays")
        return [ctypes.c_void_p(argument.ctypes.data), *(ctypes.c_longlong(length) for length in argument.shape)]
    return [np.ctypeslib.as_ctypes_type(dtype_of(argument))(argument)]


def library(name: str, text: str) -> Path:
    """The shared library compiled from a text, kept on disk. Raises RuntimeError with what the compiler says."""
    header = Path(__file__).parent / "host.h"
    stem = file_name(name, "\n".join([*compiler(), *FLAGS, header.read_text(), text]))
    path = kernel_cache() / f"{stem}.so"
    if path.exists():
        return path
    with locked(path):
        source, unfinished = path.with_suffix(".cu"), path.with_suffix(".part")
        source.write_text(text)
        command = [*compiler(), *FLAGS, "-include", str(header), "-o", str(unfinished), str(source)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{source} does not compile:\n{done.stderr}")
        os.replace(unfinished, path)
    return path
