"""The shock wave of an explosion under water."""

from dataclasses import dataclass
from math import exp

from distfsi.laws.law import PressureHistory, quantity


@dataclass(frozen=True)
class ExponentialShock(PressureHistory):
    """An underwater shock: peak exp(-(t - start)/decay_time)."""

    peak: float = quantity("Pa", "overpressure when it arrives", above=0.0)
    decay_time: float = quantity("s", "in which it falls to 1/e", above=0.0)
    start: float = quantity("s", "when it arrives", default=0.0)

    def overpressure(self, time):
        """[Pa] at a time [s]."""
        return self.peak * exp((self.start - time) / self.decay_time) if time >= self.start else 0.0
