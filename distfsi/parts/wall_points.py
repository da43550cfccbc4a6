"""The points whose smoothed volumes make the wall: the particles, and more where bonds hold a stretched body."""

from __future__ import annotations

import numpy as np

FARTHEST = 1.25  # between points, in units of half a cell or of the particles' spacing, if that is more
LONGEST = 4  # points along each axis of a particle
PER_PARTICLE = LONGEST**3


def wall_points(c: dict[str, np.ndarray], cell: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position (n, D) [m], volume (n,) [m^D] and number (n,) of the points of this rank's particles, whose columns are
    `c`; `cell` [m]: the size of cells.

    A particle that bonds hold fills its cube of the reference state as it is deformed: there are points along the
    principal axes of its deformation, so many that no gap shows in a body that is whole. Any other particle is one.
    """
    position, volume = c["position"], c["mass"] / c["density"]
    if "deformation" not in c:
        return position, volume, c["id"]
    n, D = position.shape
    side = c["volume"] ** (1.0 / D)
    farthest = FARTHEST * np.maximum(0.5 * cell, side)
    rows = np.flatnonzero((side * np.linalg.norm(c["deformation"], axis=1) > farthest) & (c["bond_count"] > 0))
    F = c["deformation"][rows].reshape(-1, D, D)
    stretches, axes = np.linalg.eigh((F[:, :, None, :] * F[:, None, :, :]).sum(axis=-1))
    length = side[rows, None] * np.sqrt(np.maximum(stretches, 0.0))
    count = np.ones((n, D), dtype=np.int64)
    count[rows] = np.clip(np.ceil(length / farthest[rows, None]), 1, LONGEST)
    step = np.zeros((n, D, D))
    step[rows] = axes * (np.minimum(length, LONGEST * farthest[rows, None]) / count[rows])[:, None, :]
    points = count.prod(axis=1)
    parent = np.repeat(np.arange(n), points)
    rank = np.arange(len(parent)) - np.repeat(np.cumsum(points) - points, points)
    place, rest = position[parent], rank
    for axis in range(D):
        along = rest % count[parent, axis] - 0.5 * (count[parent, axis] - 1)
        place = place + along[:, None] * step[parent, :, axis]
        rest = rest // count[parent, axis]
    return place, (volume / points)[parent], c["id"][parent] * PER_PARTICLE + rank
