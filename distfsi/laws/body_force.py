"""All sources of a scene as the one body force that kernels know: a number per axis, the mean over a step in time."""

from collections.abc import Iterable

from distfsi.formulas.subset import Varying
from distfsi.laws.law import Source


class BodyForce:
    """Force per mass [m/s2], the sum of what the sources make of it.

    acceleration  one entry per axis: a number, 0.0 where no source acts, or a Varying one where a source is not steady;
                  kernels are specialised with it as BODY_FORCE
    """

    def __init__(self, sources: Iterable[Source], dimensions: int):
        along = [[source for source in sources if source.acceleration[d] != 0.0] for d in range(dimensions)]
        self._varying = {d: found for d, found in enumerate(along) if not all(source.steady for source in found)}
        self.acceleration = tuple(
            Varying() if d in self._varying else _mean(found, d, 0.0, 0.0) for d, found in enumerate(along)
        )

    def average_over(self, start: float, dt: float) -> bool:
        """From now on kernels get the mean over `dt` [s] from `start` [s] on. Whether that is another than before."""
        changed = False
        for d, sources in self._varying.items():
            number, mean = self.acceleration[d], _mean(sources, d, start, start + dt)
            changed |= number.value != mean
            number.value = mean
        return changed

    @property
    def now(self) -> tuple[float, ...]:
        """The numbers [m/s2] that kernels get."""
        return tuple(g.value if isinstance(g, Varying) else g for g in self.acceleration)


def _mean(sources: Iterable[Source], axis: int, start: float, end: float) -> float:
    """Acceleration [m/s2] of all sources along an axis, the mean over a time [s]."""
    return float(sum(source.acceleration[axis] * source.share(start, end) for source in sources))
