"""Distance from an axis, and the place along it."""

from __future__ import annotations

from dataclasses import dataclass

from distfsi.coordinates.cylindrical import Cylindrical


@dataclass(frozen=True)
class Axisymmetric(Cylindrical):
    """Two dimensions: x is the distance r from an axis, y the place z along it; nothing turns about the axis."""

    dimensions = (2,)
    axes = "rz"
    whole = "all around the axis"
