"""The fracture strain of metals by Johnson and Cook, and spall."""

from dataclasses import dataclass

from distfsi.laws.law import Failure, entry, number, quantity
from distfsi.laws.solid.scatter import Scatter


@dataclass(frozen=True)
class JohnsonCookFailure(Failure):
    """Fracture strain (D1 + D2 exp(D3 eta))(1 + D4 ln(rate/reference_rate))(1 + D5 T*), eta = mean/von Mises stress."""

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
