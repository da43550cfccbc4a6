"""Bars in a body: what they are made of, and how they hold on to what is around them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Bond:
    """Shear stress [Pa] over slip [m] of a ribbed bar in concrete (CEB-FIP Model Code 1990, 3.1.1): strength *
    (slip/slips[0])^exponent, constant to slips[1], linear to the part `residual` of it at slips[2]."""

    strength: float
    slips: tuple[float, float, float]
    exponent: float
    residual: float


@dataclass(frozen=True)
class Bars:
    """Parallel bars of a `diameter` [m], `spacing` [m] apart and `cover` [m] from axis to surface, along each of the
    axes `directions`. In 3D they lie below the face that their `side` names, of the axis that is not among two
    directions or, of one direction, the last one; in 2D `spacing` is that across the plane, and one of them is seen.

    Steel: density [kg/m3], Young's `modulus`, yield_stress and `hardening` modulus [Pa], largest plastic strain. `bond`
    None: they do not slip. length [m] of the elements, about.
    """

    diameter: float
    spacing: float
    cover: float
    directions: tuple[int, ...]
    side: Literal["low", "high"]
    density: float
    modulus: float
    yield_stress: float
    hardening: float
    failure_strain: float
    bond: Bond | None
    length: float

    @property
    def section(self) -> float:
        """Area [m2] of one."""
        return 0.25 * math.pi * self.diameter**2
