"""Marks that kernel texts carry, and the words they may use beyond plain Python.

The words have plain Python meanings here, so that a kernel can be read, linted and stepped through without a compiler;
`device/cpu.py` gives them their fast meanings.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np


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
    block: Callable[[dict, dict], dict[str, int]]

    def __call__(self, driver):
        driver.__by_hand__ = self
        return driver


def row(function):
    """An inner loop that must vectorise: no two array arguments alias, all indexing by load/store."""
    function.__kind__ = "row"
    return function


def driver(function):
    """A function called from Python: releases the GIL, is cached on disk, calls rows and formulas."""
    function.__kind__ = "driver"
    return function


def helper(function):
    """A function that drivers and rows call, inlined; integers and arrays allowed."""
    function.__kind__ = "helper"
    return function


def load(A, i):
    """A.flat[i] with no wrap-around and no bounds check."""
    return A.flat[i]


def store(A, i, x):
    """A.flat[i] = x with no wrap-around and no bounds check."""
    A.flat[i] = x


real = float  # in a kernel: the scene's precision
int32 = int  # a count in a loop that must vectorise: one of 64 bits would halve how many float32 are packed


def workspace(n):
    """n uninitialised reals that live as long as the driver call."""
    return np.empty(n)
