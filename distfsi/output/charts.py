"""Charts of a study: curves side by side, and pictures of fields, as PNG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

WIDTH, RESOLUTION = 11.0, 90  # of a sheet in inches, and in dots per inch
CHART_HEIGHT, TITLE = 3.6, 0.6  # of a row of charts; what a picture needs for its title and axis [inches]
STYLE: dict[Any, Any] = {"font.size": 9, "axes.titlesize": 9, "axes.formatter.useoffset": False}


@dataclass(frozen=True)
class Curve:
    """Points (x, y), drawn in a matplotlib `style` such as "-" or "o"; without `label` it is not in the legend."""

    x: np.ndarray
    y: np.ndarray
    label: str | None = None
    style: str = "-"


@dataclass(frozen=True)
class Chart:
    """Curves over common axes."""

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]


@dataclass(frozen=True)
class Picture:
    """A field `values` (ny, nx) over `extent` (left, right, bottom, top) in matplotlib `colors`.

    limits: what the ends of the colors stand for, by default the extremes; label: that of a color bar (None: no bar).
    """

    title: str
    values: np.ndarray
    extent: tuple[float, float, float, float]
    colors: str = "viridis"
    limits: tuple[float | None, float | None] = (None, None)
    label: str | None = None


def draw_charts(path: Path, charts: Sequence[Chart], columns: int) -> Path:
    """Draw the charts, all with the labels of the first, row by row; returns `path`."""
    rows = -(-len(charts) // columns)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, rows * CHART_HEIGHT), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes, chart in zip(grid.flat, charts, strict=False):
            _draw_chart(axes, chart)
        for axes in grid.flat[len(charts) :]:
            axes.remove()
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
        return _save(figure, path)


def draw_pictures(path: Path, pictures: Sequence[Picture], columns: int, unit: str, axes_names: str = "xy") -> Path:
    """Draw the pictures, whose extents are in `unit`, row by row; `axes_names`: to the right and up. Returns `path`."""
    rows = -(-len(pictures) // columns)
    left, right, bottom, top = pictures[0].extent
    height = WIDTH / columns * (top - bottom) / (right - left) + TITLE
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, rows * height), layout="compressed")
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for axes, picture in zip(grid.flat, pictures, strict=False):
            _draw_picture(axes, picture)
        for axes in grid[-1]:
            axes.set_xlabel(f"{axes_names[0]} [{unit}]")
        for axes in grid[:, 0]:
            axes.set_ylabel(f"{axes_names[1]} [{unit}]")
        return _save(figure, path)


def _draw_picture(axes: Axes, picture: Picture) -> None:
    low, high = picture.limits
    image = axes.imshow(picture.values, cmap=picture.colors, vmin=low, vmax=high, origin="lower", extent=picture.extent)
    axes.set_title(picture.title)
    if picture.label is not None:
        axes.figure.colorbar(image, ax=axes, label=picture.label, pad=0.02)


def _draw_chart(axes: Axes, chart: Chart) -> None:
    for curve in chart.curves:
        axes.plot(curve.x, curve.y, curve.style, label=curve.label, markersize=4, linewidth=1.2)
    axes.set(title=chart.title, xlabel=chart.x_label, ylabel=chart.y_label)
    axes.grid(alpha=0.3)


def _save(figure: Figure, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=RESOLUTION, bbox_inches="tight")
    return path
