"""How much of each cell of a grid a shape fills, so that all cells together hold the shape's exact volume."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from distfsi.coordinates import Coordinates
from distfsi.coordinates.axisymmetric import Axisymmetric
from distfsi.coordinates.planar import PLANAR
from distfsi.scene.description import Ball, Composed, Shape
from distfsi.scene.measure import parts_inside
from distfsi.scene.overlaps import ball_to_ring, in_cells
from distfsi.scene.shapes import bounding_box, distance, is_its_bounding_box, smallest_extent

HALVINGS = 3  # of a cell that a curved or oblique surface may cut, along each axis, at least
ACROSS = 16  # parts of a cell across the smallest extent of a shape
LARGEST = 512  # parts across its largest extent, at most
ONE = 1 << 40  # a whole cell where fractions are summed as integers
ROUNDING = 4.0 / ONE  # of such a sum, in cells


class Filled(NamedTuple):
    """How many cells a shape fills: whole ones, the others' fractions f in units of 1/ONE, and f (1 - f) so, too.

    Sums of integers have no order, and so the same bits on any number of ranks.
    """

    whole: int = 0
    cut: int = 0
    room: int = 0

    @classmethod
    def by(cls, fractions: np.ndarray) -> Filled:
        """What `fractions` of cells add up to."""
        cut = fractions[(fractions > 0.0) & (fractions < 1.0)]
        sums = (int(np.rint(values * ONE).astype(np.int64).sum()) for values in (cut, cut * (1.0 - cut)))
        return cls(int(np.count_nonzero(fractions == 1.0)), *sums)

    @classmethod
    def together(cls, parts: Iterable[Filled]) -> Filled:
        """The sum of several."""
        return cls(*(sum(column) for column in zip(cls(), *parts, strict=True)))

    @property
    def cells(self) -> float:
        """The volume in cells."""
        return self.whole + self.cut / ONE


def corrected(fractions: np.ndarray, filled: Filled, cells: float | None) -> np.ndarray:
    """The fractions f of some cells such that all of them, now `filled`, come to `cells`, where that is known.

    f + k f (1 - f): what is empty or full remains so, and all others stay between.
    """
    missing = 0.0 if cells is None else cells - filled.cells
    if abs(missing) <= ROUNDING or filled.room == 0:
        return fractions
    k = min(max(missing / (filled.room / ONE), -1.0), 1.0)
    return fractions + k * fractions * (1.0 - fractions)


def cell_fractions(
    shape: Shape, centers: tuple[np.ndarray, ...], spacing: tuple[float, ...], coordinates: Coordinates = PLANAR
) -> np.ndarray:
    """Fraction of the volume of each cell of a grid that lies inside `shape`, shape ([nz,] [ny,] nx).

    `centers` holds the cell centers along each axis, `spacing` the cell sizes [m]. Exact for boxes and for a sphere on
    an axis; otherwise cells that the surface may cut are halved again and again, and what is left counts by its center;
    those of a composed shape in planar coordinates are cut by a plane (scene/measure.py). A cell's value depends on its
    own center only, so it is the same however the domain is cut into blocks.
    """
    shape_of_grid = tuple(len(x) for x in reversed(centers))
    if is_its_bounding_box(shape):
        lower, upper = bounding_box(shape)
        along = [_overlap(*args) for args in zip(lower, upper, centers, spacing, strict=True)]
        if coordinates.radial:
            along[0] = _overlap_in_r(lower[0], upper[0], centers[0], spacing[0], coordinates)
        return _outer_product(along)
    grids = np.meshgrid(*reversed(centers), indexing="ij")
    points = np.stack([g.ravel() for g in reversed(grids)], axis=1)
    if isinstance(coordinates, Axisymmetric) and isinstance(shape, Ball) and shape.center[0] == 0.0:
        return _of_sphere(shape, points, spacing, coordinates).reshape(shape_of_grid)
    signed = distance(shape, points)
    fractions = (signed < 0.0).astype(np.float64)
    cut = np.flatnonzero(np.abs(signed) < 0.5001 * math.hypot(*spacing))
    if isinstance(shape, Composed) and not coordinates.radial:
        fractions[cut], _ = parts_inside(shape.distance, points[cut], signed[cut], np.asarray(spacing))
    else:
        fractions[cut] = _halved(shape, points[cut], spacing, coordinates)
    return fractions.reshape(shape_of_grid)


def _of_sphere(sphere: Ball, centers: np.ndarray, spacing: tuple[float, ...], coordinates: Coordinates) -> np.ndarray:
    """Fractions (n,) of cells about `centers` (n, 2) around an axis that lie inside a sphere on it."""
    half = 0.5 * np.asarray(spacing)
    low, high = (centers - half - sphere.center).T, (centers + half - sphere.center).T
    fractions = in_cells(ball_to_ring, low, high, sphere.radius)
    fractions /= coordinates.volume(low[0], high[0]) * spacing[1]
    return np.where(fractions > 1.0 - 1e-9, 1.0, np.where(fractions < 1e-9, 0.0, fractions))


def _halved(shape: Shape, centers: np.ndarray, spacing: tuple[float, ...], coordinates: Coordinates) -> np.ndarray:
    """Fractions (n,) of the volume of cells about `centers` (n, D) that lie inside `shape`."""
    whole, wide = centers, np.asarray(spacing)
    fractions, cell = np.zeros(len(centers)), np.arange(len(centers))
    sizes, levels = np.asarray(spacing), _halvings(shape, spacing)
    corners = np.stack(np.meshgrid(*[(-0.5, 0.5)] * len(sizes), indexing="ij"), axis=-1).reshape(-1, len(sizes))
    for level in range(1, levels + 1):
        sizes = 0.5 * sizes
        centers = (centers[:, None, :] + corners * sizes).reshape(-1, len(sizes))
        cell = np.repeat(cell, len(corners))
        signed = distance(shape, centers)
        cut = np.abs(signed) < (0.5001 * math.hypot(*sizes) if level < levels else 0.0)
        full = (signed < 0.0) & ~cut
        shares = _shares(centers[full, 0], sizes[0], whole[cell[full], 0], wide[0], coordinates)
        inside = np.bincount(cell[full], shares, minlength=len(fractions))
        fractions += inside * 0.5 ** (len(sizes) * level)
        centers, cell = centers[cut], cell[cut]
    return fractions


def _shares(
    part: np.ndarray, size: float, cell: np.ndarray, spacing: float, coordinates: Coordinates
) -> np.ndarray | None:
    """Volumes of parts of a `size` [m] about positions along the first axis, over what they would be if volume lay
    evenly in their cells; None where it does."""
    if not coordinates.radial:
        return None
    parts = coordinates.volume(part - 0.5 * size, part + 0.5 * size) / size
    return parts * spacing / coordinates.volume(cell - 0.5 * spacing, cell + 0.5 * spacing)


def _halvings(shape: Shape, spacing: tuple[float, ...]) -> int:
    """How often a cell is halved: parts are small beside the shape, but not too many."""
    smallest = smallest_extent(shape)
    if smallest is None:
        return HALVINGS
    lower, upper = bounding_box(shape)
    across = max(b - a for a, b in zip(lower, upper, strict=True))
    part = max(smallest / ACROSS, across / LARGEST)
    return max(HALVINGS, math.ceil(math.log2(max(spacing) / part)))


def _overlap(lower: float, upper: float, centers: np.ndarray, spacing: float) -> np.ndarray:
    """Fraction of each interval of length `spacing` about `centers` that lies in [lower, upper]."""
    low = np.maximum((lower - centers) / spacing, -0.5)
    high = np.minimum((upper - centers) / spacing, 0.5)
    fraction = np.maximum(high - low, 0.0)
    return np.where(fraction > 1.0 - 1e-9, 1.0, np.where(fraction < 1e-9, 0.0, fraction))


def _overlap_in_r(
    lower: float, upper: float, centers: np.ndarray, spacing: float, coordinates: Coordinates
) -> np.ndarray:
    """Fraction of the volume of each interval of length `spacing` about `centers` that lies in [lower, upper]."""
    low, high = centers - 0.5 * spacing, centers + 0.5 * spacing
    inside = coordinates.volume(np.clip(lower, low, high), np.clip(upper, low, high))
    fraction = inside / coordinates.volume(low, high)
    return np.where(fraction > 1.0 - 1e-9, 1.0, np.where(fraction < 1e-9, 0.0, fraction))


def _outer_product(factors: list[np.ndarray]) -> np.ndarray:
    result = factors[-1]
    for factor in reversed(factors[:-1]):
        result = result[..., None] * factor
    return result
