"""A GPU as a device (device/interface.py), whatever holds its memory and runs its kernels: CUDA, or the host in
tests."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from enum import Enum
from types import SimpleNamespace
from typing import Any, Protocol

import numpy as np

from distfsi.device.kernel import Kernel, Launch
from distfsi.device.source import Bound

TILE_CELLS = ((256,), (32, 8), (16, 8, 16))
MAXIMUM_THREADS = 256


class Queue(Enum):
    """Where what is asked for waits its turn: a stream of the GPU."""

    MAIN = 0
    ASYNCHRONOUS = 1


class Runtime(Protocol):
    """What runs kernels: device/cuda.py or device/host.py. `synchronise` and `seconds_between` wait, all else returns
    at once."""

    def compile(self, kernel: Kernel, arguments: Sequence[Any]) -> Any:
        """The kernel for arguments like these."""

    def launch(self, compiled: Any, launch: Launch, count: int, arguments: Sequence[Any], queue: Queue) -> None:
        """Run the items 0 … count."""

    def empty(self, shape: tuple[int, ...], dtype: np.dtype) -> Any:
        """An array that may hold anything."""

    def zeros(self, shape: tuple[int, ...], dtype: np.dtype) -> Any:
        """An array of zeros."""

    def pinned(self, count: int, dtype: np.dtype) -> np.ndarray:
        """Memory of the host that copies need not go around."""

    def upload(self, array: Any, host: np.ndarray, queue: Queue) -> None:
        """Copy from the host."""

    def download(self, host: np.ndarray, array: Any, queue: Queue) -> None:
        """Copy to the host."""

    def order(self, first: Queue, then: Queue) -> None:
        """What will be in the queue `then` waits for what is in the queue `first`."""

    def synchronise(self, queue: Queue) -> None:
        """Wait until all in the queue is done."""

    def mark(self, queue: Queue) -> Any:
        """The moment when all that is in the queue is done."""

    def seconds_between(self, first: Any, then: Any) -> float:
        """Between two such moments; waits for them."""


class Gpu:
    """One GPU, used by one rank. `direct`: messages lie in its memory, not in pinned memory of the host."""

    lanes = 1

    def __init__(self, runtime: Runtime, direct: bool = False):
        self.runtime, self.direct, self.seconds = runtime, direct, 0.0
        self._queue = Queue.MAIN
        self._compiled: dict[tuple[object, ...], Any] = {}

    def with_own_clock(self) -> Gpu:
        """The same GPU, whose seconds are counted apart."""
        gpu = copy(self)
        gpu.seconds = 0.0
        return gpu

    def tile_cells(self, wanted: tuple[int, ...]) -> tuple[int, ...]:
        fits = np.prod(wanted[:2]) <= MAXIMUM_THREADS  # one thread per column along the third axis
        return wanted if fits else TILE_CELLS[len(wanted) - 1]

    def build(
        self,
        drivers: Iterable[Callable[..., Any]],
        constants: Mapping[str, object],
        bindings: Mapping[str, Bound | type] | None = None,
        real: str = "float64",
    ) -> SimpleNamespace:
        """The drivers as kernels; each is compiled at its first call."""
        return SimpleNamespace(**{d.__name__: Kernel(d, constants, bindings or {}, real) for d in drivers})

    def run(self, kernel: Kernel, count: int, *arguments: Any) -> None:
        if not count:
            return
        given = kernel.given(arguments)
        if any(isinstance(argument, np.ndarray) for argument in given):
            raise TypeError(f"{kernel.name} gets an array of the host")
        key = (id(kernel), *kernel.signature(given))
        if key not in self._compiled:
            self._compiled[key] = self.runtime.compile(kernel, given), kernel.launch(given), kernel
        compiled, launch, _ = self._compiled[key]
        self.runtime.launch(compiled, launch, count, given, self._queue)

    run_few = run

    def array(self, host: np.ndarray) -> Any:
        array = self.runtime.empty(host.shape, host.dtype)
        self.runtime.upload(array, host.copy(), self._queue)
        return array

    def empty(self, shape: tuple[int, ...] | int, dtype: type = np.float64) -> Any:
        return self.runtime.empty(_lengths(shape), np.dtype(dtype))

    def zeros(self, shape: tuple[int, ...] | int, dtype: type = np.float64) -> Any:
        return self.runtime.zeros(_lengths(shape), np.dtype(dtype))

    def message_memory(self, count: int, dtype: np.dtype) -> Any:
        return self.runtime.empty((count,), np.dtype(dtype)) if self.direct else self.runtime.pinned(count, dtype)

    def staging_array(self, message: Any) -> Any:
        return message if self.direct else self.runtime.empty(message.shape, message.dtype)

    def download(self, array: Any) -> np.ndarray:
        host = np.empty(array.shape, array.dtype)
        self.runtime.download(host, array, self._queue)
        self._wait(self._queue)
        return host

    def upload(self, array: Any, host: Any) -> None:
        if array is not host:
            self.runtime.upload(array, host, self._queue)

    def download_to(self, message: Any, array: Any) -> None:
        if array is not message:
            self.runtime.download(message, array, self._queue)

    @contextmanager
    def asynchronous(self) -> Iterator[None]:
        self.runtime.order(Queue.MAIN, Queue.ASYNCHRONOUS)
        self._queue = Queue.ASYNCHRONOUS
        yield
        self._queue = Queue.MAIN

    def join_asynchronous(self) -> None:
        self.runtime.order(Queue.ASYNCHRONOUS, Queue.MAIN)

    def finish_asynchronous(self) -> None:
        self._wait(Queue.ASYNCHRONOUS)

    def mark(self) -> Any:
        return self.runtime.mark(Queue.MAIN)

    def seconds_between(self, first: Any, then: Any) -> float:
        return self.runtime.seconds_between(first, then)

    def _wait(self, queue: Queue) -> None:
        """The host waits while the kernels run: that is the time they take, as far as it shows."""
        started = clock.perf_counter()
        self.runtime.synchronise(queue)
        self.seconds += clock.perf_counter() - started


def _lengths(shape: tuple[int, ...] | int) -> tuple[int, ...]:
    return tuple(map(int, shape)) if isinstance(shape, tuple) else (int(shape),)
