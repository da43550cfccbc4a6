"""How much of spheres and discs about the origin lies in cells: exact volumes, so that what is mapped is conserved.

Each function gives the volume between the origin and a corner; that of a cell is their sum over its corners, with
signs. So neighbours share what they leave each other to the bit, and all cells hold what the outermost corners hold.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

Array = np.ndarray
CornerVolume = Callable[..., Array]


def ball_to_corner(x: Array, y: Array, z: Array, radius: float) -> Array:
    """Volume [m3] of the part of a ball in a box from the origin to a corner (x, y, z), of any shape; odd in each."""
    sign = np.sign(x) * np.sign(y) * np.sign(z)
    a, b, c = (np.minimum(np.abs(along), radius) for along in (x, y, z))
    outside = np.pi / 6.0 * radius**3 - _cap(a, radius) - _cap(b, radius) - _cap(c, radius)
    outside += _wedge(a, b, radius) + _wedge(b, c, radius) + _wedge(a, c, radius)
    return sign * np.where(a * a + b * b + c * c <= radius**2, a * b * c, outside)


def _cap(a: Array, radius: float) -> Array:
    """Volume of the part of an octant of a ball that lies beyond a plane x = a."""
    return np.pi / 12.0 * (2.0 * radius**3 - 3.0 * radius**2 * a + a**3)


def _wedge(a: Array, b: Array, radius: float) -> Array:
    """Volume of the part of an octant of a ball that lies beyond both x = a and y = b."""
    w = np.sqrt(np.maximum(radius**2 - a * a - b * b, 0.0))
    beyond_a, beyond_b = (radius**2 * along - along**3 / 3.0 for along in (a, b))
    volume = 2.0 / 3.0 * radius**3 * np.arctan2(radius * w, a * b) + 2.0 / 3.0 * a * b * w
    return 0.5 * (volume - beyond_a * np.arctan2(w, b) - beyond_b * np.arctan2(w, a)) * (w > 0.0)


def disc_to_corner(x: Array, y: Array, radius: float) -> Array:
    """Area [m2] of the part of a disc in a rectangle from the origin to a corner (x, y); odd in each."""
    a, b = (np.minimum(np.abs(along), radius) for along in (x, y))
    outside = np.pi / 4.0 * radius**2 - _segment(a, radius) - _segment(b, radius)
    return np.sign(x) * np.sign(y) * np.where(a * a + b * b <= radius**2, a * b, outside)


def _segment(a: Array, radius: float) -> Array:
    """Area of the part of a quarter of a disc that lies beyond a line x = a."""
    w = np.sqrt(radius**2 - a * a)
    return 0.5 * (radius**2 * np.arctan2(w, a) - a * w)


def ball_to_ring(r: Array, z: Array, radius: float) -> Array:
    """Volume [m3] of the part of a ball in a cylinder about the z axis of radius r, from the origin to z; odd in z."""
    height, r = np.minimum(np.abs(z), radius), np.minimum(r, radius)
    full = np.minimum(height, np.sqrt(radius**2 - r * r))
    cap = radius**2 * (height - full) - (height**3 - full**3) / 3.0
    return np.sign(z) * np.pi * (r * r * full + cap)


def ball_to_shell(r: Array, radius: float) -> Array:
    """Volume [m3] of the part of a ball within r."""
    return 4.0 / 3.0 * np.pi * np.minimum(r, radius) ** 3


def disc_to_circle(r: Array, radius: float) -> Array:
    """Area [m2] of the part of a disc within r."""
    return np.pi * np.minimum(r, radius) ** 2


def in_cells(volume: CornerVolume, low: Array, high: Array, radius: float) -> Array:
    """The part (n,) of a ball or disc in n cells between their corners `low` and `high` (axes, n)."""
    total = np.zeros(low.shape[1])
    for corner in product((0, 1), repeat=len(low)):
        sign = (-1.0) ** (len(low) - sum(corner))
        total += sign * volume(*(high[d] if end else low[d] for d, end in enumerate(corner)), radius)
    return total
