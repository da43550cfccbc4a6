"""Hooke's law up to a yield stress, then radial return (paper, A.5)."""

from __future__ import annotations

from dataclasses import dataclass

from distfsi.laws.law import quantity
from distfsi.laws.solid.metal import Metal


@dataclass(frozen=True)
class PerfectlyPlastic(Metal):
    """Elastic up to a constant yield stress."""

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    yield_stress: float = quantity("Pa", "yield stress", above=0.0)

    def flow_stress_at_rest(self):
        return self.yield_stress

    def initial_yield(self, strain, temperature):
        return self.yield_stress

    def flow(self, strain, increment, dt, temperature):
        return (self.yield_stress, 0.0)
