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
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from distfsi.device.cache import cache_directory, locked
from distfsi.device.cuda_text import dtype_of
from distfsi.device.kernel import Kernel, file_name

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
        self._compiled: dict[tuple, tuple[Callable, bool]] = {}

    def __call__(self, count: int, arguments: Sequence[object], reverse: bool = False) -> None:
        """Run the items 0 … count; arrays are numpy arrays here."""
        key, launch = self.kernel.signature(arguments), self.kernel.launch(arguments)
        if key not in self._compiled:
            self._compiled[key] = self._compile(arguments)
        values = [ctypes.c_longlong(0), ctypes.c_longlong(count)]
        for argument in arguments:
            values += parameters_of(argument)
        pointers = (ctypes.c_void_p * len(values))(*(ctypes.addressof(value) for value in values))
        function, barriers = self._compiled[key]
        function(pointers, launch.blocks(count), launch.threads, launch.shared, barriers, reverse)

    def _compile(self, arguments: Sequence[object]) -> tuple[Callable, bool]:
        """The function that launches the kernel, and whether the kernel has barriers."""
        name = self.kernel.name
        text = f"{self.kernel.text(arguments)}\nHOST_LAUNCH({name})\n"
        return getattr(ctypes.CDLL(str(library(name, text))), f"launch_{name}"), "__syncthreads" in text


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
    path = cache_directory() / f"{stem}.so"
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
