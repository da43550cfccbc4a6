"""Stiffened gas p = (gamma - 1) rho e - gamma p_inf (paper, Eq. 14 corrected); p_inf = 0 is the ideal gas (Eq. 12)."""

from distfsi.formulas.symbols import Symbol

GAMMA = Symbol("ratio of specific heats")
P_INF = Symbol("stiffness pressure [Pa]")
REST_DENSITY = Symbol("density at which the shifted energy vanishes with the pressure [kg/m3]")


def reference(rho):
    """Reference pressure [Pa] and its slope with density."""
    return (-GAMMA * P_INF, 0.0)


def shifted_reference(rho):
    """The reference to energies counted from that at REST_DENSITY without pressure, a constant per mass.

    For water at 1 bar the energy itself is 7764 times the pressure over gamma - 1: too much for seven digits.
    """
    rise = GAMMA * P_INF / REST_DENSITY
    return (rise * (rho - REST_DENSITY), rise)
