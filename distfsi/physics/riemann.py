"""Wave speeds of the approximate Riemann problem."""

from math import sqrt


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


def contact_speed(rho_l, u_l, p_l, s_l, rho_r, u_r, p_r, s_r):
    """Speed of the contact wave (paper, Eq. 21)."""
    m_l = rho_l * (s_l - u_l)
    m_r = rho_r * (s_r - u_r)
    return (p_r - p_l + m_l * u_l - m_r * u_r) / (m_l - m_r)
