"""A space-filling curve through the blocks, and its cut into one run of blocks per rank."""

from __future__ import annotations

import numpy as np


def morton_keys(coordinates: np.ndarray) -> np.ndarray:
    """Positions (n,) int64 along the Morton (Z-order) curve of integer `coordinates` (n, 3) in [0, 2^21)."""
    keys = np.zeros(len(coordinates), dtype=np.int64)
    for bit in range(int(coordinates.max(initial=0)).bit_length()):
        for axis in range(3):
            keys |= ((coordinates[:, axis] >> bit) & 1) << (3 * bit + axis)
    return keys


def deal(costs: np.ndarray, ranks: int) -> np.ndarray:
    """Rank (n,) of each block of a curve with `costs` (n,): ascending runs, each within the largest cost of the mean.

    A block goes to the rank in whose equal share of the total the middle of its own cost lies.
    """
    costs = np.asarray(costs, dtype=np.float64)
    middle = np.cumsum(costs) - 0.5 * costs
    return np.minimum(middle * ranks / costs.sum(), ranks - 1).astype(np.int64)
