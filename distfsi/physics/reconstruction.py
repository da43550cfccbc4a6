"""How a primitive varies inside a cell: from the means of cells in a row, its own in their middle, to its two faces.

Each formula returns (rise from the low face to the mean, rise from the mean to the high face). A volume fraction may be
reconstructed more sharply than the rest: phase densities, velocity and pressure are primitives beside it, so masses and
energies of the phases follow it, and where velocity and pressure are uniform they stay so.
"""

from distfsi.physics.symbols import GHOSTS, limited_slope


def differences(cells):
    """To the cell before, and to the one behind."""
    return (cells[GHOSTS - 1] - cells[GHOSTS - 2], cells[GHOSTS] - cells[GHOSTS - 1])


def muscl(cells):
    """A straight line with a limited slope."""
    backward, forward = differences(cells)
    rise = 0.5 * limited_slope(backward, forward)
    return (rise, rise)


def overbee(cells):
    """The steepest straight line within the range of the neighbours, flat at extrema (Chiapolino, Saurel, Nkonga, J.
    Comput. Phys. 340, 2017). A steeper profile, as THINC's can be, could empty a cell of a phase in one step."""
    backward, forward = differences(cells)
    smaller = min(abs(backward), abs(forward))
    rise = smaller if backward > 0.0 else -smaller
    kept = rise if backward * forward > 0.0 else 0.0
    return (kept, kept)
