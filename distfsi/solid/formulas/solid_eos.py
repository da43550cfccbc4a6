"""Pressure of a solid: Mie-Grueneisen (paper, A.1 corrected), of which the linear law is a case.

A solid's `eos` is the tuple (rho0, c0, s1, s2, s3, gamma0, a, b1, b2): the reference Hugoniot is
K mu (1 + b1 mu + b2 mu^2) / D(mu)^2, with K = rho0 c0^2, mu = rho/rho0 - 1 and b1 = 1 - gamma0/2, b2 = -a/2.
The linear law p = K mu is s1 = 1, all others 0.
"""

from math import log, sqrt


def solid_pressure(density, energy, eos):
    """Pressure [Pa] at `density` [kg/m3] and specific internal `energy` [J/kg]; linear in expansion (mu <= 0)."""
    rho0, c0, s1, s2, s3, gamma0, a, b1, b2 = eos
    mu = density / rho0 - 1.0
    x = mu / (mu + 1.0)
    divisor = 1.0 - (s1 - 1.0) * mu - s2 * mu * x - s3 * mu * x * x
    shock = (1.0 + b1 * mu + b2 * mu * mu) / (divisor * divisor)
    return rho0 * c0 * c0 * mu * (shock if mu > 0.0 else 1.0) + (gamma0 + a * mu) * rho0 * energy


def bulk_modulus(density, energy, pressure, eos):
    """Isentropic bulk modulus rho dp/drho [Pa] of `solid_pressure`."""
    rho0, c0, s1, s2, s3, gamma0, a, b1, b2 = eos
    mu = density / rho0 - 1.0
    x = mu / (mu + 1.0)
    dx = 1.0 / ((mu + 1.0) * (mu + 1.0))
    divisor = 1.0 - (s1 - 1.0) * mu - s2 * mu * x - s3 * mu * x * x
    ddivisor = 1.0 - s1 - s2 * (x + mu * dx) - s3 * (x * x + 2.0 * mu * x * dx)
    series = 1.0 + b1 * mu + b2 * mu * mu
    dseries = 1.0 + 2.0 * b1 * mu + 3.0 * b2 * mu * mu
    dshock = (dseries - 2.0 * mu * series * ddivisor / divisor) / (divisor * divisor)
    cold = rho0 * c0 * c0 * (dshock if mu > 0.0 else 1.0) + a * rho0 * energy
    return (mu + 1.0) * cold + (gamma0 + a * mu) * pressure / (mu + 1.0)


def solid_sound_speed(density, bulk, shear_modulus, eos):
    """Longitudinal sound speed [m/s]; expanded hot material keeps a tenth of the reference bulk modulus."""
    floor = 0.1 * eos[0] * eos[1] * eos[1]
    return sqrt((max(bulk, floor) + 4.0 / 3.0 * shear_modulus) / density)


def free_swelling(energy, eos):
    """Logarithm of the volume over the reference one at which material of that specific `energy` [J/kg] has no
    pressure; 0 where it would have to be compressed. Gas of the solid's own is not known: no more than tenfold."""
    rho0, c0, s1, s2, s3, gamma0, a, b1, b2 = eos
    hot = max(energy, 0.0)
    return -log(max(1.0 - gamma0 * hot / (c0 * c0 + a * hot), 0.1))
