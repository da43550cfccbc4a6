"""How a primitive varies inside a cell: from the means of cells in a row, its own in their middle, to its two faces.

Each formula returns the face increments: from the low face to the mean, and from the mean to the high face. A volume
fraction may be reconstructed more sharply than the rest: phase densities, velocity and pressure are primitives beside
it, so masses and energies of the phases follow it, and where velocity and pressure are uniform they stay so.
"""

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import GHOSTS, limited_slope

UNEVEN = 1e-6  # of all three roughnesses: what weighs as none; so that no unit matters
SMALLEST_PART = 0.1  # of a cell's mean that a face keeps where the cells around have one sign


def differences(cells):
    """To the cell before, and to the one behind."""
    return (cells[GHOSTS - 1] - cells[GHOSTS - 2], cells[GHOSTS] - cells[GHOSTS - 1])


def muscl(cells):
    """A straight line with a limited slope."""
    backward, forward = differences(cells)
    increment = 0.5 * limited_slope(backward, forward)
    return (increment, increment)


def muscl_in_r(cells, nearness_backward, nearness_forward, to_low):
    """A straight line with a limited slope through means that stand for the centroids of cells (Mignone, J. Comput.
    Phys. 270, 2014), within the range of the neighbours.

    nearness: width of the cell over the distance of the centroids; to_low: widths from the low face to the centroid.
    """
    backward, forward = differences(cells)
    slope = limited_slope(backward * nearness_backward, forward * nearness_forward)
    return (bounded(to_low * slope, backward), bounded((1.0 - to_low) * slope, forward))


def bounded(increment, difference):
    """An increment that goes no farther than a difference of the same sign."""
    return increment if abs(increment) <= abs(difference) else difference


def overbee(cells):
    """The steepest straight line within the range of the neighbours, flat at extrema (Chiapolino, Saurel, Nkonga, J.
    Comput. Phys. 340, 2017). A steeper profile, as THINC's can be, could empty a cell of a phase in one step."""
    backward, forward = differences(cells)
    smaller = min(abs(backward), abs(forward))
    increment = smaller if backward > 0.0 else -smaller
    kept = increment if backward * forward > 0.0 else 0.0
    return (kept, kept)


def weno_increment(d1, d2, d3, d4):
    """From a cell's mean to its face, between the cells whose difference is d3; d1 … d4: between five cells in a row.

    Of fifth order where the primitive is smooth (WENO-Z: Borges, Carmona, Costa, Don, J. Comput. Phys. 227, 2008).
    """
    rough1 = 13.0 / 12.0 * ((d2 - d1) * (d2 - d1)) + 0.25 * ((3.0 * d2 - d1) * (3.0 * d2 - d1))
    rough2 = 13.0 / 12.0 * ((d3 - d2) * (d3 - d2)) + 0.25 * ((d2 + d3) * (d2 + d3))
    rough3 = 13.0 / 12.0 * ((d4 - d3) * (d4 - d3)) + 0.25 * ((3.0 * d3 - d4) * (3.0 * d3 - d4))
    even = UNEVEN * (rough1 + rough2 + rough3) + 1e-30
    uneven = abs(rough1 - rough3)
    ratio1, ratio2, ratio3 = uneven / (rough1 + even), uneven / (rough2 + even), uneven / (rough3 + even)
    weight1, weight2 = 0.1 * (1.0 + ratio1 * ratio1), 0.6 * (1.0 + ratio2 * ratio2)
    weight3 = 0.3 * (1.0 + ratio3 * ratio3)
    total = weight1 * (5.0 * d2 - 2.0 * d1) + weight2 * (d2 + 2.0 * d3) + weight3 * (4.0 * d3 - d4)
    return total / (6.0 * (weight1 + weight2 + weight3))


def weno5(cells):
    """Five cells; a straight line where a face would come near zero or beyond, and the cells do not."""
    d1, d2, d3, d4 = tuple(cells[k + 1] - cells[k] for k in static_range(4))
    mean = cells[2]
    low, high = weno_increment(d4, d3, d2, d1), weno_increment(d1, d2, d3, d4)
    straight = 0.5 * limited_slope(d2, d3)
    one_sign = min(cells[1] * mean, mean * cells[3]) > 0.0
    smallest = SMALLEST_PART * (mean * mean)
    crosses_low, crosses_high = (mean - low) * mean < smallest, (mean + high) * mean < smallest
    return (straight if one_sign and crosses_low else low, straight if one_sign and crosses_high else high)
