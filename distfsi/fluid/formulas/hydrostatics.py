"""Fluid at rest under a body force: what the pressure of cells owes to the weight of the fluid between them.

In a row of cells at rest the pressure grows from cell to cell by the mean of their densities times g h. Only what it
differs from that is reconstructed, and half the weight of a cell is added at its faces: then both sides of a face have
one pressure, and the difference of a cell's two faces is its weight, for any equation of state (in the way of Kaeppeli
and Mishra, J. Comput. Phys. 259, 2014, with weights in the place of an isentrope).
"""

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import BODY_FORCE, DIMENSIONS, GHOSTS


def falls(dt, x, y, z):
    """g h [m2/s2] along each axis, from a time step and that over the size of a cell along x, y, z [s/m]."""
    rates = (x, y, z)
    return tuple(BODY_FORCE[d] * (dt / rates[d]) for d in static_range(DIMENSIONS))


def beyond_rest(pressures, densities, fall):
    """Pressures of cells in a row [Pa] as they would be without the weight between them and the middle one, which keeps
    its own; `fall`: g h along the row."""
    half = 0.5 * fall
    p, rho = pressures, densities
    below = p[GHOSTS - 2] + half * (rho[GHOSTS - 2] + rho[GHOSTS - 1])
    above = p[GHOSTS] - half * (rho[GHOSTS - 1] + rho[GHOSTS])
    if GHOSTS == 2:
        return (below, p[1], above)
    else:
        first = p[0] + half * (rho[0] + 2.0 * rho[1] + rho[2])
        last = p[4] - half * (rho[2] + 2.0 * rho[3] + rho[4])
        return (first, below, p[2], above, last)
