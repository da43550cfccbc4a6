"""Particles of composed shapes: lattices that fit their faces, and a relaxed packing where none does."""

from __future__ import annotations

import itertools
from functools import lru_cache

import numpy as np

from distfsi.scene.cloud import Cloud
from distfsi.scene.composed import Placed, Union, faces
from distfsi.scene.description import Packing, Shape
from distfsi.scene.relaxation import relaxed
from distfsi.scene.sections import Extrusion
from distfsi.scene.shapes import bounding_box, contains, volume

NARROWEST, WIDEST = 0.7, 1.45  # of a spacing: layers between two faces


@lru_cache(maxsize=64)
def fitted(shape: Shape, spacing: float, packing: Packing | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Particles of a whole `shape` about `spacing` [m] apart: positions (n, D) [m], volumes (n,) [m^D], which add up to
    that of the shape. Not to be written to.

    What is moved is filled where it stood before, parts that are apart one by one, an extrusion layer by layer. Where
    all faces lie across axes whole layers fit between them; otherwise the packing is a lattice, or "relaxed", by
    default.
    """
    match shape:
        case Cloud():
            return shape.positions, shape.volumes
        case Placed(inner, motion):
            positions, volumes = fitted(inner, spacing / motion.factor, packing)
            return motion(positions), volumes * motion.factor**shape.dimensions
        case Union(parts) if shape.are_apart:
            each = [fitted(part, spacing, packing) for part in parts]
            positions, volumes = (np.concatenate(columns) for columns in zip(*each, strict=True))
            return positions, volumes
        case Extrusion():
            return _drawn_out(shape, spacing, packing)
    between = None if packing == "relaxed" else _between_faces(shape, spacing)
    if between is not None:
        return between
    total = volume(shape)
    positions = lattice(shape, spacing) if packing == "lattice" else relaxed(shape, spacing, total)
    return positions, np.full(len(positions), total / max(len(positions), 1))


def fits_by_itself(shape: Shape) -> bool:
    """Whether a shape has a packing of its own, which knows more than the shape's surface."""
    return isinstance(shape, Cloud | Placed | Extrusion) or (isinstance(shape, Union) and shape.are_apart)


def lattice(shape: Shape, spacing: float) -> np.ndarray:
    """Points (n, D) inside `shape` of a lattice that fits the box around it."""
    lower, upper = bounding_box(shape)
    widths = [_layers(a, b, spacing) for a, b in zip(lower, upper, strict=True)]
    points = _grid([a + np.cumsum(w) - 0.5 * w for a, w in zip(lower, widths, strict=True)])
    return points[contains(shape, points)]


def _layers(lower: float, upper: float, spacing: float) -> np.ndarray:
    """Widths of the whole number of equal layers about `spacing` wide between two faces."""
    count = max(1, round((upper - lower) / spacing))
    return np.full(count, (upper - lower) / count)


def _grid(axes: list[np.ndarray]) -> np.ndarray:
    """All points (n, D) with coordinates of `axes`, x fastest."""
    return np.stack([grid.ravel() for grid in np.meshgrid(*reversed(axes), indexing="ij")][::-1], axis=1)


def _between_faces(shape: Shape, spacing: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Layers between all faces along each axis; None where not all faces lie across axes, or two lie too close."""
    planes = faces(shape)
    if planes is None:
        return None
    centers, widths = [], []
    for coordinates, lower, upper in zip(planes, *bounding_box(shape), strict=True):
        edges = sorted({lower, upper, *(x for x in coordinates if lower < x < upper)})
        layers = [_layers(a, b, spacing) for a, b in itertools.pairwise(edges)]
        if not all(NARROWEST * spacing <= each[0] <= WIDEST * spacing for each in layers):
            return None
        starts = zip(edges, layers, strict=False)
        centers.append(np.concatenate([a + (np.arange(len(w)) + 0.5) * w[0] for a, w in starts]))
        widths.append(np.concatenate(layers))
    points, sizes = _grid(centers), _grid(widths).prod(axis=1)
    inside = contains(shape, points)
    return points[inside], sizes[inside]


def _drawn_out(shape: Extrusion, spacing: float, packing: Packing | None) -> tuple[np.ndarray, np.ndarray]:
    section, areas = fitted(shape.section, spacing, packing)
    layers = _layers(shape.lower, shape.upper, spacing)
    heights = shape.lower + np.cumsum(layers) - 0.5 * layers
    flat = np.tile(section, (len(layers), 1))
    positions = np.insert(flat, shape.axis, np.repeat(heights, len(section)), axis=1)
    return positions, np.tile(areas * layers[0], len(layers))
