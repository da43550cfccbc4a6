"""When output is due."""

from __future__ import annotations

import math

ROUNDING = 1e-12  # relative: a time that is a multiple but for its last digits counts as one


class Every:
    """Due at the first step at or after each multiple of `interval` [s]; 0: at the first step only.

    It never asks the run to hit a multiple. Multiples that one step jumps over are due once.
    """

    def __init__(self, interval: float):
        self._interval = interval
        self.next = 0.0  # as a multiple of the interval

    def due(self, time: float) -> bool:
        """Whether output is due at `time` [s]; if so, the next one is due an interval later."""
        multiple = time / self._interval * (1.0 + ROUNDING) if self._interval > 0.0 else 0.0
        if math.isfinite(multiple):  # of an interval that is almost nothing it is not
            multiple = math.floor(multiple)
        if multiple < self.next:
            return False
        self.next = multiple + 1.0
        return True
