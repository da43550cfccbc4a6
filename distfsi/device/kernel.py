"""Kernels in CUDA C before any device compiles them: from the argument types of a call to the text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from distfsi.device.cuda_text import THREADS, dtype_of, kernel_text, numbers_of, text_by_hand
from distfsi.device.emit import Numbers
from distfsi.device.markers import ByHand
from distfsi.device.source import Bound, flat_values, parameters_of


@dataclass(frozen=True)
class Launch:
    """Items that a block of threads takes, its threads, and the bytes of its shared memory."""

    items: int
    threads: int
    shared: int

    def blocks(self, count: int) -> int:
        """Blocks for `count` items."""
        return -(-count // self.items)


@dataclass(frozen=True)
class Kernel:
    """A driver, what a scene fixes of it, and its real type; one text per signature it is called with."""

    driver: Callable[..., Any]
    constants: Mapping[str, object]
    bindings: Mapping[str, Bound | type]
    real: str

    @property
    def name(self) -> str:
        return self.driver.__name__

    @cached_property
    def numbers(self) -> Numbers:
        """What the scene measures: a kernel gets it behind its other arguments."""
        return Numbers(numbers_of(self.driver, self.constants, self.bindings), np.dtype(self.real).type)

    def given(self, arguments: Iterable[object]) -> list[object]:
        """What the kernel is called with: the arguments (without begin and end), records flattened, and the numbers."""
        return [*flat_values(arguments), *self.numbers()]

    def text(self, arguments: Sequence[object]) -> str:
        """The CUDA C for arguments like those that are `given`. Raises NotInSubset."""
        write = text_by_hand if self._by_hand else kernel_text
        return write(self.driver, self.constants, self.bindings, self.real, arguments)

    def launch(self, arguments: Sequence[object]) -> Launch:
        """How the kernel is launched with arguments like these."""
        if not self._by_hand:
            return Launch(THREADS, THREADS, 0)
        numbers = self._by_hand.block(self.constants, self._named(arguments))
        return Launch(1, numbers["THREADS"], numbers["SHARED"] * np.dtype(self.real).itemsize)

    def signature(self, arguments: Sequence[object]) -> tuple[object, ...]:
        """What the text depends on: the type and the number of axes of each argument, and the launch."""
        kinds = ((str(dtype_of(argument)), getattr(argument, "ndim", 0)) for argument in arguments)
        return (*kinds, self.launch(arguments))

    @property
    def _by_hand(self) -> ByHand | None:
        return getattr(self.driver, "__by_hand__", None)

    def _named(self, arguments: Sequence[object]) -> dict[str, object]:
        return dict(zip(parameters_of(self.driver), arguments, strict=False))
