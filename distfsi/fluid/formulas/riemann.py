"""The approximate Riemann problem of a face: bounding waves, contact, and what is smeared at the contact.

All solvers are HLLC (paper, Eqs. 17-21) with more or less smeared contacts. HLL has the same two outer waves but only
one state between them, the mean of HLLC's two; so its flux is HLLC's less `contact_diffusion` times the jump across the
contact, for everything that is transported.
"""

from math import sqrt

FULL_STRENGTH = 0.2  # jump of the pressure, in rho c^2, between two cells of a shock that counts as strong


def einfeldt_speeds(rho_l, u_l, c_l, rho_r, u_r, c_r):
    """Slowest and fastest wave (Einfeldt, SIAM J. Numer. Anal. 25, 1988): bound strong shocks too, unlike Eq. 20."""
    root_l = sqrt(rho_l)
    root_r = sqrt(rho_r)
    share_l = root_l / (root_l + root_r)
    share_r = 1.0 - share_l
    jump = u_r - u_l
    u = share_l * u_l + share_r * u_r
    c = sqrt(share_l * (c_l * c_l) + share_r * (c_r * c_r) + 0.5 * (share_l * share_r) * (jump * jump))
    return (min(u_l - c_l, u - c), max(u_r + c_r, u + c))


def rusanov_speeds(rho_l, u_l, c_l, rho_r, u_r, c_r):
    """The fastest signal of both sides, both ways (Rusanov, 1961): HLL between them is Rusanov's flux."""
    s = max(abs(u_l) + c_l, abs(u_r) + c_r)
    return (-s, s)


def contact_speed(rho_l, u_l, p_l, s_l, rho_r, u_r, p_r, s_r):
    """Speed of the contact wave (paper, Eq. 21)."""
    m_l = rho_l * (s_l - u_l)
    m_r = rho_r * (s_r - u_r)
    return (p_r - p_l + m_l * u_l - m_r * u_r) / (m_l - m_r)


def sharp(s, s_there, s_star):
    """HLLC: nothing crosses a contact."""
    return 0.0


def contact_diffusion(s, s_there, s_star):
    """HLL (Harten, Lax, van Leer, SIAM Rev. 25, 1983): flux per jump of a density at the contact [m/s].

    s: the wave between the upwind state and the contact, 0 when it does not reach the face; s_there: the wave on the
    other side. The result's sign is that of s_star, as the jump's is.
    """
    return -s * (s_there - s_star) / (s_there - s)


def inviscid(m_l, m_r, jump, bulk):
    """HLLC: slip along a contact is free."""
    return 0.0


def shear_along_shocks(m_l, m_r, jump, bulk):
    """Momentum flux per slip [kg/(m2 s)] where the face cuts a strong shock, 0 elsewhere.

    It is the slip between the columns of cells through which a shock runs that lets it break up (carbuncle); a shear
    viscosity cures it and leaves contacts sharp (Shen, Yan, Yuan, J. Comput. Phys. 309, 2016). Here slip is passed on
    like a wave in media of the impedances m = rho (s - u). `jump` [Pa]: the largest pressure difference along the face
    (where to look: Quirk, Int. J. Numer. Methods Fluids 18, 1994); bulk: rho c^2.
    """
    strong = FULL_STRENGTH * bulk
    return min(jump, strong) * (m_l * m_r) / (strong * (m_l - m_r))
