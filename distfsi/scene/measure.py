"""Volumes of regions that only a signed distance describes, or a bound of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence, Set

import numpy as np

Distance = Callable[[np.ndarray], np.ndarray]

CUBES = {1: 64, 2: 32, 3: 12}  # along the longest edge, to begin with
MAXIMUM_CUBES = 100_000
SMALLEST = 1e-6  # of the longest edge: cubes at corners, of which there are few
FLAT = 1e-7  # of a cube's size: a surface that deviates less from a plane is one
SMOOTH = 0.1  # the same of one without edges, which may be curved
TOGETHER = 1000  # cubes whose points are looked at together
SUBPOINTS = {1: 64, 2: 16, 3: 6}  # per axis of a cube with edges


def measure(
    distance: Distance,
    lower: np.ndarray,
    upper: np.ndarray,
    faces: Sequence[Set[float]] | None = None,
) -> float:
    """Length, area or volume of the points inside the box [lower, upper] (D,) [m] whose `distance` is negative.

    `faces`: along each axis the coordinates of all the region's faces, where these are planes across the axes; then it
    is exact. Otherwise boxes that the surface may cut are halved along each axis, until it is flat: what a plane cuts
    off a box is exact. In the smallest boxes a curved surface is a plane, too, and points are counted beside edges;
    this error goes with the square of their size, so most of it is extrapolated away from the last two passes.
    """
    if faces is not None:
        return _between_faces(distance, lower, upper, faces)
    D = len(lower)
    counts = np.maximum(np.ceil((upper - lower) / (upper - lower).max() * CUBES[D]), 1).astype(int)
    size = (upper - lower) / counts
    axes = [a + (np.arange(n) + 0.5) * h for a, n, h in zip(lower, counts, size, strict=True)]
    centers = np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=1)
    children, sums, before = _grid(2, D) * size, [0.0], math.nan
    while len(centers):
        signed = distance(centers)
        half = 0.5 * math.hypot(*size)
        sums.append(np.count_nonzero(signed <= -half) * math.prod(size))
        near = np.abs(signed) < half
        centers, signed = centers[near], signed[near]
        parts, flat = parts_inside(distance, centers, signed, size, SMOOTH)
        sums.append(math.fsum(parts[flat]) * math.prod(size))
        total = math.fsum([*sums, math.fsum(parts[~flat]) * math.prod(size)])
        if len(centers) * 2**D > MAXIMUM_CUBES or size.max() < SMALLEST * (upper - lower).max():
            return total + (total - before) / 3.0
        before = total
        centers = (centers[~flat][:, None] + children).reshape(-1, D)
        size, children = 0.5 * size, 0.5 * children
    return math.fsum(sums)


def parts_inside(
    distance: Distance, centers: np.ndarray, signed: np.ndarray, size: np.ndarray, smooth: float = 0.01
) -> tuple[np.ndarray, np.ndarray]:
    """Which part (n,) of boxes of `size` (D,) about `centers` (n, D), where the distance is `signed`, lies inside, and
    whether the surface in each is flat. `smooth`: so far, in sizes, a surface may deviate from a plane where it is
    taken as one; elsewhere points are counted."""
    slopes = _slopes(distance, centers, size)
    error = _deviation(distance, centers, signed, slopes, size)
    parts, rough = parts_below(signed, slopes * size), np.flatnonzero(error > smooth)
    offsets = _grid(SUBPOINTS[len(size)], len(size)) * size
    for first in range(0, len(rough), TOGETHER):
        some = rough[first : first + TOGETHER]
        points = (centers[some][:, None] + offsets).reshape(-1, len(size))
        parts[some] = (distance(points) < 0.0).reshape(len(some), -1).mean(axis=1)
    return parts, error < FLAT


def _grid(count: int, dimensions: int) -> np.ndarray:
    """(count**D, D) centers of the parts of a unit cube about the origin."""
    steps = (np.arange(count) + 0.5) / count - 0.5
    return np.array(list(itertools.product(steps, repeat=dimensions)))


def _between_faces(distance: Distance, lower: np.ndarray, upper: np.ndarray, faces: Sequence[Set[float]]) -> float:
    """All faces extended through the box cut it into boxes, each of which is all inside or all outside."""
    edges = [
        np.array(sorted({a, b, *(x for x in coordinates if a < x < b)}))
        for a, b, coordinates in zip(lower.tolist(), upper.tolist(), faces, strict=True)
    ]
    middles = np.meshgrid(*(0.5 * (x[1:] + x[:-1]) for x in edges), indexing="ij")
    sizes = np.meshgrid(*(np.diff(x) for x in edges), indexing="ij")
    inside = distance(np.stack([grid.ravel() for grid in middles], axis=1)) < 0.0
    return math.fsum(np.prod([grid.ravel() for grid in sizes], axis=0)[inside])


def _slopes(distance: Distance, points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Gradient (n, D) of the distance over a box about each of `points`."""
    steps = np.diag(0.25 * size)
    return np.stack(
        [(distance(points + step) - distance(points - step)) / (2.0 * step.sum()) for step in steps], axis=1
    ).reshape(points.shape)


def _deviation(
    distance: Distance, centers: np.ndarray, signed: np.ndarray, slopes: np.ndarray, size: np.ndarray
) -> np.ndarray:
    """(n,) how far the distance in a box about each center is from that to one plane, in sizes: its corners tell."""
    largest = np.zeros(len(centers))
    for corner in itertools.product((-0.5, 0.5), repeat=len(size)):
        offset = np.asarray(corner) * size
        np.maximum(largest, np.abs(distance(centers + offset) - signed - slopes @ offset), out=largest)
    return largest / size.max()


def parts_below(levels: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Parts (n,) of unit cubes about the origin where level + slope . x < 0, for `levels` (n,), `slopes` (n, D).

    Alternating sum over the corners of the cube of the simplices that the plane cuts off there.
    """
    slopes = np.abs(slopes)
    largest = slopes.max(axis=1, initial=0.0)
    largest = np.where(largest > 0.0, largest, 1.0)
    slopes = np.maximum(slopes, 1e-4 * largest[:, None])  # none is along a face; an error of 1e-8
    D = slopes.shape[1]
    depth = 0.5 * slopes.sum(axis=1) - levels
    total = np.zeros(len(levels))
    for corner in itertools.product((0, 1), repeat=D):
        total += (-1) ** sum(corner) * np.maximum(depth - slopes @ np.asarray(corner, dtype=float), 0.0) ** D
    return np.clip(total / (math.factorial(D) * slopes.prod(axis=1)), 0.0, 1.0)
