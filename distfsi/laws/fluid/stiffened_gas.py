"""The stiffened gas (paper, Eq. 14 corrected)."""

from dataclasses import dataclass

from distfsi.formulas.symbols import REST_DENSITY
from distfsi.laws.law import FluidEos, number, quantity


@dataclass(frozen=True)
class StiffenedGas(FluidEos):
    """p = (gamma - 1) rho e - gamma p_inf."""

    closed_form = True

    gamma: float = number("exponent", above=1.0)
    p_inf: float = quantity("Pa", "stiffening pressure", at_least=0.0)

    def reference(self, rho):
        """Reference pressure [Pa] and its slope with density [m2/s2]."""
        return (-self.gamma * self.p_inf, 0.0)

    def grueneisen(self, rho):
        """Grueneisen coefficient and its slope with density."""
        return (self.gamma - 1.0, 0.0)

    def cold_curve(self, rho):
        """Pressure [Pa] and energy [J/kg] of the coldest state."""
        return (-self.p_inf, self.p_inf / rho)

    def shifted_reference(self, rho):
        """The reference to energies counted from that at REST_DENSITY without pressure, a constant per mass.

        For water at 1 bar the energy itself is 7764 times the pressure over gamma - 1: too much for seven digits.
        """
        rise = self.gamma * self.p_inf / REST_DENSITY
        return (rise * (rho - REST_DENSITY), rise)
