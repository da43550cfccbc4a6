"""What a coordinate system is: a file of this folder, named by the word that chooses it as `domain.symmetry`.

Along the first axis faces may have areas and cells volumes that depend on the distance r from a point or an axis. From
three formulas follow fluxes, pressure, totals and shares of cells everywhere (fluid/metrics.py, scene/shapes.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from distfsi.laws.law import Law
from distfsi.laws.registry import laws_of, word_of


@dataclass(frozen=True)
class Coordinates(Law):
    """A coordinate system; its formulas take numbers and arrays of them.

    dimensions  of the domains that it is for
    radial      whether the first axis is a distance r >= 0
    axes        names of the axes
    whole       what totals count
    turns       of how many dimensions besides those of the domain: about an axis, about a point
    """

    folder = "coordinates"
    dimensions: ClassVar[tuple[int, ...]]
    radial: ClassVar[bool] = True
    axes: ClassVar[str] = "r"
    whole: ClassVar[str]
    turns: ClassVar[int] = 1

    def area(self, r: Any) -> Any:
        """Area of a face normal to the first axis at r [m], per length along the second axis."""
        raise NotImplementedError

    def volume(self, low: Any, high: Any) -> Any:
        """Volume between two faces: the area's integral over r."""
        raise NotImplementedError

    def centroid(self, low: Any, high: Any) -> Any:
        """Where the volume between two faces has its centre [m]: there a linear function has its mean."""
        raise NotImplementedError


def coordinates_of(word: str) -> Coordinates:
    """The coordinate system that a word of the input chooses. Raises KeyError."""
    return {word_of(kind): kind for kind in laws_of(Coordinates)}[word]()
