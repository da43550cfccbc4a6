"""Particles sorted into the cells of a search grid, in one order on any number of ranks."""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from distfsi.device.cpu import Team


class SearchCells(NamedTuple):
    """A window of the search grid, with an empty cell on each side; fields are in the order of the loops' arguments.

    start    (cells + 1,): where the particles of each cell of the window begin in `order`
    order    (n,): the particles, cell by cell, in the order of their keys
    lower    corner of the grid [m]; size: side of its cells [m]
    low      (D,) first search cell of the window with particles, counted from the corner
    window   (D,) cells of the window, the empty ones included
    strides  (3,) steps in `start` along each axis
    """

    start: np.ndarray
    order: np.ndarray
    lower: np.ndarray
    size: float
    low: np.ndarray
    window: np.ndarray
    strides: np.ndarray


def sort_particles(
    kernels: SimpleNamespace,
    team: Team,
    position: np.ndarray,
    key: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    size: float,
) -> tuple[np.ndarray, SearchCells]:
    """The search cell of each particle, and the cells, on a grid from `lower` to `upper` (D,) [m].

    Particles outside fall into the cells next to it. `kernels` holds find_cells, fill_cells and order_cells.
    """
    last = np.ceil((upper - lower) / size)
    lowest = np.fmin.reduce(position, axis=0, initial=np.inf)
    highest = np.fmax.reduce(position, axis=0, initial=-np.inf)
    low, high = np.clip(np.floor((np.stack([lowest, highest]) - lower) / size), -1.0, last)
    window = np.maximum(high - low, 0.0).astype(np.int64) + 3
    strides = np.cumprod([1, *window[:-1], *[1] * (3 - len(window))])
    cell, order = np.empty((2, len(position)), dtype=np.int64)
    start = np.zeros(window.prod() + 1, dtype=np.int64)
    team.run(kernels.find_cells, len(position), position, lower, size, low, high, strides, cell)
    kernels.fill_cells(cell, start, order)
    team.run(kernels.order_cells, len(start) - 1, start, order, key)
    return cell, SearchCells(start, order, lower, size, low, window, strides)
