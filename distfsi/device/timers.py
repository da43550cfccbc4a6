"""Where the time of a step goes: seconds that named parts of the work took on this rank."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from distfsi.device.interface import Device

UNREAD = 4096  # moments that are noted before their differences are taken


class Part:
    """`with` it, time is the part's, but for what an inner part takes."""

    __slots__ = ("_name", "_timers")

    def __init__(self, timers: Timers, name: str):
        self._timers, self._name = timers, name

    def __enter__(self) -> None:
        self._timers.begin(self._name)

    def __exit__(self, *_: object) -> None:
        self._timers.end()


class Timers:
    """`with timers("flux"): …` counts what happens inside as the part "flux", its kernels included.

    Parts nest, and what an inner part takes is not the outer one's, so that all parts together are the time spent in
    any of them. Moments are only noted (`Device.mark`); seconds follow when `lap` is called, or there are many.
    """

    def __init__(self, device: Device):
        self._device = device
        self._parts: dict[str, Part] = {}
        self._open: list[str] = []
        self._moments: list[tuple[Any, str]] = []  # and the part that has begun then, "" for none
        self._seconds: defaultdict[str, float] = defaultdict(float)

    def __call__(self, name: str) -> Part:
        """The part of this name, to be entered."""
        part = self._parts.get(name)
        if part is None:
            part = self._parts[name] = Part(self, name)
        return part

    def begin(self, name: str) -> None:
        """From now on time is that of the part."""
        self._open.append(name)
        self._moments.append((self._device.mark(), name))

    def end(self) -> None:
        """From now on time is that of the part around the one begun last, if there is one."""
        self._open.pop()
        outer = self._open[-1] if self._open else ""
        self._moments.append((self._device.mark(), outer))
        if len(self._moments) > UNREAD:
            self._read()

    def lap(self) -> dict[str, float]:
        """Seconds of each part since the last call. A part that goes on is counted up to now."""
        self._moments.append((self._device.mark(), self._open[-1] if self._open else ""))
        self._read()
        seconds, self._seconds = self._seconds, defaultdict(float)
        return dict(seconds)

    def _read(self) -> None:
        """Take the differences of the moments noted; the last one stays, for what begins with it."""
        first, name = self._moments[0]
        for then, following in self._moments[1:]:
            if name:
                self._seconds[name] += self._device.seconds_between(first, then)
            first, name = then, following
        self._moments = [(first, name)]
