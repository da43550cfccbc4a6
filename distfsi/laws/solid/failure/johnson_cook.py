"""The fracture strain of metals by Johnson and Cook 1985, and spall."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log

from distfsi.laws.law import DAMAGE, Failure, FailureMemory, Load, entry, number, quantity
from distfsi.laws.solid.cracks import DUCTILE_DAMAGE, ductile_softening, tensile_damage
from distfsi.laws.solid.scatter import Scatter

CRUSHED, HIGHEST_TRIAXIALITY = -1.0 / 3.0, 1.5  # below the one no void grows; above the other the law was not measured


@dataclass(frozen=True)
class JohnsonCookFailure(Failure):
    """Fracture strain (D1 + D2 exp(D3 eta))(1 + D4 ln(rate/reference_rate))(1 + D5 T*), eta = mean/von Mises stress.

    `ductile_damage` is the plastic strain over the fracture strain, until that is 1.
    """

    D1: float = number("fracture strain at large tension")
    D2: float = number("its growth towards compression")
    D3: float = number("exponent; negative, tension positive")
    D4: float = number("rate coefficient", default=0.0)
    D5: float = number("temperature coefficient", default=0.0)
    reference_rate: float = quantity("1/s", "strain rate at which the rate factor is one", above=0.0, default=1.0)
    spall_strength: float | None = quantity("Pa", "principal stress that also breaks it", above=0.0, default=None)
    fracture_energy: float = quantity(
        "J/m2", "energy that a crack takes per area, at any spacing; 0: failure at once", at_least=0.0, default=0.0
    )
    scatter: Scatter | None = entry("Weibull's scatter; default none", default=None)

    columns = (DAMAGE, DUCTILE_DAMAGE)

    def respond(self, load: Load, dt, width, memory: FailureMemory):
        # Plastic flow uses up the fracture strain.
        flows = load.increment > 0.0 and memory.ductile_damage < 1.0
        used = min(memory.ductile_damage + self.used_share(load, dt), 1.0) if flows else memory.ductile_damage
        # Then its work opens a crack.
        torn, ductile = ductile_softening(used, memory.damage, load, self.fracture_energy, width)
        # Spall.
        strength = load.factor * self.spall_strength
        opened = tensile_damage(load.principal, load.energy, strength, self.fracture_energy, width)
        return (max(torn, opened), ductile)

    def used_share(self, load: Load, dt):
        """What the increment of plastic strain uses up of the fracture strain; nothing if crushed."""
        triaxiality = -load.pressure / max(load.flow_stress, 1.0)
        limit = load.factor * self.fracture_strain(triaxiality, load.increment / dt, load.homologous)
        return load.increment / limit if triaxiality > CRUSHED else 0.0

    def fracture_strain(self, triaxiality, rate, homologous):
        """Plastic strain at fracture, `rate` [1/s] and all else held."""
        opening = self.D1 + self.D2 * exp(self.D3 * min(triaxiality, HIGHEST_TRIAXIALITY))
        faster = 1.0 + self.D4 * log(max(rate / self.reference_rate, 1.0))
        return opening * faster * (1.0 + self.D5 * homologous)
