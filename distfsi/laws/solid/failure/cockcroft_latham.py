"""Ductile failure by the work of the largest principal stress (Cockcroft & Latham, J. Inst. Metals 96, 1968)."""

from __future__ import annotations

from dataclasses import dataclass

from distfsi.laws.law import DAMAGE, Failure, FailureMemory, Load, entry, quantity
from distfsi.laws.solid.cracks import DUCTILE_DAMAGE, ductile_softening
from distfsi.laws.solid.scatter import Scatter


@dataclass(frozen=True)
class CockcroftLatham(Failure):
    """It breaks where the integral of the largest principal tension over the plastic strain reaches critical_work."""

    critical_work: float = quantity("Pa", "plastic work per volume of the largest principal tension", above=0.0)
    fracture_energy: float = quantity(
        "J/m2", "energy that a crack takes per area, at any spacing; 0: failure at once", at_least=0.0, default=0.0
    )
    scatter: Scatter | None = entry("Weibull's scatter; default none", default=None)

    columns = (DAMAGE, DUCTILE_DAMAGE)

    def respond(self, load: Load, dt, width, memory: FailureMemory):
        before = memory.ductile_damage
        share = max(load.principal, 0.0) * load.increment / (load.factor * self.critical_work)
        used = min(before + share, 1.0) if before < 1.0 else before
        return ductile_softening(used, memory.damage, load, self.fracture_energy, width)
