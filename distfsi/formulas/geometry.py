"""Lengths from volumes."""

from math import pow, sqrt

from distfsi.formulas.symbols import DIMENSIONS


def side_of_cube(volume):
    """Side [m] of a cube (square, segment) of a volume [m^D].

    What compilers make of a power of 1/2 is not the same on all devices, a root is.
    """
    if DIMENSIONS == 1:
        return volume
    if DIMENSIONS == 2:
        return sqrt(volume)
    return pow(volume, 1.0 / 3.0)
