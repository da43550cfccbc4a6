"""A relaxed packing: particles of equal volume that push each other apart, and off the surface, until they are even."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from distfsi.scene.description import Shape
from distfsi.scene.shapes import bounding_box, distance

PASSES = 60
REACH = 1.6  # spacings: how far particles push each other
STEP, LONGEST_STEP = 0.25, 0.1  # of a spacing: under the push of a touching particle; in one pass
CLOSEST = 0.25  # spacings from the surface
OUTERMOST, DRAWN = 0.85, 0.4  # particles less deep, in spacings, are drawn to half a spacing by this share in a pass
MOVING = 4.0  # spacings from the surface: particles deeper inside stay in the lattice
FINE = 0.5  # spacings between the nodes at which the depth is known


def relaxed(shape: Shape, spacing: float, volume: float) -> np.ndarray:
    """Positions (n, D) [m] of as many particles as fit into `volume` [m^D] of `shape`, about `spacing` [m] apart and
    half as far from the surface."""
    from scipy.spatial import cKDTree

    depth = _Depth(shape, spacing)
    points = _innermost(depth, shape, spacing, volume)
    for sweep in range(PASSES):
        signed, outward = depth.at(points)
        moving = signed > -MOVING * spacing
        beside = np.flatnonzero(signed > -spacing)
        images = points[beside] - 2.0 * signed[beside, None] * outward[beside]
        everything = np.concatenate([points, images])
        first, second = cKDTree(everything).query_pairs(REACH * spacing, output_type="ndarray").T
        apart = everything[first] - everything[second]
        gap = np.maximum(np.linalg.norm(apart, axis=1), 1e-3 * spacing)
        push = apart * ((1.0 - gap / (REACH * spacing)) ** 2 / gap)[:, None]
        total = _summed(push, first, len(everything)) - _summed(push, second, len(everything))
        step = STEP * spacing * (1.0 - 0.8 * sweep / PASSES) * total[: len(points)]
        length = np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300)
        points = points + np.where(moving[:, None], step * np.minimum(1.0, LONGEST_STEP * spacing / length), 0.0)
        signed, outward = depth.at(points)
        layer = signed > -OUTERMOST * spacing
        drawn = np.where(layer, np.maximum(DRAWN * (signed + 0.5 * spacing), signed + CLOSEST * spacing), 0.0)
        points = points - drawn[:, None] * outward
    return points


def _summed(values: np.ndarray, rows: np.ndarray, count: int) -> np.ndarray:
    """Sums (count, D) of `values` (k, D) by row."""
    return np.stack([np.bincount(rows, column, minlength=count) for column in values.T], axis=1)


def _innermost(depth: _Depth, shape: Shape, spacing: float, volume: float) -> np.ndarray:
    """As many points as make up `volume` of those of a lattice, which fits the box around a shape, that lie deepest
    inside the shape, first those that come first in the lattice."""
    lower, upper = (np.asarray(corner) for corner in bounding_box(shape))
    numbers = np.maximum(np.rint((upper - lower) / spacing), 1).astype(int)
    steps = (upper - lower) / numbers
    axes = [a + step * (np.arange(n) + 0.5) for a, n, step in zip(lower, numbers, steps, strict=True)]
    points = np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=1)
    signed, _ = depth.at(points)
    count = max(1, round(volume / steps.prod()))
    return points[np.sort(np.argsort((signed / spacing).round(9), kind="stable")[:count])]


class _Depth:
    """True signed distance to the surface of a shape and its gradient, between nodes, whatever bound the shape knows.

    lower  (D,) [m] the first node
    """

    def __init__(self, shape: Shape, spacing: float):
        low, high = (np.asarray(corner) for corner in bounding_box(shape))
        self._step = FINE * spacing
        offset = self._step * (math.sqrt(2.0) - 1.0)  # no node lies on a face by chance
        self.lower = low - REACH * spacing - offset
        counts = np.ceil((high - self.lower + REACH * spacing) / self._step).astype(int) + 1
        axes = [a + self._step * np.arange(n) for a, n in zip(self.lower, counts, strict=True)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        bound = distance(shape, nodes.reshape(-1, len(low))).reshape(counts)
        self._signed = self._redistance(nodes, bound)
        slopes = np.gradient(self._signed, self._step)
        self._slopes = [slopes] if len(low) == 1 else list(slopes)

    def _redistance(self, nodes: np.ndarray, bound: np.ndarray) -> np.ndarray:
        """Where `bound` is far from the true distance, that from the points where the surface cuts the edges between
        nodes, with the sign of `bound`."""
        from scipy.spatial import cKDTree

        crossings = []
        for axis in range(bound.ndim):
            count = bound.shape[axis]
            a, b = (np.take(bound, range(k, count - 1 + k), axis=axis) for k in (0, 1))
            cut = (a < 0.0) != (b < 0.0)
            first, second = (np.take(nodes, range(k, count - 1 + k), axis=axis)[cut] for k in (0, 1))
            part = (a[cut] / (a[cut] - b[cut]))[:, None]
            crossings.append(first + part * (second - first))
        surface: Any = cKDTree(np.concatenate(crossings))
        gap, _ = surface.query(nodes.reshape(-1, bound.ndim))
        gap = np.where(gap.reshape(bound.shape) < 2.0 * self._step, np.abs(bound), gap.reshape(bound.shape))
        return np.where(bound < 0.0, -gap, gap)

    def at(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distances (n,) [m] of `points` (n, D), negative inside, and the directions (n, D) to the outside."""
        from scipy.ndimage import map_coordinates

        where = (points - self.lower).T / self._step
        signed = map_coordinates(self._signed, where, order=1, mode="nearest")
        slope = np.stack([map_coordinates(s, where, order=1, mode="nearest") for s in self._slopes], axis=1)
        return signed, slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)
