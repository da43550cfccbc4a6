"""Marks that kernel texts carry, and the words they may use beyond plain Python.

The words have plain Python meanings here, so that a kernel can be read, linted and stepped through without a compiler;
`device/cpu.py` gives them their fast meanings.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


@dataclass(frozen=True)
class ByHand:
    """A kernel whose loops are written in CUDA C, because they are not those of the CPU: one block of threads per item.

    file      beside the driver's module; it holds `NAME_kernel(PARAMETERS)`
    formulas  the names of formulas that it calls
    block     (constants, arguments by name) -> the integers it is compiled with; among them THREADS of a block and
              SHARED, the reals in a block's shared memory
    """

    file: str
    formulas: Sequence[str]
    block: Callable[[Mapping[str, object], Mapping[str, object]], dict[str, int]]

    def __call__(self, driver: Kernel) -> Kernel:
        return _marked(driver, "__by_hand__", self)


def _marked(function: Kernel, name: str, mark: object) -> Kernel:
    setattr(function, name, mark)
    return function


def row(function: Kernel) -> Kernel:
    """An inner loop that must vectorise: no two array arguments alias, all indexing by load/store."""
    return _marked(function, "__kind__", "row")


def driver(function: Kernel) -> Kernel:
    """A function called from Python: releases the GIL, is cached on disk, calls rows and formulas."""
    return _marked(function, "__kind__", "driver")


def helper(function: Kernel) -> Kernel:
    """A function that drivers and rows call, inlined; integers and arrays allowed."""
    return _marked(function, "__kind__", "helper")


def load(A: np.ndarray, i: int) -> Any:
    """A.flat[i] with no wrap-around and no bounds check."""
    return A.flat[i]


def store(A: np.ndarray, i: int, x: Any) -> None:
    """A.flat[i] = x with no wrap-around and no bounds check."""
    A.flat[i] = x


real = float  # in a kernel: the scene's precision
int32 = int  # a count in a loop that must vectorise: one of 64 bits would halve how many float32 are packed


def workspace(n: int) -> np.ndarray:
    """n uninitialised reals that live as long as the driver call."""
    return np.empty(n)
