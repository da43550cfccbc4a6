"""The numbers of our own exponential: exp(x) = 2^n times a polynomial in r, with x = n ln 2 + r.

libm's exponential is scalar and differs from device to device; this one vectorises and has the same bits everywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

LN_2 = "0.693147180559945309417232121458176568075500134360255"


@dataclass(frozen=True)
class Exponential:
    """For one real type, of so many bits in its mantissa: below `lowest` and above `highest` the value stays.

    shift: what makes the nearest integer stand in the lowest bits; high, low: the two parts of ln 2; coefficients: of
    the polynomial, highest power first.
    """

    mantissa: int
    lowest: float
    highest: float
    per_two: float
    shift: float
    high: float
    low: float
    coefficients: tuple[float, ...]


def _numbers(real: type, mantissa: int, degree: int, lowest: float, highest: float, split: int) -> Exponential:
    """`split`: bits of ln 2 in its first part."""
    high = real(math.floor(math.log(2.0) * 2.0**split) / 2.0**split)
    return Exponential(
        mantissa,
        real(lowest),
        real(highest),
        real(1.0 / math.log(2.0)),
        real(1.5 * 2.0**mantissa),
        high,
        real(Fraction(LN_2) - Fraction(float(high))),
        tuple(real(1.0 / math.factorial(k)) for k in range(degree, -1, -1)),
    )


EXPONENTIALS = {
    "float64": _numbers(np.float64, 52, 13, -708.0, 709.0, 32),
    "float32": _numbers(np.float32, 23, 7, -87.0, 88.0, 12),
}
