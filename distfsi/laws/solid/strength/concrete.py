"""The strength of concrete by Holmquist, Johnson & Cook 1993 (paper, A.8-A.11 corrected)."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pow

from distfsi.formulas.symbols import FAILS
from distfsi.laws.law import PLASTIC_STRAIN, Column, Strength, StrengthMemory, Trial, number, quantity


@dataclass(frozen=True)
class Concrete(Strength):
    """Concrete of Holmquist, Johnson & Cook: yield at f_c (A (1 - D) + B p*^N)(1 + C ln(rate/reference_rate)), at
    most cap f_c. It needs the eos `compaction`; cracks in tension come from a `failure`.

    Plastic and compacted strain over max(D1 (p* + T*)^D2, minimum_failure_strain) sum up to the accumulated damage D.
    Without a failure model no tension beyond (1 - D) tensile_strength is carried; with one, cracks limit it instead.
    """

    partner = "compaction"

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    compressive_strength: float = quantity("Pa", "uniaxial compressive strength f_c", above=0.0)
    tensile_strength: float = quantity("Pa", "largest tension T; a `failure` takes its place", above=0.0)
    A: float = number("cohesion", at_least=0.0)
    B: float = number("hardening by pressure p* = p/f_c", at_least=0.0)
    N: float = number("its exponent", above=0.0)
    C: float = number("rate coefficient", at_least=0.0)
    cap: float = number("largest strength over f_c", above=0.0, default=7.0)
    D1: float = number("damage: failure strain D1 (p* + T*)^D2", above=0.0)
    D2: float = number("its exponent", at_least=0.0, default=1.0)
    minimum_failure_strain: float = number("and its floor", above=0.0)
    reference_rate: float = quantity("1/s", "strain rate at which the rate factor is one", above=0.0, default=1.0)

    columns = (PLASTIC_STRAIN, Column("accumulated_damage", "1", "plastic and compacted strain over those at failure"))

    def respond(self, trial: Trial, dt, memory: StrengthMemory):
        crushed = memory.accumulated_damage
        pressure = self.limited_tension(trial.pressure, crushed)
        # The carried share counts cracks in tension already.
        cracked = trial.damage if pressure > 0.0 else 0.0
        limit = self.yield_stress(pressure, trial.rate, max(crushed, cracked))
        increment = max(trial.stress - limit, 0.0) / (3.0 * self.shear_modulus)
        stress = limit if increment > 0.0 else trial.stress
        growth = (increment + trial.compaction) / self.failure_strain(pressure)
        return (stress, pressure, increment, memory.plastic_strain + increment, min(crushed + growth, 1.0))

    def limited_tension(self, pressure, damage):
        """The pressure [Pa], of which no more tension is carried than is left of the tensile strength."""
        if FAILS:
            return pressure if damage < 1.0 else max(pressure, 0.0)
        return max(pressure, -self.tensile_strength * (1.0 - damage)) if damage < 1.0 else max(pressure, 0.0)

    def yield_stress(self, pressure, rate, damage):
        """Von Mises stress [Pa] at yield (A.8, A.9 with the cap)."""
        faster = 1.0 + self.C * log(max(rate / self.reference_rate, 1.0))
        cohesion = self.A * (1.0 - damage)
        pressed = cohesion + self.B * pow(max(pressure, 0.0) / self.compressive_strength, self.N)
        strength = pressed if pressure > 0.0 else self.pulled_strength(pressure, cohesion, damage)
        return self.compressive_strength * min(strength * faster, self.cap)

    def pulled_strength(self, pressure, cohesion, damage):
        """Of f_c in tension: falls to zero at the largest tension, or is the cap where cracks limit it."""
        if FAILS:
            return self.cap
        cut_off = self.tensile_strength * (1.0 - damage) if damage < 1.0 else 0.0
        return cohesion * max(1.0 + pressure / max(cut_off, 1.0), 0.0)

    def failure_strain(self, pressure):
        """Plastic and compacted strain at which nothing but friction is left (A.11 with the floor)."""
        normal = max((pressure + self.tensile_strength) / self.compressive_strength, 0.0)
        return max(self.D1 * pow(normal, self.D2), self.minimum_failure_strain)

    def carried_share(self, pressure, damage):
        """Closed cracks carry by friction."""
        return 1.0 if pressure >= 0.0 else 1.0 - damage
