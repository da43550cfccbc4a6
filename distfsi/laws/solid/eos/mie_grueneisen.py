"""The shock equation of state of metals (paper, A.1 corrected)."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

from distfsi.laws.law import EosMemory, Rest, SolidEos, number, quantity


@dataclass(frozen=True)
class MieGrueneisen(SolidEos):
    """Shock EOS with U = c0 + s1 u (+ s2, s3) and Grueneisen gamma0 + a mu.

    The reference Hugoniot is K mu (1 + b1 mu + b2 mu^2)/D(mu)^2, with K = rho0 c0^2, mu = rho/rho0 - 1, b1 = 1 -
    gamma0/2 and b2 = -a/2; in expansion (mu <= 0) it is K mu. Energies are per reference volume.
    """

    c0: float = quantity("m/s", "bulk sound speed", above=0.0)
    s1: float = number("slope of the shock speed")
    s2: float = number("second coefficient", default=0.0)
    s3: float = number("third coefficient", default=0.0)
    gamma0: float = number("Grueneisen coefficient")
    a: float = number("its change with compression", default=0.0)

    def reference_sound_speed(self, density):
        return self.c0

    def behind_shock(self, u: float) -> tuple[float, float]:
        """By how much sound is faster behind a shock U = c0 + s1 u, and the volume there over that in front of it."""
        return (2.0 * self.s1 - 1.0) * u, 1.0 - u / (self.c0 + self.s1 * u)

    def respond(self, density, energy, rest: Rest, memory: EosMemory):
        mu = density / rest.density - 1.0
        pressure = self.pressure(mu, energy, rest)
        return (pressure, self.modulus(mu, energy, pressure, rest), 0.0)

    def series(self, mu):
        """1 + b1 mu + b2 mu^2, and the slope of mu times it."""
        b1, b2 = 1.0 - 0.5 * self.gamma0, -0.5 * self.a
        return (1.0 + b1 * mu + b2 * mu * mu, 1.0 + 2.0 * b1 * mu + 3.0 * b2 * mu * mu)

    def divisor(self, mu):
        """D of the reference Hugoniot."""
        x = mu / (mu + 1.0)
        return 1.0 - (self.s1 - 1.0) * mu - self.s2 * mu * x - self.s3 * mu * x * x

    def divisor_slope(self, mu):
        """dD/dmu."""
        x, dx = mu / (mu + 1.0), 1.0 / ((mu + 1.0) * (mu + 1.0))
        return 1.0 - self.s1 - self.s2 * (x + mu * dx) - self.s3 * (x * x + 2.0 * mu * x * dx)

    def pressure(self, mu, energy, rest: Rest):
        """Pressure [Pa]."""
        divisor = self.divisor(mu)
        shock = self.series(mu)[0] / (divisor * divisor)
        cold = rest.bulk_modulus * mu * (shock if mu > 0.0 else 1.0)
        return cold + (self.gamma0 + self.a * mu) * rest.density * energy

    def modulus(self, mu, energy, pressure, rest: Rest):
        """Isentropic bulk modulus rho dp/drho [Pa]."""
        divisor = self.divisor(mu)
        series, slope = self.series(mu)
        dshock = (slope - 2.0 * mu * series * self.divisor_slope(mu) / divisor) / (divisor * divisor)
        cold = rest.bulk_modulus * (dshock if mu > 0.0 else 1.0) + self.a * rest.density * energy
        return (mu + 1.0) * cold + (self.gamma0 + self.a * mu) * pressure / (mu + 1.0)

    def free_swelling(self, energy):
        """Gas of the solid's own is not known: no more than tenfold."""
        hot = max(energy, 0.0)
        return -log(max(1.0 - self.gamma0 * hot / (self.c0 * self.c0 + self.a * hot), 0.1))
