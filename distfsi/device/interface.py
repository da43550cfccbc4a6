"""What a part may ask of the device that holds its arrays: the CPU (device/cpu.py), a GPU (device/gpu.py with
device/cuda.py), or CUDA C on the host (device/gpu.py with device/host.py).

A device has two queues. What is asked for is done in the order of asking, except for what is asked for in
`asynchronous()`: that comes after all asked before, but only `join_asynchronous()` makes what is asked for later wait
for it. On the CPU everything is done
at once, and the arrays of the device are those of the host.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping
from contextlib import AbstractContextManager
from types import SimpleNamespace
from typing import Any, Protocol

import numpy as np

from distfsi.device.source import Bound


class Device(Protocol):
    """`seconds`: how long its kernels have kept this rank busy; `lanes`: how many items of a list a thread does best
    side by side."""

    seconds: float
    lanes: int

    def with_own_clock(self) -> Device:
        """The same device, whose seconds are counted apart."""

    def tile_cells(self, wanted: tuple[int, ...]) -> tuple[int, ...]:
        """Cells of a tile of the fluid that suit the device, where `wanted` suits the CPU."""

    def build(
        self,
        drivers: Iterable[Callable[..., Any]],
        constants: Mapping[str, object],
        bindings: Mapping[str, Bound | type] | None = None,
        real: str = "float64",
    ) -> SimpleNamespace:
        """The drivers, specialised for a scene, under their own names. Raises NotInSubset."""

    def run(self, kernel: Any, count: int, *arguments: Any) -> None:
        """Do the items 0 … count of a kernel; arrays among the arguments are the device's."""

    def run_few(self, kernel: Any, count: int, *arguments: Any) -> None:
        """`run`, for items that are not worth sharing among threads."""

    def array(self, host: np.ndarray) -> Any:
        """An array of the device with the values of a contiguous one of the host; on the CPU that array itself."""

    def empty(self, shape: tuple[int, ...] | int, dtype: type = np.float64) -> Any:
        """An array of the device that may hold anything."""

    def zeros(self, shape: tuple[int, ...] | int, dtype: type = np.float64) -> Any:
        """An array of the device that holds zeros."""

    def message_memory(self, count: int, dtype: np.dtype) -> Any:
        """Flat memory that MPI sends from and receives in: the host's, or the device's where MPI is to take that. MPI
        is given no memory of the device before all asynchronous work is done."""

    def staging_array(self, message: Any) -> Any:
        """An array of the device like some `message_memory`, for copies between them; where they are one, itself."""

    def download(self, array: Any) -> np.ndarray:
        """The values of an array of the device, when all that was asked for before is done."""

    def upload(self, array: Any, host: Any) -> None:
        """Give an array of the device the values of one of the host, which must stay as it is until that is done; or of
        `message_memory`."""

    def download_to(self, message: Any, array: Any) -> None:
        """Give `message_memory` the values of an array of the device; they are there after `finish_asynchronous`."""

    def asynchronous(self) -> AbstractContextManager[None]:
        """What is asked for inside goes to the other queue."""

    def join_asynchronous(self) -> None:
        """What is asked for later waits for the asynchronous work."""

    def finish_asynchronous(self) -> None:
        """Wait until all asynchronous work is done."""

    def mark(self) -> Any:
        """The moment when all that was asked for before is done, but for asynchronous work that is not joined."""

    def seconds_between(self, first: Any, then: Any) -> float:
        """Between two such moments; waits for them."""


class DualArray:
    """An array of the device and, when it is looked at, its copy on the host."""

    def __init__(self, device: Device, values: Any):
        """`values`: an array of the host or of the device."""
        self._device, self._values = device, device.array(values) if isinstance(values, np.ndarray) else values
        self.dtype = self._values.dtype
        self.nbytes = int(np.prod(self._values.shape)) * np.dtype(self.dtype).itemsize
        self._host: np.ndarray | None = None

    @property
    def device(self) -> Any:
        """The device's array, for a kernel that may write into it."""
        self._host = None
        return self._values

    @property
    def read(self) -> Any:
        """The device's array, for kernels that do not write into it."""
        return self._values

    def host(self) -> np.ndarray:
        """The values on the host. Who changes them calls `changed`."""
        if self._host is None:
            self._host = self._device.download(self._values)
        return self._host

    def changed(self) -> None:
        """The values on the host have been changed."""
        self._device.upload(self._values, self.host())


class Columns(MutableMapping[str, np.ndarray]):
    """Arrays by name, each a `DualArray`: `columns[name]` are its values on the host. Who changes them in place calls
    `changed`."""

    def __init__(self, device: Device, arrays: Mapping[str, np.ndarray]):
        self.device = device
        self._pairs: dict[str, DualArray] = {}
        self.update(arrays)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._pairs[name].host()

    def __contains__(self, name: object) -> bool:
        return name in self._pairs  # without a copy to the host

    def __setitem__(self, name: str, host: np.ndarray) -> None:
        self._pairs[name] = DualArray(self.device, np.ascontiguousarray(host))

    def __delitem__(self, name: str) -> None:
        del self._pairs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._pairs)

    def __len__(self) -> int:
        return len(self._pairs)

    def read(self, *names: str) -> list[Any]:
        """The device's arrays, for kernels that do not write into them."""
        return [self._pairs[name].read for name in names]

    def write(self, *names: str) -> list[Any]:
        """The device's arrays, for kernels that may write into them."""
        return [self._pairs[name].device for name in names]

    def adopt(self, name: str, array: Any) -> None:
        """From now on an array of the device holds the values."""
        self._pairs[name] = DualArray(self.device, array)

    def changed(self, *names: str) -> None:
        """The values on the host have been changed."""
        for name in names:
            self._pairs[name].changed()
