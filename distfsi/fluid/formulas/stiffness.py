"""How stiff a phase with p = reference(rho) + omega(rho) rho e is.

Along its isentropes, with G for the reference pressure and g = d ln(rho omega)/d ln rho, 1 where omega is constant,

    rho c^2 = rho dG/d rho + g (p - G) + omega p = (g + omega)(p + P),    P = (rho dG/d rho - g G)/(g + omega):

at its density the phase is as stiff as a stiffened gas with the exponent g + omega and the pressure P, at any pressure.
Of ideal, stiffened, Noble-Abel and Noble-Abel stiffened gas P is a constant.
"""

from distfsi.formulas.symbols import grueneisen_1, grueneisen_2


def weight_1(rho):
    """g of phase 1."""
    omega, slope = grueneisen_1(rho)
    return 1.0 + rho * slope / omega


def weight_2(rho):
    """g of phase 2."""
    omega, slope = grueneisen_2(rho)
    return 1.0 + rho * slope / omega


def exponent_1(rho):
    """g + omega of phase 1."""
    omega, slope = grueneisen_1(rho)
    return weight_1(rho) + omega


def exponent_2(rho):
    """g + omega of phase 2."""
    omega, slope = grueneisen_2(rho)
    return weight_2(rho) + omega
