"""Brittle failure by the largest principal stress."""

from dataclasses import dataclass

from distfsi.laws.law import Failure, entry, quantity
from distfsi.laws.solid.scatter import Scatter


@dataclass(frozen=True)
class PrincipalStress(Failure):
    """A crack opens where the largest principal stress reaches the tensile strength."""

    tensile_strength: float = quantity("Pa", "principal stress that breaks it", above=0.0)
    fracture_energy: float = quantity(
        "J/m2", "energy that a crack takes per area, at any spacing; 0: failure at once", at_least=0.0, default=0.0
    )
    scatter: Scatter | None = entry("Weibull's scatter; default none", default=None)
