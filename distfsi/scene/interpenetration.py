"""How far shapes reach into each other."""

from __future__ import annotations

import numpy as np

from distfsi.scene.description import Box, Shape
from distfsi.scene.shapes import bounding_box, distance, surfaces

STARTS = 8  # places from which the widest one of an overlap is looked for
APART = 0.2  # of the extent of all places: how far such starts are from each other at least


def overlap(first: Shape, second: Shape, points: np.ndarray, spacing: float) -> float:
    """Thickness [m] of what two shapes have in common: the diameter of the largest ball that fits in, 0 where they are
    apart or touch.

    `points` (n, D) [m] fill both as far as they are in the domain, `spacing` [m] apart or closer.
    """
    corners = np.array([bounding_box(shape) for shape in (first, second)])
    thickness = (corners[:, 1].min(axis=0) - corners[:, 0].max(axis=0)).min()
    if thickness <= 0.0 or (isinstance(first, Box) and isinstance(second, Box)):
        return max(float(thickness), 0.0)
    depth = _depth(first, second, points)
    if depth.max() <= -spacing * np.sqrt(points.shape[1]):
        return 0.0
    box = np.stack([points.min(axis=0), points.max(axis=0)]) + 0.5 * spacing * np.array([[-1.0], [1.0]])
    return max(0.0, *(2.0 * _deepest(first, second, points[n], box, spacing) for n in _starts(points, depth)))


def _depth(first: Shape, second: Shape, points: np.ndarray) -> np.ndarray:
    """How deep (n,) [m] points lie in both shapes."""
    return -np.maximum(distance(first, points), distance(second, points))


def _starts(points: np.ndarray, depth: np.ndarray) -> list[int]:
    """The deepest of the points, then others that are not near those before."""
    apart = APART * np.linalg.norm(np.ptp(points, axis=0))
    chosen: list[int] = []
    left = np.argsort(-depth, kind="stable")
    while len(left) and len(chosen) < STARTS:
        chosen.append(int(left[0]))
        left = left[np.linalg.norm(points[left] - points[left[0]], axis=1) > apart]
    return chosen


def _deepest(first: Shape, second: Shape, start: np.ndarray, box: np.ndarray, scale: float) -> float:
    """Depth [m] of the deepest point near `start` in a `box` (2, D) [m]: the largest t with -surface >= t for all
    surfaces of both shapes."""
    from scipy.optimize import minimize

    def room(unknown: np.ndarray) -> np.ndarray:
        point = (start + scale * unknown[:-1])[None]
        found = np.concatenate([surfaces(shape, point)[0] for shape in (first, second)])
        return -found / scale - unknown[-1]

    guess = np.append(np.zeros(len(start)), _depth(first, second, start[None])[0] / scale)
    bounds = [*((box - start) / scale).T, (None, None)]
    given = {"bounds": bounds, "constraints": {"type": "ineq", "fun": room}, "options": {"maxiter": 200, "ftol": 1e-12}}
    found = minimize(lambda unknown: -unknown[-1], guess, method="SLSQP", **given)
    return float(_depth(first, second, (start + scale * found.x[:-1])[None])[0])
