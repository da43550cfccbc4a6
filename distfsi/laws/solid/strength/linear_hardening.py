"""A yield stress in proportion to the plastic strain."""

from __future__ import annotations

from dataclasses import dataclass

from distfsi.laws.law import quantity
from distfsi.laws.solid.metal import Metal


@dataclass(frozen=True)
class LinearHardening(Metal):
    """Yield stress that grows linearly with the plastic strain."""

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    yield_stress: float = quantity("Pa", "initial yield stress", above=0.0)
    hardening_modulus: float = quantity("Pa", "its growth with plastic strain", at_least=0.0)

    def flow_stress_at_rest(self):
        return self.yield_stress

    def initial_yield(self, strain, temperature):
        return self.yield_stress + self.hardening_modulus * strain

    def flow(self, strain, increment, dt, temperature):
        total = strain + increment
        hardening = self.hardening_modulus * total
        return (self.yield_stress + hardening, hardening * increment / total)
