"""Cartesian coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from distfsi.coordinates import Coordinates


@dataclass(frozen=True)
class Planar(Coordinates):
    """Cartesian coordinates: all faces along an axis have one area, all cells one volume."""

    dimensions = (1, 2, 3)
    radial = False
    axes = "xyz"
    turns = 0
    whole = "the domain; in fewer than three dimensions per metre along those that are left out"

    def area(self, r: Any) -> Any:
        return 1.0 + 0.0 * r

    def volume(self, low: Any, high: Any) -> Any:
        return high - low

    def centroid(self, low: Any, high: Any) -> Any:
        return 0.5 * (low + high)


PLANAR = Planar()
