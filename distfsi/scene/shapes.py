"""Geometry of the shapes: which points lie inside, how large they are, how much of each cell they fill."""

from __future__ import annotations

import math

import numpy as np

from distfsi.scene.description import Ball, Box, Cylinder, HalfSpace, Shape, Tube

SUBPOINTS = 8  # per axis, in cells that a curved or oblique surface may cut


def dimensions(shape: Shape) -> int:
    """Number of coordinates that the shape is given in."""
    match shape:
        case Box(corner, _) | HalfSpace(corner, _) | Cylinder(corner):
            return len(corner)
    return len(shape.center)


def distance(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Signed distance [m] of `points` (n, D) to the surface of `shape`, negative inside -> (n,).

    Outside the edges of a Box or a Cylinder it is the largest of the distances to its faces.
    """
    return surfaces(shape, points).max(axis=1)


def surfaces(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Signed distances [m] of `points` (n, D) to each of the smooth surfaces of `shape`, negative inside -> (n, k)."""
    match shape:
        case Box(lower, upper):
            return np.hstack([np.asarray(lower) - points, points - np.asarray(upper)])
        case Ball(center, radius):
            return (_radius(points, center) - radius)[:, None]
        case HalfSpace(point, normal):
            return ((points - np.asarray(point)) @ np.asarray(normal) / math.hypot(*normal))[:, None]
        case Tube(center, inner, outer):
            r = _radius(points, center)
            return np.stack([inner - r, r - outer], axis=1)
        case Cylinder(start, end, outer, inner):
            along, r = cylinder_coordinates(shape, points)
            hole = [inner - r] if inner > 0.0 else []
            return np.stack([-along, along - math.dist(start, end), *hole, r - outer], axis=1)


def cylinder_coordinates(shape: Cylinder, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance [m] along the axis, from its start, and from the axis, of `points` (n, 3) -> (n,), (n,)."""
    start = np.asarray(shape.start)
    axis = (np.asarray(shape.end) - start) / math.dist(shape.start, shape.end)
    along = (points - start) @ axis
    return along, np.sqrt(((points - start - along[:, None] * axis) ** 2).sum(axis=1))


def _radius(points: np.ndarray, center: tuple[float, ...]) -> np.ndarray:
    return np.sqrt(sum((points[:, d] - center[d]) ** 2 for d in range(len(center))))


def contains(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Whether each of `points` (n, D) lies inside `shape` -> bool (n,)."""
    return distance(shape, points) < 0.0


def bounding_box(shape: Shape) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Lower and upper corner [m] of the smallest axis-parallel box around `shape` (infinite for a HalfSpace)."""
    match shape:
        case Box(lower, upper):
            return lower, upper
        case Ball(center, radius) | Tube(center, _, radius):
            return tuple(c - radius for c in center), tuple(c + radius for c in center)
        case Cylinder(start, end, radius):
            axis = (np.asarray(end) - np.asarray(start)) / math.dist(start, end)
            reach = radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0))  # of its round faces
            return tuple(np.minimum(start, end) - reach), tuple(np.maximum(start, end) + reach)
        case HalfSpace(point, normal):
            lower, upper = [-math.inf] * len(point), [math.inf] * len(point)
            axes = [d for d, n in enumerate(normal) if n != 0.0]
            if len(axes) == 1:
                (d,) = axes
                (upper if normal[d] > 0.0 else lower)[d] = point[d]
            return tuple(lower), tuple(upper)


def volume(shape: Box | Ball | Tube | Cylinder) -> float:
    """Length, area or volume of `shape` in its own number of dimensions [m, m2, m3]."""
    ball = (2.0, math.pi, 4.0 / 3.0 * math.pi)
    match shape:
        case Box(lower, upper):
            return math.prod(b - a for a, b in zip(lower, upper, strict=True))
        case Ball(center, radius):
            return ball[len(center) - 1] * radius ** len(center)
        case Tube(center, inner, outer):
            return ball[len(center) - 1] * (outer ** len(center) - inner ** len(center))
        case Cylinder(start, end, outer, inner):
            return math.pi * (outer**2 - inner**2) * math.dist(start, end)


def cell_fractions(shape: Shape, centers: tuple[np.ndarray, ...], spacing: tuple[float, ...]) -> np.ndarray:
    """Fraction of each cell of a grid that lies inside `shape`, shape ([nz,] [ny,] nx).

    `centers` holds the cell centers along each axis, `spacing` the cell sizes [m]. Exact for boxes; otherwise cells
    that the surface may cut are sampled at SUBPOINTS points per axis. A cell's value depends on its own center only,
    so it is the same however the domain is cut into blocks.
    """
    shape_of_grid = tuple(len(x) for x in reversed(centers))
    if _is_its_bounding_box(shape):
        lower, upper = bounding_box(shape)
        return _outer_product([_overlap(*args) for args in zip(lower, upper, centers, spacing, strict=True)])
    grids = np.meshgrid(*reversed(centers), indexing="ij")
    points = np.stack([g.ravel() for g in reversed(grids)], axis=1)
    signed = distance(shape, points)
    fractions = (signed < 0.0).astype(np.float64)
    cut = np.flatnonzero(np.abs(signed) < 0.5001 * math.hypot(*spacing))
    hits = sum(contains(shape, points[cut] + offset) for offset in _offsets(spacing))
    fractions[cut] = hits / SUBPOINTS ** len(centers)
    return fractions.reshape(shape_of_grid)


def _is_its_bounding_box(shape: Shape) -> bool:
    match shape:
        case HalfSpace(_, normal):
            return sum(n != 0.0 for n in normal) == 1
        case Ball(center, _):
            return len(center) == 1
    return isinstance(shape, Box)


def _overlap(lower: float, upper: float, centers: np.ndarray, spacing: float) -> np.ndarray:
    """Fraction of each interval of length `spacing` about `centers` that lies in [lower, upper]."""
    low = np.maximum((lower - centers) / spacing, -0.5)
    high = np.minimum((upper - centers) / spacing, 0.5)
    fraction = np.maximum(high - low, 0.0)
    return np.where(fraction > 1.0 - 1e-9, 1.0, np.where(fraction < 1e-9, 0.0, fraction))


def _outer_product(factors: list[np.ndarray]) -> np.ndarray:
    result = factors[-1]
    for factor in reversed(factors[:-1]):
        result = result[..., None] * factor
    return result


def _offsets(spacing: tuple[float, ...]) -> np.ndarray:
    """Sub-points of a cell relative to its center, (SUBPOINTS**D, D)."""
    steps = (np.arange(SUBPOINTS) + 0.5) / SUBPOINTS - 0.5
    grids = np.meshgrid(*(steps * h for h in spacing), indexing="ij")
    return np.stack([g.ravel() for g in grids], axis=1)
