"""Rotations and reflections as matrices."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def rotation(dimensions: int, angle: float, axis: Sequence[float] = ()) -> np.ndarray:
    """(D, D) turn by `angle` [rad] about `axis` (3D, any length), counterclockwise seen from its tip."""
    c, s = math.cos(angle), math.sin(angle)
    if dimensions == 2:
        return np.array([[c, -s], [s, c]])
    x, y, z = np.asarray(axis) / math.hypot(*axis)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + s * across + (1.0 - c) * across @ across


def reflection(normal: Sequence[float]) -> np.ndarray:
    """(D, D) reflection at a plane through the origin."""
    n = np.asarray(normal) / math.hypot(*normal)
    return np.eye(len(n)) - 2.0 * np.outer(n, n)
