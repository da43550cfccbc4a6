"""How stiff a phase with p = reference(rho) + omega(rho) rho e is.

Along its isentropes, with G for the reference pressure and g = d ln(rho omega)/d ln rho, 1 where omega is constant,

    rho c^2 = rho dG/d rho + g (p - G) + omega p = (g + omega)(p + P),    P = (rho dG/d rho - g G)/(g + omega):

at its density the phase is as stiff as a stiffened gas with the exponent g + omega and the pressure P, at any pressure.
Of ideal, stiffened, Noble-Abel and Noble-Abel stiffened gas P is a constant.
"""

from distfsi.formulas.symbols import grueneisen_1, grueneisen_2, grueneisen_3, grueneisen_4, grueneisen_5

ROOM = 0.95  # of the compression at which a gas has no room: where it is held


def weight_1(rho):
    """g of phase 1."""
    omega, slope = grueneisen_1(rho)
    return 1.0 + rho * slope / omega


def weight_2(rho):
    """g of phase 2."""
    omega, slope = grueneisen_2(rho)
    return 1.0 + rho * slope / omega


def weight_3(rho):
    """g of phase 3."""
    omega, slope = grueneisen_3(rho)
    return 1.0 + rho * slope / omega


def weight_4(rho):
    """g of phase 4."""
    omega, slope = grueneisen_4(rho)
    return 1.0 + rho * slope / omega


def weight_5(rho):
    """g of phase 5."""
    omega, slope = grueneisen_5(rho)
    return 1.0 + rho * slope / omega


def exponent_1(rho):
    """g + omega of phase 1."""
    omega, slope = grueneisen_1(rho)
    return weight_1(rho) + omega


def exponent_2(rho):
    """g + omega of phase 2."""
    omega, slope = grueneisen_2(rho)
    return weight_2(rho) + omega


def held_compression_1(chi, rho):
    """A compression chi of phase 1, held where a Noble-Abel gas with its g would soon have no room."""
    omega, slope = grueneisen_1(rho)
    return chi if slope == 0.0 else min(chi, 1.0 + ROOM / max(weight_1(rho) - 1.0, 1e-30))


def held_compression_2(chi, rho):
    """The same of phase 2."""
    omega, slope = grueneisen_2(rho)
    return chi if slope == 0.0 else min(chi, 1.0 + ROOM / max(weight_2(rho) - 1.0, 1e-30))
