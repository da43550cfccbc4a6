"""When a front that runs at one speed through some of the cells of a grid reaches each of them: fast marching.

|grad t| = 1/speed, upwind, of second order where two cells behind are known, cells in the order of their times
(Sethian, SIAM Rev. 41, 1999).
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from math import inf, sqrt

import numpy as np

ALIKE = 1e-6  # of the time through a cell: by how much times differ at least; so that no round-off decides


def march(first: np.ndarray, passable: np.ndarray, spacing: Sequence[float], speed: float) -> np.ndarray:
    """Times [s] in the cells of a grid (any shape); infinite in those that no front reaches.

    first     times [s] that are known, infinite elsewhere
    passable  whether a front runs through a cell
    spacing   of the cells along each axis of the arrays [m]
    """
    layers = 2  # of cells around: as far as a cell looks
    padded = np.pad(passable, layers)
    steps = [int(np.prod(padded.shape[axis + 1 :])) for axis in range(padded.ndim)]
    free = np.pad(passable & ~np.isfinite(first), layers).ravel().tolist()
    times = np.pad(np.where(passable, first, inf), layers, constant_values=inf).ravel().tolist()
    done = [False] * len(times)
    waiting = [(time, at) for at, time in enumerate(times) if time < inf]
    heapq.heapify(waiting)
    rates = [speed / h for h in spacing]
    while waiting:
        time, at = heapq.heappop(waiting)
        if done[at]:
            continue
        done[at] = True
        for step in steps:
            for other in (at - step, at + step):
                if free[other] and not done[other]:
                    behind = [_behind(times, done, other, s, rate) for s, rate in zip(steps, rates, strict=True)]
                    if (found := _upwind(behind)) < times[other]:
                        times[other] = found
                        heapq.heappush(waiting, (found, other))
    return np.array(times).reshape(padded.shape)[(slice(layers, -layers),) * padded.ndim]


def _behind(times: list[float], done: list[bool], at: int, step: int, rate: float) -> tuple[float, float]:
    """Along an axis: b and r of the slope r (t - b) towards the earlier of the two neighbours that are known."""
    low, high = (times[at + s] if done[at + s] else inf for s in (-step, step))
    back = -step if low <= high else step
    near, far = min(low, high), times[at + 2 * back]
    if near < inf and done[at + 2 * back] and far < near - ALIKE / rate:
        return (4.0 * near - far) / 3.0, 1.5 * rate
    return near, rate


def _upwind(behind: Sequence[tuple[float, float]]) -> float:
    """The time t with sum of (r (t - b))^2 = 1 over those axes whose b is before t."""
    ordered = sorted(behind)
    start, time = ordered[0][0], inf  # times count from the earliest: fewer digits go
    weight = total = square = 0.0
    for b, rate in ordered:
        if b >= time or b == inf:
            break
        w, later = rate * rate, b - start
        weight, total, square = weight + w, total + w * later, square + w * later * later
        root = total * total - weight * (square - 1.0)
        if root < 0.0:
            break
        time = start + (total + sqrt(root)) / weight
    return time
