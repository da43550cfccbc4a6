"""Shapes made of others: set operations, and shapes moved, turned and scaled."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from distfsi.scene.description import Ball, Box, Composed, Cylinder, HalfSpace, Shape, Tube
from distfsi.scene.measure import measure
from distfsi.scene.sections import Extrusion, Polygon
from distfsi.scene.shapes import bounding_box, dimensions, distance, has_true_distance, support, volume
from distfsi.scene.surface import Mesh

Faces = tuple[frozenset[float], ...]

# ---- sets ------------------------------------------------------------------------------------------------------------


TOUCHING = 1e-9  # of the size of a union: parts that are not farther from each other are one


@dataclass(frozen=True)
class Union(Composed):
    """All points in any of `shapes`. Inside, where they overlap or touch, the distance is a bound."""

    shapes: tuple[Shape, ...]

    @property
    def dimensions(self) -> int:
        return dimensions(self.shapes[0])

    @property
    def exact(self) -> bool:
        return self.are_apart and all(map(has_true_distance, self.shapes))

    def distance(self, points: np.ndarray) -> np.ndarray:
        nearest = self._nearest(points)
        slack = TOUCHING * self._size
        rows = np.flatnonzero(np.abs(nearest) <= slack)
        for axis in np.eye(self.dimensions):  # on a face that two parts share, all around is inside
            for step in (-4.0 * slack * axis, 4.0 * slack * axis):
                rows = rows[self._nearest(points[rows] + step) < -slack]
        nearest[rows] = -slack
        return nearest

    def _nearest(self, points: np.ndarray) -> np.ndarray:
        return np.minimum.reduce([distance(shape, points) for shape in self.shapes])

    @cached_property
    def _size(self) -> float:
        extents = [b - a for a, b in zip(*bounding_box(self), strict=True)]
        return max((extent for extent in extents if math.isfinite(extent)), default=1.0)

    def support(self, normal: np.ndarray) -> float:
        return max(support(shape, normal) for shape in self.shapes)

    def volume(self) -> float:
        return math.fsum(map(volume, self.shapes)) if self.are_apart else _volume(self)

    @cached_property
    def are_apart(self) -> bool:
        """Whether the boxes around the shapes do not touch each other."""
        boxes = [bounding_box(shape) for shape in self.shapes]
        return all(_apart(a, b) for a, b in itertools.combinations(boxes, 2))


def _apart(first: tuple[Sequence[float], ...], second: tuple[Sequence[float], ...]) -> bool:
    (a, b), (c, d) = first, second
    return any(upper < low or high < lower for lower, upper, low, high in zip(a, b, c, d, strict=True))


@dataclass(frozen=True)
class Intersection(Composed):
    """All points in each of `shapes`. Beside its edges the distance is a bound."""

    shapes: tuple[Shape, ...]

    @property
    def dimensions(self) -> int:
        return dimensions(self.shapes[0])

    @property
    def exact(self) -> bool:
        return False

    def distance(self, points: np.ndarray) -> np.ndarray:
        return np.maximum.reduce([distance(shape, points) for shape in self.shapes])

    def support(self, normal: np.ndarray) -> float:
        return min(support(shape, normal) for shape in self.shapes)

    def volume(self) -> float:
        return _volume(self)


@dataclass(frozen=True)
class Difference(Composed):
    """All points of `shape` in none of those `removed`. Beside the edges of a cut the distance is a bound."""

    shape: Shape
    removed: tuple[Shape, ...]

    @property
    def dimensions(self) -> int:
        return dimensions(self.shape)

    @property
    def exact(self) -> bool:
        return False

    def distance(self, points: np.ndarray) -> np.ndarray:
        return np.maximum.reduce([distance(self.shape, points), *(-distance(hole, points) for hole in self.removed)])

    def support(self, normal: np.ndarray) -> float:
        return support(self.shape, normal)

    def volume(self) -> float:
        return _volume(self)


@lru_cache(maxsize=256)
def _volume(shape: Composed) -> float:
    """By scene/measure.py: to round-off where all that meets is a box along the axes, otherwise to about 1e-5."""
    lower, upper = (np.asarray(corner) for corner in bounding_box(shape))
    if np.any(upper <= lower):
        return 0.0
    return measure(shape.distance, lower, upper, faces(shape))


def faces(shape: Shape) -> Faces | None:
    """Along each axis the coordinates [m] of all faces, if all are planes across an axis; None otherwise."""
    match shape:
        case Box(lower, upper):
            return tuple(frozenset(pair) for pair in zip(lower, upper, strict=True))
        case HalfSpace(point, normal) if sum(n != 0.0 for n in normal) == 1:
            return tuple(frozenset((x,) if n else ()) for x, n in zip(point, normal, strict=True))
        case Union(parts) | Intersection(parts):
            return _joined([faces(part) for part in parts])
        case Difference(whole, removed):
            return _joined([faces(part) for part in (whole, *removed)])
        case Polygon() if all(a == c or b == d for (a, b), (c, d) in shape.edges()):
            return tuple(frozenset(coordinates) for coordinates in zip(*shape.points, strict=True))
        case Extrusion(section, axis, lower, upper) if (flat := faces(section)) is not None:
            return (*flat[:axis], frozenset((lower, upper)), *flat[axis:])
        case Mesh():
            return shape.surface.faces
    return None


def _joined(each: list[Faces | None]) -> Faces | None:
    known = [one for one in each if one is not None]
    return tuple(frozenset().union(*sets) for sets in zip(*known, strict=True)) if len(known) == len(each) else None


def meshes_in(shape: Shape | None) -> Iterator[Mesh]:
    """All surfaces from files that a shape is made of."""
    match shape:
        case Mesh():
            yield shape
        case Placed(inner, _):
            yield from meshes_in(inner)
        case Union(parts) | Intersection(parts):
            for part in parts:
                yield from meshes_in(part)
        case Difference(whole, removed):
            for part in (whole, *removed):
                yield from meshes_in(part)


# ---- motions ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Similarity:
    """x -> factor turn x + shift: `turn` (D, D) is a rotation, a reflection or both, `shift` (D,) [m]."""

    turn: tuple[tuple[float, ...], ...]
    shift: tuple[float, ...]
    factor: float = 1.0

    @classmethod
    def about(cls, center: Sequence[float], turn: np.ndarray, factor: float = 1.0) -> Similarity:
        """The one that leaves `center` where it is. Entries of a turn that are whole numbers but for rounding are."""
        whole = np.rint(turn)
        turn = np.where(np.abs(turn - whole) < 1e-15, whole, turn)
        shift = np.asarray(center) - factor * turn @ np.asarray(center)
        return cls(tuple(map(tuple, turn.tolist())), tuple(shift.tolist()), factor)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Where `points` (n, D) go."""
        return self.factor * (points @ np.asarray(self.turn).T) + np.asarray(self.shift)

    def back(self, points: np.ndarray) -> np.ndarray:
        """Where points come from that go to `points` (n, D)."""
        return (points - np.asarray(self.shift)) @ np.asarray(self.turn) / self.factor

    def of(self, point: Sequence[float]) -> tuple[float, ...]:
        """Where one point (D,) goes."""
        return tuple(self(np.array([point]))[0].tolist())

    @property
    def keeps_axes(self) -> bool:
        """Whether boxes along the axes remain such."""
        return bool(np.all(np.isin(np.abs(np.asarray(self.turn)), (0.0, 1.0))))


@dataclass(frozen=True)
class Placed(Composed):
    """`shape` as `motion` places it; `placed` makes it, or a simpler one."""

    shape: Shape
    motion: Similarity

    @property
    def dimensions(self) -> int:
        return dimensions(self.shape)

    @property
    def exact(self) -> bool:
        return has_true_distance(self.shape)

    def distance(self, points: np.ndarray) -> np.ndarray:
        return self.motion.factor * distance(self.shape, self.motion.back(points))

    def support(self, normal: np.ndarray) -> float:
        turn, shift = np.asarray(self.motion.turn), np.asarray(self.motion.shift)
        return float(self.motion.factor * support(self.shape, normal @ turn) + shift @ normal)

    def volume(self) -> float:
        return self.motion.factor**self.dimensions * volume(self.shape)


def placed(shape: Shape, motion: Similarity) -> Shape:
    """`shape` as `motion` places it: of the same kind where there is such."""
    match shape:
        case Box(lower, upper) if motion.keeps_axes:
            ends = np.sort(motion(np.array([lower, upper])), axis=0).tolist()
            return Box(tuple(ends[0]), tuple(ends[1]))
        case Ball(center, radius):
            return Ball(motion.of(center), motion.factor * radius)
        case Tube(center, inner, outer):
            return Tube(motion.of(center), motion.factor * inner, motion.factor * outer)
        case Cylinder(start, end, outer, inner):
            return Cylinder(motion.of(start), motion.of(end), motion.factor * outer, motion.factor * inner)
        case HalfSpace(point, normal):
            return HalfSpace(motion.of(point), tuple((np.asarray(motion.turn) @ np.asarray(normal)).tolist()))
        case Union(parts) if motion.keeps_axes:
            return Union(tuple(placed(part, motion) for part in parts))
        case Intersection(parts) if motion.keeps_axes:
            return Intersection(tuple(placed(part, motion) for part in parts))
        case Difference(whole, removed) if motion.keeps_axes:
            return Difference(placed(whole, motion), tuple(placed(part, motion) for part in removed))
        case Polygon(points):
            return Polygon(tuple(map(motion.of, points)))
    return Placed(shape, motion)
