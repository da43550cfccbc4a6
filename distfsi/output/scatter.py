"""Charts of many points in a plane with logarithmic axes, each told apart by a number, with the best of them joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from string import ascii_lowercase

import matplotlib
from matplotlib.figure import Figure

from distfsi.output.charts import RESOLUTION, STYLE

SIZE = (11.0, 6.2)  # of the sheet [inches]
OTHERS = "0.35"  # color of what is not ours


@dataclass(frozen=True)
class Point:
    """A point, its name in the legend, the group that gives it its color, and whether it is one of the best."""

    x: float
    y: float
    name: str
    group: str
    best: bool = False


def draw_scatter(
    path: Path,
    title: str,
    x_label: str,
    y_label: str,
    points: Sequence[Point],
    others: Sequence[Point] = (),
    lines: Sequence[tuple[float, str]] = (),
) -> Path:
    """Draw the points; `others` as crosses with letters, `lines` as named values of x; returns `path`."""
    groups = list(dict.fromkeys(point.group for point in points))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout="constrained")
        axes = figure.subplots()
        best = sorted((p for p in points if p.best), key=lambda p: p.x)
        axes.plot([p.x for p in best], [p.y for p in best], "-", color="tab:red", linewidth=1.0, label="Pareto front")
        for number, p in enumerate(points, 1):
            color = f"C{groups.index(p.group) % 10}"
            label = f"{number} {p.name}{' *' if p.best else ''}"
            axes.plot(p.x, p.y, "o", color=color, markersize=6, label=label, alpha=0.8)
            axes.annotate(str(number), (p.x, p.y), xytext=(4, 4), textcoords="offset points", fontsize=8)
        for letter, p in zip(ascii_lowercase, others, strict=False):
            axes.plot(p.x, p.y, "x", color=OTHERS, label=f"{letter} {p.name}")
            axes.annotate(letter, (p.x, p.y), xytext=(4, 4), textcoords="offset points", fontsize=8, color=OTHERS)
        for x, name in lines:
            axes.axvline(x, color=OTHERS, linestyle=":", linewidth=0.8)
            axes.annotate(
                name, (x, 0.01), xycoords=("data", "axes fraction"), rotation=90, fontsize=7, color=OTHERS, ha="right"
            )
        axes.set(title=title, xlabel=x_label, ylabel=y_label, xscale="log", yscale="log")
        axes.grid(alpha=0.3, which="both")
        figure.legend(loc="outside right upper", fontsize=7.5, frameon=False)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=RESOLUTION)
    return path
