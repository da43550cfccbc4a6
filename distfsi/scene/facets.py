"""The faces of a body on a lattice: those sides of its particles beside which it has no other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from distfsi.scene.description import Body, Domain, Shape
from distfsi.scene.shapes import contains, distance

ALIKE = 1e-4  # of a spacing: coordinates that are one
STEP = 1e-3  # of a spacing: over which the slope of a shape's distance is taken


@dataclass(frozen=True)
class Facets:
    """Sides of so many `particles` of a body.

    particle  (k,) whose they are
    outward   (k, D) unit vectors along an axis
    area      (k,) [m^(D-1)]
    center    (k, D) [m]
    normal    (k, D) of the body's own surface there, which a lattice follows in steps
    """

    particles: int
    particle: np.ndarray
    outward: np.ndarray
    area: np.ndarray
    center: np.ndarray
    normal: np.ndarray


def facets_of(body: Body, position: np.ndarray, volume: np.ndarray, domain: Domain, others: list[Shape]) -> Facets:
    """The free sides of a body's particles at `position` (n, D) [m] with their volumes (n,): not those at an end of the
    domain, nor those that another shape covers. Raises ValueError, in words, where they are on no lattice along the
    axes."""
    n, D = position.shape
    spacing = _spacing(position, float(volume[0]), body.spacing)
    index = np.rint((position - position.min(axis=0)) / spacing).astype(int)
    if np.abs(position - position.min(axis=0) - index * spacing).max() > ALIKE * spacing.max():
        raise ValueError(f"body '{body.name}' is on no lattice along the axes; loads need one (packing, lattice_angle)")
    filled = np.zeros(index.max(axis=0) + 3, dtype=bool)
    filled[tuple(index.T + 1)] = True
    found = []
    for axis in range(D):
        for side in (-1, 1):
            unit = np.zeros(D)
            unit[axis] = side
            rows = np.flatnonzero(~filled[tuple(index.T + 1 + unit.astype(int)[:, None])])
            center = position[rows] + 0.5 * spacing[axis] * unit
            end = (domain.lower if side < 0 else domain.upper)[axis]
            free = np.abs(center[:, axis] - end) > ALIKE * spacing[axis]
            for other in others:
                free &= ~contains(other, center + 0.25 * spacing[axis] * unit)
            rows, center = rows[free], center[free]
            area = np.full(len(rows), math.prod(np.delete(spacing, axis)))
            outward = np.broadcast_to(unit, center.shape)
            found.append((rows, outward, area, center, _normals(body.shape, center, outward, spacing.min())))
    return Facets(n, *(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _spacing(position: np.ndarray, volume: float, nominal: float) -> np.ndarray:
    """Distance (D,) [m] of layers along each axis; along one that has a single layer the volume gives it."""
    found = np.full(position.shape[1], np.nan)
    for axis, x in enumerate(position.T):
        steps = np.diff(np.unique(x))
        steps = steps[steps > ALIKE * nominal]
        if len(steps):
            found[axis] = steps.min()
    single = np.isnan(found)
    if single.any():
        found[single] = (volume / np.prod(found[~single])) ** (1.0 / single.sum())
    return found


def _normals(shape: Shape, center: np.ndarray, outward: np.ndarray, spacing: float) -> np.ndarray:
    """Unit normals of the surface near facets; their own where the shape's points inwards."""
    D, step = center.shape[1], STEP * spacing
    slope = np.stack(
        [distance(shape, center + step * unit) - distance(shape, center - step * unit) for unit in np.eye(D)], axis=1
    )
    length = np.linalg.norm(slope, axis=1, keepdims=True)
    normal = slope / np.where(length > 0.0, length, 1.0)
    return np.where((normal * outward).sum(axis=1, keepdims=True) > 0.0, normal, outward)
