"""The CPU as a device: compile emitted modules with numba, keep them on disk, run drivers on a team of threads."""

from __future__ import annotations

import importlib.util
import sys
import threading
import time as clock
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from copy import copy
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np

from distfsi.device import emit, runtime
from distfsi.device.cache import cache_directory, locked, write_whole
from distfsi.device.fold import Bound, NotInSubset, flat_values

__all__ = ["Bound", "NotInSubset", "Team", "build", "cache_directory"]


def build(
    drivers: Iterable[Callable],
    constants: Mapping[str, object],
    bindings: Mapping[str, Bound] | None = None,
    real: str = "float64",
) -> SimpleNamespace:
    """Compile each driver, specialised for a scene, as a module of its own.

    `constants` are the names a scene fixes, `bindings` the formulas it chooses for a name. Returns a namespace with the
    drivers under their own names; compilation happens at a driver's first call and is kept on disk. Raises NotInSubset.
    """
    compiled = {}
    for driver in drivers:
        text, numbers = emit.numba_text(driver, constants, bindings or {}, real, runtime.VERSION)
        module = _load(emit.module_name(driver, text), text)
        dispatcher, numbers = getattr(module, driver.__name__), emit.Numbers(numbers, np.dtype(real).type)
        compiled[driver.__name__] = _Compiled(dispatcher, Path(module.__file__), numbers)
    return SimpleNamespace(**compiled)


def _load(name: str, text: str) -> ModuleType:
    full_name = f"distfsi_kernels.{name}"
    if full_name in sys.modules:
        return sys.modules[full_name]
    path = cache_directory() / f"{name}.py"
    if not path.exists():
        write_whole(path, text.encode())
    spec = importlib.util.spec_from_file_location(full_name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[full_name] = module
    spec.loader.exec_module(module)
    return module


class _Compiled:
    """A driver and the `numbers` of a scene. It compiles at its first call, in one process of a machine at a time:
    others then find it on disk."""

    def __init__(self, dispatcher: Callable, path: Path, numbers: emit.Numbers):
        self.dispatcher, self.path, self.numbers = dispatcher, path, numbers
        self._call: Callable = self._first_call
        self._lock = threading.Lock()

    def __call__(self, *arguments):
        return self._call(*flat_values(arguments), *self.numbers())

    def _first_call(self, *arguments):
        with self._lock:
            if self._call is not self.dispatcher:
                with locked(self.path):
                    result = self.dispatcher(*arguments)
                self._call = self.dispatcher
                return result
        return self.dispatcher(*arguments)


class Team:
    """Threads of one rank that share the items of a driver call: the CPU as a device (device/interface.py).

    seconds: how long the calls have taken so far
    """

    build = staticmethod(build)

    CHUNKS_PER_THREAD = 4
    lanes = 16

    def __init__(self, threads: int):
        self.threads, self.seconds = max(1, threads), 0.0
        self._pool = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None

    def with_own_clock(self) -> Team:
        """The same threads, whose seconds are counted apart."""
        team = copy(self)
        team.seconds = 0.0
        return team

    def run(self, kernel: Callable, count: int, *arguments) -> None:
        """Call `kernel(begin, end, *arguments)` on ranges that together cover 0 … count."""
        started = clock.perf_counter()
        self._share(kernel, count, *arguments)
        self.seconds += clock.perf_counter() - started

    def tile_cells(self, wanted: tuple[int, ...]) -> tuple[int, ...]:
        return wanted

    def run_few(self, kernel: Callable, count: int, *arguments) -> None:
        """Call `kernel(0, count, *arguments)` on this thread."""
        if count:
            kernel(0, count, *arguments)

    def array(self, host: np.ndarray) -> np.ndarray:
        return host

    def empty(self, shape: tuple[int, ...] | int, dtype: type = np.float64) -> np.ndarray:
        return np.empty(shape, dtype)

    def zeros(self, shape: tuple[int, ...] | int, dtype: type = np.float64) -> np.ndarray:
        return np.zeros(shape, dtype)

    def message_memory(self, count: int, dtype: np.dtype) -> np.ndarray:
        return np.empty(count, dtype)

    def staging_array(self, message: np.ndarray) -> np.ndarray:
        return message

    def download(self, array: np.ndarray) -> np.ndarray:
        return array

    def upload(self, array: np.ndarray, host: np.ndarray) -> None:
        if array is not host:
            array[...] = host

    def download_to(self, message: np.ndarray, array: np.ndarray) -> None:
        self.upload(message, array)

    def asynchronous(self) -> nullcontext:
        return nullcontext()

    def join_asynchronous(self) -> None:
        pass

    def finish_asynchronous(self) -> None:
        pass

    def mark(self) -> float:
        return clock.perf_counter()

    def seconds_between(self, first: float, then: float) -> float:
        return then - first

    def _share(self, function: Callable, count: int, *arguments) -> None:
        if self._pool is None or count < 2:
            if count:
                function(0, count, *arguments)
            return
        chunks = min(count, self.threads * self.CHUNKS_PER_THREAD)
        edges = [count * c // chunks for c in range(chunks + 1)]
        ranges = iter(zip(edges[:-1], edges[1:], strict=True))
        guard = threading.Lock()

        def work() -> None:
            while True:
                with guard:
                    piece = next(ranges, None)
                if piece is None:
                    return
                function(*piece, *arguments)

        others = [self._pool.submit(work) for _ in range(self.threads - 1)]
        work()
        for other in others:
            other.result()
