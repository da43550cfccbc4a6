"""The Noble-Abel gas, whose molecules take room: propellants and other dense gases (Johnston, ARL-TR-3630, 2005)."""

from dataclasses import dataclass
from math import sqrt

from distfsi.laws.law import FluidEos, number, quantity


@dataclass(frozen=True)
class NobleAbel(FluidEos):
    """p = (gamma - 1) rho e/(1 - b rho)."""

    closed_form = True

    gamma: float = number("ratio of specific heats", above=1.0)
    covolume: float = quantity("m3/kg", "room b that the molecules take; no state is as dense as 1/b", above=0.0)

    def reference(self, rho):
        """Reference pressure [Pa] and its slope with density [m2/s2]."""
        return (0.0, 0.0)

    def grueneisen(self, rho):
        """Grueneisen coefficient and its slope with density; NaN where there is no room, so that no such state passes
        for valid."""
        root = sqrt(1.0 - self.covolume * rho)
        room = root * root
        omega = (self.gamma - 1.0) / room
        return (omega, omega * self.covolume / room)

    def cold_curve(self, rho):
        """Pressure [Pa] and energy [J/kg] of the coldest state."""
        return (0.0, 0.0)

    @property
    def maximum_density(self) -> float:
        """No state of the gas is as dense [kg/m3]."""
        return 1.0 / self.covolume
