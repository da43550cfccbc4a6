"""Jones-Wilkins-Lee products of detonation (paper, Eq. 13, with v = rho0/rho)."""

from dataclasses import dataclass
from math import exp

from distfsi.laws.law import FluidEos, number, quantity


@dataclass(frozen=True)
class Jwl(FluidEos):
    """Products of an explosive: p = A(1 - w/(R1 v)) exp(-R1 v) + B(1 - w/(R2 v)) exp(-R2 v) + w rho e, v = rho0/rho."""

    rho0: float = quantity("kg/m3", "density of the explosive", above=0.0)
    A: float = quantity("Pa", "first coefficient")
    B: float = quantity("Pa", "second coefficient")
    R1: float = number("first exponent", above=0.0)
    R2: float = number("second exponent", above=0.0)
    omega: float = number("Grueneisen coefficient w", above=0.0)

    def reference(self, rho):
        """Reference pressure [Pa] and its slope with density [m2/s2].

        With x = 1/v = rho/rho0: p = A (1 - w x/R1) exp(-R1/x) + B (1 - w x/R2) exp(-R2/x).
        """
        x = rho * (1.0 / self.rho0)
        v = 1.0 / x
        a = self.A * exp(-self.R1 * v)
        b = self.B * exp(-self.R2 * v)
        pressure = a * (1.0 - self.omega / self.R1 * x) + b * (1.0 - self.omega / self.R2 * x)
        # d exp(-R v)/dx = R v^2 exp(-R v)
        slope_a = a * (self.R1 * v * v - self.omega * v - self.omega / self.R1)
        slope_b = b * (self.R2 * v * v - self.omega * v - self.omega / self.R2)
        return (pressure, (slope_a + slope_b) * (1.0 / self.rho0))

    def grueneisen(self, rho):
        """Grueneisen coefficient and its slope with density."""
        return (self.omega, 0.0)

    def cold_curve(self, rho):
        """Pressure [Pa] and energy [J/kg] of the coldest state."""
        v = self.rho0 / rho
        a, b = self.A * exp(-self.R1 * v), self.B * exp(-self.R2 * v)
        return (a + b, a / (self.rho0 * self.R1) + b / (self.rho0 * self.R2))
