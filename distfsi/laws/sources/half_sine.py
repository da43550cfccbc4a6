"""The shock pulse of a test table."""

from dataclasses import dataclass
from math import cos, pi

from distfsi.laws.law import Source, quantity, vector


@dataclass(frozen=True)
class HalfSine(Source):
    """A pulse a sin(pi (t - start)/duration), as seen by what stands on a table that is shaken."""

    acceleration: tuple[float, ...] = vector("m/s2", "at the top of the pulse; that of the table points the other way")
    duration: float = quantity("s", "of the pulse", above=0.0)
    start: float = quantity("s", "when it begins", default=0.0)

    def share(self, start, end):
        """The mean of the sine, 0 outside the pulse."""
        return (self._integral(end) - self._integral(start)) / (end - start) if end > start else 0.0

    def _integral(self, time):
        """Of the share from the beginning to `time` [s]: T/pi (1 - cos(pi t/T))."""
        passed = min(max((time - self.start) / self.duration, 0.0), 1.0)
        return self.duration / pi * (1.0 - cos(pi * passed))
