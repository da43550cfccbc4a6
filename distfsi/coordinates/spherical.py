"""Distance from a point."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

from distfsi.coordinates import Coordinates


@dataclass(frozen=True)
class Spherical(Coordinates):
    """One dimension: x is the distance r from a point, in all directions."""

    dimensions = (1,)
    turns = 2
    whole = "all directions"

    def area(self, r: Any) -> Any:
        return 4.0 * pi * (r * r)

    def volume(self, low: Any, high: Any) -> Any:
        return 4.0 / 3.0 * pi * (low * low + low * high + high * high) * (high - low)

    def centroid(self, low: Any, high: Any) -> Any:
        middle, square = 0.5 * (low + high), (high - low) ** 2
        return middle * (middle**2 + square / 4.0) / (middle**2 + square / 12.0)
