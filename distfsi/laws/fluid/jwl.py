"""Jones-Wilkins-Lee products of detonation (paper, Eq. 13, with v = rho0/rho)."""

from math import exp

from distfsi.formulas.symbols import Symbol

RHO0 = Symbol("density of the undetonated explosive [kg/m3]")
A = Symbol("[Pa]")
B = Symbol("[Pa]")
R1 = Symbol("")
R2 = Symbol("")
OMEGA = Symbol("Grueneisen coefficient w")


def reference(rho):
    """Reference pressure [Pa] and its slope with density [m2/s2].

    With x = 1/v = rho/rho0: p = A (1 - w x/R1) exp(-R1/x) + B (1 - w x/R2) exp(-R2/x).
    """
    x = rho * (1.0 / RHO0)
    v = 1.0 / x
    a = A * exp(-R1 * v)
    b = B * exp(-R2 * v)
    pressure = a * (1.0 - OMEGA / R1 * x) + b * (1.0 - OMEGA / R2 * x)
    # d exp(-R v)/dx = R v^2 exp(-R v)
    slope_a = a * (R1 * v * v - OMEGA * v - OMEGA / R1)
    slope_b = b * (R2 * v * v - OMEGA * v - OMEGA / R2)
    return (pressure, (slope_a + slope_b) * (1.0 / RHO0))
