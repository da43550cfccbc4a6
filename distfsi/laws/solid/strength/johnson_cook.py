"""The yield stress of metals by Johnson and Cook (paper, A.6 and A.7)."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pow

from distfsi.laws.law import StrengthMemory, number, quantity
from distfsi.laws.solid.metal import HeatedMetal


@dataclass(frozen=True)
class JohnsonCook(HeatedMetal):
    """Yield stress (A + B eps^n)(1 + C ln(rate/reference_rate))(1 - T*^m)."""

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    A: float = quantity("Pa", "initial yield stress", above=0.0)
    B: float = quantity("Pa", "hardening modulus", at_least=0.0)
    n: float = number("hardening exponent", above=0.0)
    C: float = number("rate coefficient", at_least=0.0)
    m: float = number("exponent of thermal softening (the paper's k)", above=0.0)
    reference_rate: float = quantity("1/s", "strain rate at which the rate factor is one", above=0.0, default=1.0)
    room_temperature: float = quantity("K", "temperature at the start, without softening", at_least=0.0)
    melt_temperature: float = quantity("K", "temperature at which no strength is left", at_least=0.0)
    heat_capacity: float = quantity("J/(kg K)", "specific heat capacity", above=0.0)
    taylor_quinney: float = number("share of plastic work that becomes heat", at_least=0.0, at_most=1.0, default=0.9)

    def check(self) -> None:
        """The material is solid at the start."""
        if self.melt_temperature <= self.room_temperature:
            raise ValueError("melt_temperature must be above room_temperature")

    def flow_stress_at_rest(self):
        return self.A

    def initial_yield(self, strain, temperature):
        return self.yield_stress(strain, 0.0, temperature)

    def flow(self, strain, increment, dt, temperature):
        total = strain + increment
        hardening = self.B * pow(total, self.n)
        rate_slope = (self.A + hardening) * self.C if increment > self.reference_rate * dt else 0.0
        strain_slope = self.n * hardening * increment / total * self.rate_factor(increment / dt)
        slope = self.softening(temperature) * (strain_slope + rate_slope)
        return (self.yield_stress(total, increment / dt, temperature), slope)

    def yield_stress(self, strain, rate, temperature):
        """Yield stress [Pa] of flow at a `rate` [1/s]."""
        return (self.A + self.B * pow(strain, self.n)) * self.rate_factor(rate) * self.softening(temperature)

    def rate_factor(self, rate):
        """1 + C ln(rate/reference), 1 below the reference rate; `rate` [1/s]."""
        return 1.0 + self.C * log(max(rate / self.reference_rate, 1.0))

    def softening(self, temperature):
        """1 - T*^m."""
        return 1.0 - pow(self.scaled_temperature(temperature), self.m)

    def scaled_temperature(self, temperature):
        """T*, 0 at room temperature and 1 when molten, held in between; `temperature` [K]."""
        return min(
            max((temperature - self.room_temperature) / (self.melt_temperature - self.room_temperature), 0.0), 1.0
        )

    def homologous_temperature(self, memory: StrengthMemory):
        return self.scaled_temperature(memory.temperature)
