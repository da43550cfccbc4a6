"""Miller's afterburn: products burn on at a rate that grows with the pressure (Miller, Mat. Res. Soc. Symp. Proc. 418,
1996)."""

from __future__ import annotations

from dataclasses import dataclass
from math import pow

from distfsi.laws.law import Afterburn, number, quantity

UNIT = 1e6  # of the pressure in the law [Pa]


@dataclass(frozen=True)
class Miller(Afterburn):
    """The share s that is left of the products falls by ds/dt = -rate s^m (p/MPa)^n, once the explosive has burnt.

    It knows no oxygen: it burns in a vacuum, too. It never gives more than its `energy`.
    """

    energy: float = quantity("J/kg", "energy of the afterburn, beside that of the detonation", above=0.0)
    rate: float = quantity("1/s", "rate at 1 MPa, while all is left", above=0.0)
    m: float = number("exponent of the share that is left", at_least=0.0, below=1.0, default=0.5)
    n: float = number("exponent of the pressure", at_least=0.0, default=1.0 / 6.0)
    minimum_pressure: float = quantity("Pa", "pressure below which nothing burns", at_least=0.0, default=1e5)

    def left(self, share, unburnt, pressure, air, dt):
        # At one pressure s^(1 - m) falls evenly: exact, and never below zero.
        fall = (1.0 - self.m) * self.rate * dt * pow(max(pressure, 0.0) / UNIT, self.n)
        rest = max(pow(max(share, 0.0), 1.0 - self.m) - fall, 0.0)
        burns = pressure > self.minimum_pressure and unburnt < share
        return max(pow(rest, 1.0 / (1.0 - self.m)), unburnt) if burns else share
