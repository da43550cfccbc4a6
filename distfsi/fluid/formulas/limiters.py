"""Slope limiters for MUSCL reconstruction (paper, Sec. 2.2.1)."""


def first_order(backward, forward):
    """No slope."""
    return 0.0


def minmod(backward, forward):
    """The smaller of the two differences, zero at extrema."""
    smaller = min(abs(backward), abs(forward))
    slope = smaller if backward > 0.0 else -smaller
    return slope if backward * forward > 0.0 else 0.0


def van_leer(backward, forward):
    """Harmonic mean of the two differences, zero at extrema."""
    product = backward * forward
    total = backward + forward
    return 2.0 * product / total if product > 0.0 else 0.0
