"""Programmed burn: cells are lit by times that are known before the run (Giroux, HEMP User's Manual, UCRL-51079, 1973)
or, where a stronger wave comes first, by compression (Wilkins' beta burn)."""

from __future__ import annotations

from dataclasses import dataclass

from distfsi.laws.law import Burn, number, quantity

SMALLEST = 1e-4  # burnt share that counts


@dataclass(frozen=True)
class Programmed(Burn):
    """A detonation at a given speed D: burnt is the largest share so far of (t - t_l) D/(width h), since the lighting
    time t_l of a cell of size h, and all where the volume is below v_CJ, 1 - v_CJ/v0 = p_CJ/(rho0 D^2)."""

    density: float = quantity("kg/m3", "density of the explosive", above=0.0)
    energy: float = quantity("J/kg", "energy of detonation, of the products at that density", above=0.0)
    speed: float | None = quantity(
        "m/s", "speed of detonation; default the one that the equation of state gives", above=0.0, default=None
    )
    pressure: float | None = quantity(
        "Pa", "pressure behind the front; default the one that the equation of state gives", above=0.0, default=None
    )
    width: float = number("cells over which the front is spread", at_least=1.0, at_most=10.0, default=1.5)

    def unburnt(self, share, since, rho, spacing):
        # A share of the compression would burn what the smeared front has only begun to compress, ahead of its time:
        # that makes the front three cells wider and takes 3 % of its pressure.
        by_time = since * self.speed / (self.width * spacing)
        compression = (1.0 - self.density / rho) * (self.density * self.speed * self.speed / self.pressure)
        burnt = 1.0 if compression >= 1.0 else min(by_time, 1.0)
        return min(share, 1.0 - burnt if burnt > SMALLEST else 1.0)
