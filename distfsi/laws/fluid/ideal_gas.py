"""The ideal gas (paper, Eq. 12)."""

from dataclasses import dataclass

from distfsi.laws.law import FluidEos, number


@dataclass(frozen=True)
class IdealGas(FluidEos):
    """p = (gamma - 1) rho e."""

    closed_form = True

    gamma: float = number("ratio of specific heats", above=1.0)

    def reference(self, rho):
        """Reference pressure [Pa] and its slope with density [m2/s2]."""
        return (0.0, 0.0)

    def grueneisen(self, rho):
        """Grueneisen coefficient and its slope with density."""
        return (self.gamma - 1.0, 0.0)

    def cold_curve(self, rho):
        """Pressure [Pa] and energy [J/kg] of the coldest state."""
        return (0.0, 0.0)
