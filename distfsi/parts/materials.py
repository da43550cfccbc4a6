"""The materials of a scene's bodies as rows of constants for physics/solid_eos.py and physics/strength.py."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from distfsi.scene.description import (
    Body,
    Elastic,
    JohnsonCook,
    LinearEos,
    MieGrueneisen,
    NoStrength,
    PerfectlyPlastic,
    Strength,
)

ROOM_TEMPERATURE = 293.15  # K, of materials that do not know their own


def eos_table(bodies: Sequence[Body]) -> np.ndarray:
    """(bodies, 9): the tuple `eos` of physics/solid_eos.py for each body."""
    return np.array([eos_constants(body.eos, body.density) for body in bodies])


def strength_table(bodies: Sequence[Body]) -> np.ndarray:
    """(bodies, 11): the tuple `strength` of physics/strength.py for each body."""
    return np.array([strength_constants(body.strength) for body in bodies])


def eos_constants(eos: MieGrueneisen | LinearEos, density: float) -> tuple[float, ...]:
    """rho0, c0, s1, s2, s3, gamma0, a, b1, b2."""
    match eos:
        case MieGrueneisen(c0, s1, s2, s3, gamma0, a):
            return density, c0, s1, s2, s3, gamma0, a, 1.0 - 0.5 * gamma0, -0.5 * a
        case LinearEos(bulk_modulus):
            return density, math.sqrt(bulk_modulus / density), 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


def strength_constants(strength: Strength) -> tuple[float, ...]:
    """Shear modulus, A, B, n, C, m, reference rate, room and melt temperature, heat capacity, Taylor-Quinney factor."""
    match strength:
        case NoStrength():
            return _rate_independent(0.0, 0.0)
        case Elastic(shear_modulus):
            return _rate_independent(shear_modulus, math.inf)
        case PerfectlyPlastic(shear_modulus, yield_stress):
            return _rate_independent(shear_modulus, yield_stress)
        case JohnsonCook(G, A, B, n, C, m, reference_rate, room, melt, heat_capacity, taylor_quinney):
            return G, A, B, n, C, m, reference_rate, room, melt, heat_capacity, taylor_quinney


def _rate_independent(shear_modulus: float, yield_stress: float) -> tuple[float, ...]:
    return shear_modulus, yield_stress, 0.0, 1.0, 0.0, 1.0, 1.0, ROOM_TEMPERATURE, math.inf, math.inf, 0.0
