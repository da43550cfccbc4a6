"""The strength of glass and ceramics by Johnson & Holmquist 1994 ("JH-2"): it falls with damage, and bulks."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pow, sqrt

from distfsi.formulas.symbols import FAILS
from distfsi.laws.law import PLASTIC_STRAIN, Column, Strength, StrengthMemory, Trial, number, quantity


@dataclass(frozen=True)
class JohnsonHolmquist(Strength):
    """JH-2 for glass and ceramics: yield at (1 - D) A (p* + T*)^N + D B p*^M, times 1 + C ln(rate/reference_rate),
    in units of the strength at the Hugoniot elastic limit; p* = p/p_HEL, T* = T/p_HEL. It needs the eos `polynomial`;
    cracks in tension come from a `failure`.

    Plastic strain over D1 (p* + T*)^D2 sums up to the accumulated damage D. What damage takes from the elastic energy
    of the deviator becomes pressure ("bulking"). Without a failure model no tension beyond (1 - D) T is carried; with
    one, cracks limit it instead.
    """

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    A: float = number("intact strength", above=0.0)
    B: float = number("strength of the fractured material", at_least=0.0)
    C: float = number("rate coefficient", at_least=0.0)
    M: float = number("exponent of the fractured material", above=0.0)
    N: float = number("exponent of the intact material", above=0.0)
    hugoniot_elastic_limit: float = quantity("Pa", "axial stress at the Hugoniot elastic limit", above=0.0)
    limit_pressure: float = quantity("Pa", "p_HEL: pressure there", above=0.0)
    tensile_strength: float = quantity("Pa", "largest tension T; a `failure` takes its place", above=0.0)
    fractured_cap: float = number("largest strength of the fractured material", above=0.0, default=1.0)
    D1: float = number("damage: failure strain D1 (p* + T*)^D2", at_least=0.0)
    D2: float = number("its exponent", default=1.0)
    bulking: float = number("share of the lost elastic energy that becomes pressure", at_least=0.0, at_most=1.0)
    reference_rate: float = quantity("1/s", "strain rate at which the rate factor is one", above=0.0, default=1.0)

    columns = (
        PLASTIC_STRAIN,
        Column("accumulated_damage", "1", "plastic strain over that at failure"),
        Column("bulking_pressure", "Pa", "pressure that damage has added"),
    )
    partner = "polynomial"

    def check(self) -> None:
        """There is a strength at the elastic limit."""
        if self.limit_pressure >= self.hugoniot_elastic_limit:
            raise ValueError("limit_pressure must be below hugoniot_elastic_limit")

    def respond(self, trial: Trial, dt, memory: StrengthMemory):
        before = memory.accumulated_damage
        pressure = self.limited_tension(trial.pressure + memory.bulking_pressure, before)
        # Flow at the strength that the damage so far has left.
        limit = self.yield_stress(pressure, trial.rate, before)
        increment = max(trial.stress - limit, 0.0) / (3.0 * self.shear_modulus)
        stress = limit if increment > 0.0 else trial.stress
        # Damage, and the pressure that comes from the elastic energy that it lets go.
        damage = self.grown_damage(before, increment, pressure)
        weaker = min(stress, self.yield_stress(pressure, trial.rate, damage))
        lost = (stress * stress - weaker * weaker) / (6.0 * self.shear_modulus)
        bulked = self.bulked(trial, memory.bulking_pressure, lost)
        strain = memory.plastic_strain + increment
        return (stress, pressure, increment, strain, damage, bulked)

    def yield_stress(self, pressure, rate, damage):
        """Von Mises stress [Pa] at yield."""
        normal, tension = pressure / self.limit_pressure, self.tensile_strength / self.limit_pressure
        faster = 1.0 + self.C * log(max(rate / self.reference_rate, 1.0))
        intact = self.A * pow(max(normal + tension, 0.0), self.N) * faster
        fractured = min(self.B * pow(max(normal, 0.0), self.M) * faster, self.fractured_cap)
        unit = 1.5 * (self.hugoniot_elastic_limit - self.limit_pressure)
        return unit * (intact - damage * (intact - min(fractured, intact)))

    def grown_damage(self, before, increment, pressure):
        """Accumulated damage after an increment of plastic strain; all at once where the failure strain is none."""
        normal = max((pressure + self.tensile_strength) / self.limit_pressure, 0.0)
        failure_strain = self.D1 * pow(normal, self.D2)
        growth = increment / max(failure_strain, 1e-12)
        return min(before + growth, 1.0)

    def bulked(self, trial: Trial, before, lost):
        """Bulking pressure [Pa] after `lost` [J/m3] of elastic energy, of compressed material."""
        linear = trial.rest_bulk * trial.compression
        total = linear + before
        after = sqrt(total * total + 2.0 * self.bulking * trial.rest_bulk * lost) - linear
        return after if trial.compression > 0.0 else before

    def limited_tension(self, pressure, damage):
        """The pressure [Pa], of which no more tension is carried than is left of the tensile strength."""
        if FAILS:
            return pressure if damage < 1.0 else max(pressure, 0.0)
        return max(pressure, -self.tensile_strength * (1.0 - damage)) if damage < 1.0 else max(pressure, 0.0)

    def carried_share(self, pressure, damage):
        """Closed cracks carry by friction."""
        return 1.0 if pressure >= 0.0 else 1.0 - damage
