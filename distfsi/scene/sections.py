"""Sections and what becomes of them: polygons, and shapes extruded or revolved."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from distfsi.scene.description import Ball, Box, Composed, Cylinder, Shape, Tube
from distfsi.scene.measure import measure
from distfsi.scene.shapes import bounding_box, distance, has_true_distance, meet, support, volume


@dataclass(frozen=True)
class Polygon(Composed):
    """Polygon (2D) with corners `points` [m], in order around it; its edges do not cross."""

    points: tuple[tuple[float, ...], ...]

    @property
    def dimensions(self) -> int:
        return 2

    @property
    def exact(self) -> bool:
        return True

    def distance(self, points: np.ndarray) -> np.ndarray:
        nearest, inside = np.full(len(points), np.inf), np.zeros(len(points), dtype=bool)
        x, y = points.T
        for (ax, ay), (bx, by) in self.edges():
            along = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2), 0.0, 1.0)
            np.minimum(nearest, np.hypot(x - ax - along * (bx - ax), y - ay - along * (by - ay)), out=nearest)
            if ay != by:  # each edge that a ray along x crosses changes sides
                inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay))
        return np.where(inside, -nearest, nearest)

    def support(self, normal: np.ndarray) -> float:
        return float((np.asarray(self.points) @ normal).max())

    def volume(self) -> float:
        return abs(math.fsum(ax * by - bx * ay for (ax, ay), (bx, by) in self.edges())) / 2.0

    def crosses_itself(self) -> bool:
        """Whether edges that are not neighbours meet."""
        edges = self.edges()
        pairs = itertools.combinations(range(len(edges)), 2)
        return any(_cross(*edges[i], *edges[j]) for i, j in pairs if 1 < j - i < len(edges) - 1)

    def edges(self) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
        """Pairs of corners."""
        return list(zip(self.points, self.points[1:] + self.points[:1], strict=True))


def _cross(a: Sequence[float], b: Sequence[float], c: Sequence[float], d: Sequence[float]) -> bool:
    """Whether the segments from a to b and from c to d meet."""

    def side(p: Sequence[float], q: Sequence[float], r: Sequence[float]) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    overlap = all(max(min(a[k], b[k]), min(c[k], d[k])) <= min(max(a[k], b[k]), max(c[k], d[k])) for k in range(2))
    return overlap and side(a, b, c) * side(a, b, d) <= 0.0 and side(c, d, a) * side(c, d, b) <= 0.0


@dataclass(frozen=True)
class Extrusion(Composed):
    """A `section` in the plane of the other two axes, in their order, from `lower` to `upper` [m] along `axis`."""

    section: Shape
    axis: int
    lower: float
    upper: float

    @property
    def dimensions(self) -> int:
        return 3

    @property
    def exact(self) -> bool:
        return has_true_distance(self.section)

    def distance(self, points: np.ndarray) -> np.ndarray:
        along = points[:, self.axis]
        return meet(distance(self.section, self.flat(points)), np.maximum(self.lower - along, along - self.upper))

    def support(self, normal: np.ndarray) -> float:
        across = self.flat(normal[None])[0]
        length = math.hypot(*across)
        wide = length * support(self.section, across / length) if length > 0.0 else 0.0
        return wide + max(normal[self.axis] * self.lower, normal[self.axis] * self.upper)

    def volume(self) -> float:
        return volume(self.section) * (self.upper - self.lower)

    def flat(self, points: np.ndarray) -> np.ndarray:
        """`points` (n, 3) in the plane of the section, (n, 2)."""
        return np.delete(points, self.axis, axis=1)


def extruded(section: Shape, axis: int, lower: float, upper: float) -> Shape:
    """An extrusion, or the box or cylinder that it is."""

    def at(flat: Sequence[float], height: float) -> tuple[float, ...]:
        return (*flat[:axis], height, *flat[axis:])

    match section:
        case Box(low, high):
            return Box(at(low, lower), at(high, upper))
        case Ball(center, radius):
            return Cylinder(at(center, lower), at(center, upper), radius, 0.0)
        case Tube(center, inner, outer):
            return Cylinder(at(center, lower), at(center, upper), outer, inner)
    return Extrusion(section, axis, lower, upper)


@dataclass(frozen=True)
class Revolution(Composed):
    """A `section` turned about a line through `center` [m] along `axis`. It is given by distance from the line and
    height above `center`; on the line's other side, as far as it reaches there, it is cut off."""

    section: Shape
    axis: int
    center: tuple[float, ...]

    @property
    def dimensions(self) -> int:
        return 3

    @property
    def exact(self) -> bool:
        return False  # an edge of the section on the line is none of the surface

    def distance(self, points: np.ndarray) -> np.ndarray:
        relative = points - np.asarray(self.center)
        r = np.hypot(*np.delete(relative, self.axis, axis=1).T)
        return distance(self.section, np.stack([r, relative[:, self.axis]], axis=1))

    def support(self, normal: np.ndarray) -> float:
        across = math.hypot(*np.delete(normal, self.axis))
        flat = np.array([across, normal[self.axis]])
        return float(support(self.section, flat / math.hypot(*flat)) + np.asarray(self.center) @ normal)

    def volume(self) -> float:
        match self.section:
            case Polygon():
                return _revolved_area(_right_of_line(self.section.points))
            case Box((left, low), (right, high)):
                return math.pi * (right**2 - max(left, 0.0) ** 2) * (high - low)
            case Ball((r, _), radius) | Tube((r, _), _, radius) if r >= radius:
                return 2.0 * math.pi * r * volume(self.section)  # Pappus
        return _measured(self)


def revolved(section: Shape, axis: int, center: tuple[float, ...]) -> Shape:
    """A revolution. A box or polygon with an edge on the line is continued across it, so that the line is inside."""
    match section:
        case Box((0.0, low), (right, high)):
            return Revolution(Box((-right, low), (right, high)), axis, center)
        case Polygon(points) if min(x for x, _ in points) == 0.0:
            for n, ((x, _), (other, _)) in enumerate(section.edges()):
                if x == other == 0.0:
                    chain = (*points[n + 1 :], *points[: n + 1])  # begins and ends on the line
                    across = tuple((-r, z) for r, z in reversed(chain[1:-1]))
                    return Revolution(Polygon((*chain, *across)), axis, center)
    return Revolution(section, axis, center)


def _right_of_line(points: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    """The part of a polygon whose first coordinate is positive."""
    kept: list[tuple[float, float]] = []
    for (ax, ay), (bx, by) in zip(points, [*points[1:], points[0]], strict=True):
        if ax >= 0.0:
            kept.append((ax, ay))
        if (ax < 0.0) != (bx < 0.0):
            kept.append((0.0, ay + (by - ay) * ax / (ax - bx)))
    return kept


def _revolved_area(points: Sequence[tuple[float, float]]) -> float:
    """2 pi times the integral of r over a polygon in (r, z), by Green's theorem."""
    pairs = zip(points, [*points[1:], points[0]], strict=True)
    terms = ((a * a + a * b + b * b) * (z - y) for (a, y), (b, z) in pairs)
    return abs(math.fsum(terms)) * math.pi / 3.0


@lru_cache(maxsize=64)
def _measured(shape: Revolution) -> float:
    lower, upper = (np.asarray(corner) for corner in bounding_box(shape))
    return measure(shape.distance, lower, upper)
