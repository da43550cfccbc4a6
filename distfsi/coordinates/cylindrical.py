"""Distance from an axis."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

from distfsi.coordinates import Coordinates


@dataclass(frozen=True)
class Cylindrical(Coordinates):
    """One dimension: x is the distance r from an axis, along which nothing varies."""

    dimensions = (1,)
    whole = "all around the axis, per metre along it"

    def area(self, r: Any) -> Any:
        return 2.0 * pi * r

    def volume(self, low: Any, high: Any) -> Any:
        return pi * (low + high) * (high - low)

    def centroid(self, low: Any, high: Any) -> Any:
        middle = 0.5 * (low + high)
        return middle + (high - low) ** 2 / (12.0 * middle)
