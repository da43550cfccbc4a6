"""The pressure of concrete, whose pores close (Holmquist, Johnson & Cook 1993)."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt

from distfsi.laws.law import Column, EosMemory, Rest, SolidEos, number, quantity


@dataclass(frozen=True)
class Compaction(SolidEos):
    """Concrete, with strength `concrete`: elastic to the crush point, pores closing up to the lock pressure, then dense
    with p = K1 x + K2 x^2 + K3 x^3, x = (rho/rho0 - 1 - lock_strain)/(1 + lock_strain).

    mu = rho/rho0 - 1. All pores are closed at `full_strain`, where the curve of the dense material reaches the lock
    pressure. From the largest compression so far, `peak_compression`, the material unloads along a line.
    """

    partner = "concrete"

    crush_pressure: float = quantity("Pa", "pressure at which pores begin to close", above=0.0)
    crush_strain: float = number("rho/rho0 - 1 there", above=0.0)
    lock_pressure: float = quantity("Pa", "pressure at which all pores are closed", above=0.0)
    lock_strain: float = number("rho/rho0 - 1 of the material without pores, at no pressure", above=0.0)
    K1: float = quantity("Pa", "dense material, first coefficient", above=0.0)
    K2: float = quantity("Pa", "second")
    K3: float = quantity("Pa", "third")
    full_strain: float = field(init=False)

    columns = (Column("peak_compression", "1", "largest rho/rho0 - 1 so far"),)

    def __post_init__(self) -> None:
        """Find `full_strain` by Newton's method."""
        x = self.lock_pressure / self.K1
        for _ in range(50):
            missing = x * (self.K1 + x * (self.K2 + x * self.K3)) - self.lock_pressure
            x = x - missing / (self.K1 + x * (2.0 * self.K2 + x * 3.0 * self.K3))
        object.__setattr__(self, "full_strain", self.lock_strain + (1.0 + self.lock_strain) * x)

    def check(self) -> None:
        """The crush point comes first."""
        if self.crush_pressure >= self.lock_pressure or self.crush_strain >= self.lock_strain:
            raise ValueError("the crush point must lie below the lock point")

    def reference_sound_speed(self, density):
        return sqrt(self.crush_pressure / self.crush_strain / density)

    def respond(self, density, energy, rest: Rest, memory: EosMemory):
        mu = density / rest.density - 1.0
        before = self.compacted_strain(memory.peak_compression)
        peak = max(memory.peak_compression, mu)
        pressure = self.loading_pressure(peak) + self.unloading_modulus(peak) * (mu - peak)
        bulk = (1.0 + mu) * self.unloading_modulus(peak)
        return (pressure, bulk, self.compacted_strain(peak) - before, peak)

    def dense_pressure(self, mu):
        """Pressure [Pa] of the material without pores."""
        x = (mu - self.lock_strain) / (1.0 + self.lock_strain)
        return x * (self.K1 + x * (self.K2 + x * self.K3))

    def loading_pressure(self, mu):
        """Pressure [Pa] on first loading to mu >= 0: elastic, crushing, dense."""
        elastic = self.crush_pressure / self.crush_strain * mu
        share = (mu - self.crush_strain) / (self.full_strain - self.crush_strain)
        crushing = self.crush_pressure + share * (self.lock_pressure - self.crush_pressure)
        porous = elastic if mu < self.crush_strain else crushing
        return porous if mu < self.full_strain else self.dense_pressure(mu)

    def unloading_modulus(self, peak):
        """dp/dmu [Pa] of unloading from `peak`, between that of the sound and that of the dense material."""
        share = min(max((peak - self.crush_strain) / (self.full_strain - self.crush_strain), 0.0), 1.0)
        return (1.0 - share) * self.crush_pressure / self.crush_strain + share * self.K1

    def compacted_strain(self, peak):
        """mu at which no pressure is left after loading to `peak`."""
        return peak - self.loading_pressure(peak) / self.unloading_modulus(peak)
