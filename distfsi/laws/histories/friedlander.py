"""The blast wave of Friedlander."""

from dataclasses import dataclass
from math import exp

from distfsi.laws.law import PressureHistory, number, quantity


@dataclass(frozen=True)
class Friedlander(PressureHistory):
    """A blast: peak (1 - x) exp(-decay x) with x = (t - start)/duration."""

    peak: float = quantity("Pa", "overpressure when it arrives", above=0.0)
    duration: float = quantity("s", "of the positive phase", above=0.0)
    decay: float = number("how fast it falls", default=1.0, at_least=0.0)
    start: float = quantity("s", "when it arrives", default=0.0)

    def overpressure(self, time):
        """[Pa] at a time [s]."""
        x = (time - self.start) / self.duration
        return self.peak * (1.0 - x) * exp(-self.decay * x) if x >= 0.0 else 0.0

    @property
    def lowest(self):
        """Where its slope vanishes; without decay it falls without end."""
        if self.decay == 0.0:
            return -float("inf")
        return -self.peak / self.decay * exp(-self.decay - 1.0)
