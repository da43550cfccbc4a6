"""Pressure as a polynomial of the compression, of glass and ceramics."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from distfsi.laws.law import EosMemory, Rest, SolidEos, quantity


@dataclass(frozen=True)
class Polynomial(SolidEos):
    """p = K1 mu + K2 mu^2 + K3 mu^3 with mu = rho/rho0 - 1; in expansion p = K1 mu."""

    K1: float = quantity("Pa", "bulk modulus at rest", above=0.0)
    K2: float = quantity("Pa", "second coefficient", default=0.0)
    K3: float = quantity("Pa", "third coefficient", default=0.0)

    def reference_sound_speed(self, density):
        return sqrt(self.K1 / density)

    def respond(self, density, energy, rest: Rest, memory: EosMemory):
        mu = density / rest.density - 1.0
        squeezed = max(mu, 0.0)
        pressure = mu * self.K1 + squeezed * squeezed * (self.K2 + squeezed * self.K3)
        slope = self.K1 + squeezed * (2.0 * self.K2 + 3.0 * squeezed * self.K3)
        return (pressure, (1.0 + mu) * slope, 0.0)
