"""How the strength of a material scatters from place to place."""

from dataclasses import dataclass

from distfsi.laws.law import Law, entry, number, quantity


@dataclass(frozen=True)
class Scatter(Law):
    """Weibull's scatter of the failure strain and stress from particle to particle; larger ones fail earlier."""

    modulus: float = number("Weibull modulus: the larger, the less scatter", above=0.0)
    size: float = quantity("m", "edge of a piece (square, cube) that has the given values on average", above=0.0)
    seed: int = entry("chooses one of the possible specimens", at_least=0, default=0)
