"""Brittle failure by the largest principal stress."""

from __future__ import annotations

from dataclasses import dataclass

from distfsi.laws.law import DAMAGE, Failure, FailureMemory, Load, entry, quantity
from distfsi.laws.solid.cracks import tensile_damage
from distfsi.laws.solid.scatter import Scatter


@dataclass(frozen=True)
class PrincipalStress(Failure):
    """A crack opens where the largest principal stress reaches the tensile strength."""

    tensile_strength: float = quantity("Pa", "principal stress that breaks it", above=0.0)
    fracture_energy: float = quantity(
        "J/m2", "energy that a crack takes per area, at any spacing; 0: failure at once", at_least=0.0, default=0.0
    )
    scatter: Scatter | None = entry("Weibull's scatter; default none", default=None)

    columns = (DAMAGE,)

    def respond(self, load: Load, dt, width, memory: FailureMemory):
        strength = load.factor * self.tensile_strength
        opened = tensile_damage(load.principal, load.energy, strength, self.fracture_energy, width)
        return (max(memory.damage, opened),)
