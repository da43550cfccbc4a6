"""Any overpressure, by a table."""

from dataclasses import dataclass

from distfsi.laws.law import PressureHistory, series


@dataclass(frozen=True)
class TabledPressure(PressureHistory):
    """A table: straight lines between its values, the first one before and the last one after them."""

    times: tuple[float, ...] = series("s", "growing")
    overpressures: tuple[float, ...] = series("Pa", "one per time")

    def check(self) -> None:
        if len(self.times) != len(self.overpressures):
            raise ValueError(f"has {len(self.times)} times and {len(self.overpressures)} overpressures")
        if any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("times do not grow")

    def overpressure(self, time):
        """[Pa] at a time [s]."""
        n = sum(begin <= time for begin in self.times)
        if n == 0 or n == len(self.times):
            return self.overpressures[min(n, len(self.times) - 1)]
        (t0, t1), (p0, p1) = self.times[n - 1 : n + 1], self.overpressures[n - 1 : n + 1]
        return p0 + (p1 - p0) * (time - t0) / (t1 - t0)

    @property
    def lowest(self):
        return min(self.overpressures)
