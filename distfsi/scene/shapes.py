"""Geometry of the shapes: which points lie inside, how large they are.

Shapes made of others bring their own: scene/composed.py, scene/surface.py, scene/cloud.py.
"""

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import numpy as np

from distfsi.scene.description import Ball, Box, Composed, Cylinder, HalfSpace, Shape, Tube

ROUNDING = 1e-12


def dimensions(shape: Shape) -> int:
    """Number of coordinates that the shape is given in."""
    match shape:
        case Box(corner, _) | HalfSpace(corner, _) | Cylinder(corner):
            return len(corner)
        case Composed():
            return shape.dimensions
    return len(shape.center)


def distance(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Signed distance [m] of `points` (n, D) to the surface of `shape`, negative inside -> (n,).

    It is the true one where `has_true_distance` says so, otherwise a bound: of the right sign, and nowhere farther from
    zero.
    """
    match shape:
        case Box(lower, upper):
            return meet(*np.maximum(np.asarray(lower) - points, points - np.asarray(upper)).T)
        case Ball(center, radius):
            return _radius(points, center) - radius
        case HalfSpace(point, normal):
            return (points - np.asarray(point)) @ np.asarray(normal) / math.hypot(*normal)
        case Tube(center, inner, outer):
            r = _radius(points, center)
            return np.maximum(inner - r, r - outer)
        case Cylinder(start, end, outer, inner):
            along, r = cylinder_coordinates(shape, points)
            ends = np.maximum(-along, along - math.dist(start, end))
            return meet(ends, np.maximum(inner - r, r - outer) if inner > 0.0 else r - outer)
        case Composed():
            return shape.distance(points)


def meet(*distances: np.ndarray) -> np.ndarray:
    """Signed distance to what several regions have in common whose surfaces stand upright on each other, from the
    distances to each: beside an edge that to the edge."""
    nearest = np.maximum.reduce(distances)
    return np.where(nearest > 0.0, np.sqrt(sum(np.maximum(d, 0.0) ** 2 for d in distances)), nearest)


def has_true_distance(shape: Shape) -> bool:
    """Whether `distance` is the true one, and not a bound."""
    return shape.exact if isinstance(shape, Composed) else True


def surfaces(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Signed distances [m] of `points` (n, D) to each of the smooth surfaces of `shape`, negative inside -> (n, k); of
    a composed one to its surface as a whole."""
    match shape:
        case Box(lower, upper):
            return np.hstack([np.asarray(lower) - points, points - np.asarray(upper)])
        case Tube(center, inner, outer):
            r = _radius(points, center)
            return np.stack([inner - r, r - outer], axis=1)
        case Cylinder(start, end, outer, inner):
            along, r = cylinder_coordinates(shape, points)
            hole = [inner - r] if inner > 0.0 else []
            return np.stack([-along, along - math.dist(start, end), *hole, r - outer], axis=1)
    return distance(shape, points)[:, None]


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
            low, high = [-math.inf] * len(point), [math.inf] * len(point)
            axes = [d for d, n in enumerate(normal) if n != 0.0]
            if len(axes) == 1:
                (d,) = axes
                (high if normal[d] > 0.0 else low)[d] = point[d]
            return tuple(low), tuple(high)
        case Composed():
            along = np.eye(shape.dimensions)
            return tuple(-shape.support(-axis) for axis in along), tuple(shape.support(axis) for axis in along)


def support(shape: Shape, normal: np.ndarray) -> float:
    """How far `shape` reaches along `normal` (D,) of length 1 [m]: largest x . normal of its points, or a bound."""
    match shape:
        case Box(lower, upper):
            return float(np.maximum(np.asarray(lower) * normal, np.asarray(upper) * normal).sum())
        case Ball(center, radius) | Tube(center, _, radius):
            return float(np.asarray(center) @ normal) + radius
        case Cylinder(start, end, radius):
            axis = (np.asarray(end) - np.asarray(start)) / math.dist(start, end)
            ends = max(np.asarray(start) @ normal, np.asarray(end) @ normal)
            return float(ends + radius * math.sqrt(max(1.0 - (axis @ normal) ** 2, 0.0)))
        case HalfSpace(point, outward):
            along = np.asarray(outward) / math.hypot(*outward)
            return float(np.asarray(point) @ normal) if along @ normal > 1.0 - ROUNDING else math.inf
        case Composed():
            return shape.support(normal)


def volume(shape: Shape) -> float:
    """Length, area or volume of `shape` in its own number of dimensions [m, m2, m3], infinite of a HalfSpace."""
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
        case HalfSpace():
            return math.inf
        case Composed():
            return shape.volume()


def is_its_bounding_box(shape: Shape) -> bool:
    """Whether `shape` fills its bounding box, up to rounding."""
    match shape:
        case Composed():
            return _fills_its_bounding_box(shape)
        case HalfSpace(_, normal):
            return sum(n != 0.0 for n in normal) == 1
        case Ball(center, _):
            return len(center) == 1
    return isinstance(shape, Box)


@lru_cache(maxsize=256)
def _fills_its_bounding_box(shape: Composed) -> bool:
    lower, upper = (np.asarray(corner) for corner in bounding_box(shape))
    extent = upper - lower
    if not (np.all(np.isfinite(extent)) and np.all(extent > 0.0)):
        return False
    inner = np.array(list(itertools.product((1e-6, 1.0 - 1e-6), repeat=len(extent))))  # near its corners
    if not contains(shape, lower + inner * extent).all():
        return False
    return abs(shape.volume() / math.prod(extent) - 1.0) < ROUNDING


def smallest_extent(shape: Shape) -> float | None:
    """Smallest extent of a shape [m]; None for a half space and for what is composed."""
    match shape:
        case Box(lower, upper):
            return min(b - a for a, b in zip(lower, upper, strict=True))
        case Ball(_, radius):
            return 2.0 * radius
        case Tube(_, inner, outer):
            return outer - inner
        case Cylinder(start, end, outer, inner):
            return min(math.dist(start, end), outer - inner if inner > 0.0 else 2.0 * outer)
    return None


def volume_within(shape: Shape, lower: tuple[float, ...], upper: tuple[float, ...]) -> float | None:
    """Exact length, area or volume [m, m2, m3] of what lies in the box from `lower` to `upper` [m].

    None where there is no short formula: ends of the box cut the shape, but neither through its center nor, if it is a
    cylinder, through or across its axis; or it is composed.
    """
    low, high = bounding_box(shape)
    if not np.all(np.isfinite((low, high))):
        return None
    if isinstance(shape, Box) or (isinstance(shape, Composed) and is_its_bounding_box(shape)):
        return math.prod(max(min(b, e) - max(a, s), 0.0) for a, b, s, e in zip(low, high, lower, upper, strict=True))
    part = 1.0
    for axis, (a, b, start, end) in enumerate(zip(low, high, lower, upper, strict=True)):
        slack = 1e-9 * (b - a)
        if a >= start - slack and b <= end + slack:
            continue
        if b <= start or a >= end:
            return 0.0
        if _lies_along(shape, axis):
            part *= (min(b, end) - max(a, start)) / (b - a)
            continue
        halves = [abs(0.5 * (a + b) - plane) <= slack for plane in (start, end)]
        if not any(halves) or (a < start - slack and b > end + slack) or not _is_even(shape, axis):
            return None
        part *= 0.5
    return part * volume(shape)


def _lies_along(shape: Shape, axis: int) -> bool:
    """Whether it is a cylinder about a line along `axis`."""
    return isinstance(shape, Cylinder) and all(
        a == b for d, (a, b) in enumerate(zip(shape.start, shape.end, strict=True)) if d != axis
    )


def _is_even(shape: Shape, axis: int) -> bool:
    """Whether its two halves along `axis` are alike."""
    if isinstance(shape, Cylinder):
        return shape.start[axis] == shape.end[axis]
    return not isinstance(shape, Composed)
