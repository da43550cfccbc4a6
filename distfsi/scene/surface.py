"""Closed surfaces of triangles, read from STL, OBJ and PLY files: distance by a tree of boxes, inside by winding."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.scene.description import Composed
from distfsi.scene.units import length_factor

SUFFIXES = (".stl", ".obj", ".ply")
LEAF = 16  # triangles at most
FAR = 2.5  # radii of a cluster of triangles: from there it acts as one dipole
POINTS = 32  # along the longest edge, at which the volume of a surface that is not watertight is looked at
BLOCK = 100_000  # pairs of points and triangles looked at together


@dataclass(frozen=True)
class Mesh(Composed):
    """The inside of a surface of triangles in `file`, whose lengths are in `unit`. Its distance is the true one.

    A point is inside where the surface winds around it by more than one half, whichever way its triangles are turned;
    so small holes do not matter.
    """

    file: str
    unit: str

    @property
    def dimensions(self) -> int:
        return 3

    @property
    def exact(self) -> bool:
        return True

    @property
    def surface(self) -> Surface:
        """Its triangles."""
        return read_surface(self.file, self.unit)

    def distance(self, points: np.ndarray) -> np.ndarray:
        return self.surface.distance(points)

    def support(self, normal: np.ndarray) -> float:
        return float((self.surface.triangles.reshape(-1, 3) @ normal).max())

    def volume(self) -> float:
        return self.surface.volume


@lru_cache(maxsize=16)
def read_surface(file: str, unit: str) -> Surface:
    """The triangles in a file. Raises ValueError where it holds none, or cannot be read."""
    import trimesh

    path = Path(file)
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"is none of {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise ValueError(f"does not exist ({path})")
    try:
        mesh = trimesh.load_mesh(path)
    except Exception as error:  # whatever a broken file makes a reader raise
        raise ValueError(f"cannot be read: {error}") from error
    if len(getattr(mesh, "faces", ())) == 0:
        raise ValueError("holds no triangles")
    vertices, faces = in_metres(np.asarray(mesh.vertices), length_factor(unit)), np.asarray(mesh.faces)
    return Surface(vertices[faces], _open_edges(faces))


def in_metres(lengths: np.ndarray, factor: Fraction) -> np.ndarray:
    """`lengths` times `factor`, with the bits of the numbers as one writes them: what a file keeps in single precision
    is the shortest decimal that gives it."""
    values, index = np.unique(lengths, return_inverse=True)
    single = values.astype(np.float32)
    shortest = single if np.array_equal(single, values) else values
    metres = np.array([float(Fraction(str(value)) * factor) for value in shortest])
    return metres[index].reshape(lengths.shape)


def _open_edges(faces: np.ndarray) -> int:
    """Number of edges that do not have one triangle on each side, turned the same way."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    unique, direction = np.sort(edges, axis=1), np.where(edges[:, 0] < edges[:, 1], 1, -1)
    _, which, counts = np.unique(unique, axis=0, return_inverse=True, return_counts=True)
    balance = np.bincount(which.ravel(), direction, minlength=len(counts))
    return int(np.count_nonzero((counts % 2 != 0) | (balance != 0)))


class Surface:
    """Triangles (m, 3 corners, 3) [m].

    open_edges  edges that do not have a triangle on each side: none of a watertight surface
    """

    def __init__(self, triangles: np.ndarray, open_edges: int):
        areas = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2.0
        kept = np.linalg.norm(areas, axis=1) > 0.0
        self.triangles, self.open_edges = triangles[kept], open_edges
        self._tree = _Cluster.of(self.triangles, areas[kept], np.arange(np.count_nonzero(kept)))

    @cached_property
    def _middles(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.triangles.mean(axis=1))

    @cached_property
    def volume(self) -> float:
        """Of the inside [m3]: exact of a watertight surface, otherwise to about 3e-3."""
        center = self.triangles.reshape(-1, 3).mean(axis=0)
        a, b, c = (self.triangles - center).transpose(1, 0, 2)
        if self.open_edges == 0:
            return abs(math.fsum(np.einsum("ij,ij->i", a, np.cross(b, c)))) / 6.0
        lower, upper = self._tree.lower, self._tree.upper
        counts = np.maximum(np.ceil(POINTS * (upper - lower) / (upper - lower).max()), 1).astype(int)
        axes = [a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(lower, upper, counts, strict=True)]
        points = np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=1)
        return float(self.contains(points).mean() * np.prod(upper - lower))

    @cached_property
    def faces(self) -> tuple[frozenset[float], ...] | None:
        """Along each axis the coordinates [m] of all triangles, if all lie across an axis; None otherwise."""
        across = np.ptp(self.triangles, axis=1) == 0.0
        if not across.any(axis=1).all():
            return None
        return tuple(frozenset(self.triangles[across[:, axis], 0, axis].tolist()) for axis in range(3))

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance (n,) [m] of `points` (n, 3), negative inside."""
        if len(points) == 0:
            return np.empty(0)
        _, near = self._middles.query(points)
        squared = _squared_distances(points, self.triangles[near])
        self._tree.come_nearer(points, np.arange(len(points)), self.triangles, squared)
        return np.where(self.contains(points), -1.0, 1.0) * np.sqrt(squared)

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Whether the surface winds around each of `points` (n, 3) -> bool (n,)."""
        tree, inside = self._tree, np.zeros(len(points), dtype=bool)
        rows = np.flatnonzero(np.all((points >= tree.lower) & (points <= tree.upper), axis=1))
        angle = np.zeros(len(rows))
        tree.add_angles(points[rows], np.arange(len(rows)), self.triangles, angle)
        inside[rows] = np.abs(angle) > 2.0 * math.pi
        return inside


@dataclass(frozen=True)
class _Cluster:
    """Some triangles that lie together: the box around them, and what they are from far away, area vectors about
    `center`. Either `rows` of triangles or two `parts`."""

    lower: np.ndarray
    upper: np.ndarray
    center: np.ndarray
    radius: float
    area: np.ndarray
    rows: np.ndarray
    parts: tuple[_Cluster, ...]

    @classmethod
    def of(cls, triangles: np.ndarray, areas: np.ndarray, rows: np.ndarray) -> _Cluster:
        corners, size = triangles[rows].reshape(-1, 3), np.linalg.norm(areas[rows], axis=1)
        middles = triangles[rows].mean(axis=1)
        center = size @ middles / size.sum()
        radius = float(np.linalg.norm(corners - center, axis=1).max())
        parts: tuple[_Cluster, ...] = ()
        if len(rows) > LEAF:
            order = np.argsort(middles[:, np.argmax(np.ptp(middles, axis=0))], kind="stable")
            halves = rows[order[: len(rows) // 2]], rows[order[len(rows) // 2 :]]
            parts = tuple(cls.of(triangles, areas, half) for half in halves)
        return cls(corners.min(axis=0), corners.max(axis=0), center, radius, areas[rows].sum(axis=0), rows, parts)

    def come_nearer(self, points: np.ndarray, at: np.ndarray, triangles: np.ndarray, squared: np.ndarray) -> None:
        """Lower the `squared` distances of the points `at` where a triangle of the cluster is nearer."""
        outside = np.maximum(self.lower - points[at], 0.0) + np.maximum(points[at] - self.upper, 0.0)
        at = at[(outside**2).sum(axis=1) < squared[at]]
        if len(at) == 0:
            return
        for part in self.parts:
            part.come_nearer(points, at, triangles, squared)
        if not self.parts:
            for some in _blocks(at, len(self.rows)):
                nearest = _squared_distances(points[some][:, None], triangles[self.rows][None]).min(axis=1)
                squared[some] = np.minimum(squared[some], nearest)

    def add_angles(self, points: np.ndarray, at: np.ndarray, triangles: np.ndarray, angle: np.ndarray) -> None:
        """Add the solid angles under which the points `at` see the cluster."""
        offset = self.center - points[at]
        length = np.linalg.norm(offset, axis=1)
        far = length > FAR * self.radius
        angle[at[far]] += offset[far] @ self.area / length[far] ** 3
        near = at[~far]
        if len(near) == 0:
            return
        for part in self.parts:
            part.add_angles(points, near, triangles, angle)
        if not self.parts:
            for some in _blocks(near, len(self.rows)):
                angle[some] += _solid_angles(points[some], triangles[self.rows]).sum(axis=1)


def _blocks(at: np.ndarray, width: int) -> Iterator[np.ndarray]:
    step = max(1, BLOCK // width)
    for first in range(0, len(at), step):
        yield at[first : first + step]


def _solid_angles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n, t) solid angles of triangles seen from points, positive from behind (van Oosterom and Strackee 1983)."""
    a, b, c = (triangles[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    ab, bc, ca = ((u * v).sum(axis=2) for u, v in ((a, b), (b, c), (c, a)))
    numerator = (a * np.cross(b, c)).sum(axis=2)
    return 2.0 * np.arctan2(numerator, la * lb * lc + ab * lc + bc * la + ca * lb)


def _squared_distances(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n, t) squared distances of `points` (n or 1, t or 1, 3) to `triangles` (n or 1, t, 3 corners, 3)."""
    a, b, c = (triangles[..., k, :] for k in range(3))
    normal = np.cross(b - a, c - a)
    squared: np.ndarray = np.full(1, np.inf)
    above = np.full(1, True)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, offset = end - start, points - start
        along = np.clip(_dot(offset, edge) / _dot(edge, edge), 0.0, 1.0)
        beside = offset - along[..., None] * edge
        squared = np.minimum(squared, _dot(beside, beside))
        above = above & (_dot(offset, np.cross(normal, edge)) >= 0.0)
    return np.where(above, _dot(points - a, normal) ** 2 / _dot(normal, normal), squared)


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", first, second)
