"""Where the bars of a body lie in a domain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distfsi.scene.bars import Bars
from distfsi.scene.description import Body, Domain
from distfsi.scene.shapes import bounding_box

ON_PLANE = 1e-6  # of the distance between nodes: so near to a symmetry plane a node is on it


@dataclass(frozen=True)
class Line:
    """A bar in the domain: nodes (n, D) [m] in a row, how much of its section is there, and along which axes each node
    lies on a symmetry plane (n, D)."""

    nodes: np.ndarray
    share: float
    held: np.ndarray


def lines_of(body: Body, bars: Bars, domain: Domain) -> list[Line]:
    """Where a body's bars are; ends of the domain cut them."""
    D, found = domain.dimensions, []
    low, high = (np.asarray(corner) for corner in bounding_box(body.shape))
    for axis in bars.directions:
        others = [a for a in range(D) if a != axis]
        depth = next((a for a in reversed(others) if a not in bars.directions), others[-1])
        across = [a for a in others if a != depth]
        start, end = low + bars.cover, high - bars.cover
        start[depth] = end[depth] = (low + bars.cover if bars.side == "low" else high - bars.cover)[depth]
        for shifts in _shifts(start, end, across, bars.spacing):
            first, last = start.copy(), end.copy()
            for a, x in shifts.items():
                first[a] = last[a] = x
            line = _cut(first, last, axis, bars, domain)
            if line is not None:
                found.append(line)
    return found


def _shifts(start: np.ndarray, end: np.ndarray, across: list[int], spacing: float) -> list[dict[int, float]]:
    """Where bars lie along the one axis across them, if there is one: in the middle of what they fill."""
    if not across:
        return [{}]
    (a,) = across
    count = max(int((end[a] - start[a]) / spacing * (1.0 + 1e-12)) + 1, 0)
    first = 0.5 * (start[a] + end[a] - (count - 1) * spacing)
    return [{a: float(first + k * spacing)} for k in range(count)]


def _cut(first: np.ndarray, last: np.ndarray, axis: int, bars: Bars, domain: Domain) -> Line | None:
    """A bar from `first` to `last` along an axis as far as it is in the domain."""
    low, high = np.asarray(domain.lower), np.asarray(domain.upper)
    slack, share = ON_PLANE * bars.length, 1.0
    if np.any(last < low - slack) or np.any(first > high + slack) or first[axis] >= last[axis]:
        return None
    first, last = np.maximum(first, low), np.minimum(last, high)
    count = max(1, round((last - first)[axis] / bars.length))
    nodes = first + (np.arange(count + 1) / count)[:, None] * (last - first)
    held = np.zeros(nodes.shape, dtype=bool)
    for a, ends in enumerate(domain.boundaries):
        for kind, plane in zip(ends, (low[a], high[a]), strict=True):
            if kind == "symmetry":
                held[:, a] |= np.abs(nodes[:, a] - plane) < slack
    if any(held[:, a].all() for a in range(len(low)) if a != axis):
        share = 0.5
    return Line(nodes, share, held)
