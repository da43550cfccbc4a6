"""Gravity."""

from dataclasses import dataclass

from distfsi.laws.law import Source, vector


@dataclass(frozen=True)
class Gravity(Source):
    """The same acceleration at all times, as `gravity` of the domain."""

    acceleration: tuple[float, ...] = vector("m/s2", "of everything")

    steady = True

    def share(self, start, end):
        """All of it."""
        return 1.0
