"""The Noble-Abel stiffened gas (Le Metayer, Saurel, Phys. Fluids 28, 046102, 2016)."""

from dataclasses import dataclass
from math import sqrt

from distfsi.formulas.symbols import REST_DENSITY
from distfsi.laws.law import FluidEos, number, quantity


@dataclass(frozen=True)
class Nasg(FluidEos):
    """Noble-Abel stiffened gas, for liquids: p = (gamma - 1)(e - q) rho/(1 - b rho) - gamma p_inf."""

    closed_form = True

    gamma: float = number("exponent", above=1.0)
    p_inf: float = quantity("Pa", "stiffening pressure", at_least=0.0)
    covolume: float = quantity("m3/kg", "room b that the molecules take; no state is as dense as 1/b", above=0.0)
    q: float = quantity("J/kg", "energy that heat is counted from", default=0.0)

    def reference(self, rho):
        """Reference pressure [Pa] and its slope with density [m2/s2]."""
        omega, omega_slope = self.grueneisen(rho)
        return (-omega * rho * self.q - self.gamma * self.p_inf, -self.q * (omega + rho * omega_slope))

    def shifted_reference(self, rho):
        """The reference to energies counted from that at REST_DENSITY without pressure, a constant per mass; q goes."""
        root = sqrt(1.0 - self.covolume * rho)
        room = root * root
        rise = self.gamma * self.p_inf / REST_DENSITY
        slope = rise * (1.0 - self.covolume * REST_DENSITY) / (room * room)
        return (rise * (rho - REST_DENSITY) / room, slope)

    def grueneisen(self, rho):
        """Grueneisen coefficient and its slope with density; NaN where there is no room, so that no such state passes
        for valid."""
        root = sqrt(1.0 - self.covolume * rho)
        room = root * root
        omega = (self.gamma - 1.0) / room
        return (omega, omega * self.covolume / room)

    def cold_curve(self, rho):
        """Pressure [Pa] and energy [J/kg] of the coldest state."""
        return (-self.p_inf, self.q + self.p_inf * (1.0 / rho - self.covolume))

    @property
    def maximum_density(self) -> float:
        """No state of the liquid is as dense [kg/m3]."""
        return 1.0 / self.covolume
