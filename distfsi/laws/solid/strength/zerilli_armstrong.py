"""The yield stress of metals by Zerilli and Armstrong (J. Appl. Phys. 61, 1987), from the motion of dislocations."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, pow, sqrt

from distfsi.laws.law import number, quantity
from distfsi.laws.solid.metal import HeatedMetal


@dataclass(frozen=True)
class ZerilliArmstrong(HeatedMetal):
    """Yield stress C0 + (C1 + C2 sqrt(eps)) exp(-C3 T + C4 T ln(rate)) + C5 eps^n. Of metals with a body-centred
    lattice (iron) C2 is 0, of those with a face-centred one (copper) C1 and C5 are."""

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    C0: float = quantity("Pa", "yield stress without strain and thermal activation", at_least=0.0)
    C1: float = quantity("Pa", "thermal activation, body-centred lattice", at_least=0.0, default=0.0)
    C2: float = quantity("Pa", "thermal activation, face-centred lattice: by sqrt(eps)", at_least=0.0, default=0.0)
    C3: float = quantity("1/K", "softening by temperature T", at_least=0.0)
    C4: float = quantity("1/K", "hardening by rate, in 1/s", at_least=0.0)
    C5: float = quantity("Pa", "hardening by strain, body-centred lattice", at_least=0.0, default=0.0)
    n: float = number("its exponent", above=0.0, default=1.0)
    minimum_rate: float = quantity("1/s", "strain rate below which it falls no further", above=0.0, default=1e-3)
    room_temperature: float = quantity("K", "temperature at the start", at_least=0.0, default=293.15)
    heat_capacity: float = quantity("J/(kg K)", "specific heat capacity", above=0.0)
    taylor_quinney: float = number("share of plastic work that becomes heat", at_least=0.0, at_most=1.0, default=0.9)

    def check(self) -> None:
        """There is a yield stress."""
        if self.C0 + self.C1 + self.C2 == 0.0:
            raise ValueError("one of C0, C1 and C2 must be above 0")

    def flow_stress_at_rest(self):
        return self.yield_stress(0.0, self.minimum_rate, self.room_temperature)

    def initial_yield(self, strain, temperature):
        return self.yield_stress(strain, self.minimum_rate, temperature)

    def flow(self, strain, increment, dt, temperature):
        total, rate = strain + increment, increment / dt
        activated = self.activation(rate, temperature)
        hardening = 0.5 * self.C2 * sqrt(total) * activated + self.n * self.C5 * pow(total, self.n)
        faster = (self.C1 + self.C2 * sqrt(total)) * activated * self.C4 * temperature
        slope = hardening * increment / total + (faster if rate > self.minimum_rate else 0.0)
        return (self.yield_stress(total, rate, temperature), slope)

    def yield_stress(self, strain, rate, temperature):
        """Yield stress [Pa] of flow at a `rate` [1/s] and a `temperature` [K]."""
        thermal = (self.C1 + self.C2 * sqrt(strain)) * self.activation(rate, temperature)
        return self.C0 + thermal + self.C5 * pow(strain, self.n)

    def activation(self, rate, temperature):
        """exp(-C3 T + C4 T ln(rate)): what share of their barriers dislocations do not pass by heat alone."""
        return exp((self.C4 * log(max(rate, self.minimum_rate)) - self.C3) * temperature)
