"""Pressure in proportion to the compression."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from distfsi.laws.law import EosMemory, Rest, SolidEos, quantity


@dataclass(frozen=True)
class LinearEos(SolidEos):
    """p = K (rho/rho0 - 1)."""

    bulk_modulus: float = quantity("Pa", "bulk modulus K", above=0.0)

    def reference_sound_speed(self, density):
        return sqrt(self.bulk_modulus / density)

    def respond(self, density, energy, rest: Rest, memory: EosMemory):
        mu = density / rest.density - 1.0
        return (rest.bulk_modulus * mu, (mu + 1.0) * rest.bulk_modulus, 0.0)
