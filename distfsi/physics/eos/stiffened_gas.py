"""Stiffened gas p = (gamma - 1) rho e - gamma p_inf (paper, Eq. 14 corrected); p_inf = 0 is the ideal gas (Eq. 12)."""

from distfsi.physics.symbols import Symbol

GAMMA = Symbol("ratio of specific heats")
P_INF = Symbol("stiffness pressure [Pa]")


def reference(rho):
    """Reference pressure [Pa] and its slope with density."""
    return (-GAMMA * P_INF, 0.0)
