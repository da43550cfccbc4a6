"""The CPU as a device: drivers in machine code (device/native.py), run on a team of threads."""

from __future__ import annotations

import threading
import time as clock
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.cache import cache_directory
from distfsi.device.native import Native
from distfsi.device.source import Bound, NotInSubset

__all__ = ["Bound", "NotInSubset", "Cpu", "build", "cache_directory"]


def build(
    drivers: Iterable[Callable[..., Any]],
    constants: Mapping[str, object],
    bindings: Mapping[str, Bound | type] | None = None,
    real: str = "float64",
) -> SimpleNamespace:
    """Each driver, specialised for a scene.

    `constants` are the names a scene fixes, `bindings` the formulas it chooses for a name. Returns a namespace with the
    drivers under their own names; compilation happens at a driver's first call and is kept on disk. That call raises
    NotInSubset for what cannot be compiled.
    """
    return SimpleNamespace(**{d.__name__: Native(d, constants, bindings or {}, real) for d in drivers})


class Cpu:
    """Threads of one rank that share the items of a driver call: the CPU as a device (device/interface.py).

    seconds: how long the calls have taken so far
    """

    build = staticmethod(build)

    CHUNKS_PER_THREAD = 4
    lanes = 16

    def __init__(self, threads: int):
        self.threads, self.seconds = max(1, threads), 0.0
        self._pool = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None

    def with_own_clock(self) -> Cpu:
        """The same threads, whose seconds are counted apart."""
        same = copy(self)
        same.seconds = 0.0
        return same

    def run(self, kernel: Callable[..., Any], count: int, *arguments: Any) -> None:
        """Call `kernel(begin, end, *arguments)` on ranges that together cover 0 … count."""
        started = clock.perf_counter()
        self._share(kernel, count, *arguments)
        self.seconds += clock.perf_counter() - started

    def tile_cells(self, wanted: tuple[int, ...]) -> tuple[int, ...]:
        return wanted

    def run_few(self, kernel: Callable[..., Any], count: int, *arguments: Any) -> None:
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

    def asynchronous(self) -> nullcontext[None]:
        return nullcontext()

    def join_asynchronous(self) -> None:
        pass

    def finish_asynchronous(self) -> None:
        pass

    def mark(self) -> float:
        return clock.perf_counter()

    def seconds_between(self, first: float, then: float) -> float:
        return then - first

    def _share(self, function: Callable[..., Any], count: int, *arguments: Any) -> None:
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
