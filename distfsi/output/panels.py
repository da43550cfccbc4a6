"""Sheets with a head and panels, and profiles along a line in them. Lengths on paper are in inches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from textwrap import shorten
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure, SubFigure
from matplotlib.transforms import Bbox

from distfsi.narrowing import present
from distfsi.output.frames import Frame
from distfsi.output.progress import format_time
from distfsi.output.quantities import UNITS
from distfsi.output.scales import label_of, largest, norm_of, scaled

PROFILES = ("density", "pressure", "velocity", "volume_fraction", "plastic_strain")
LOGARITHMIC = ("density", "pressure")  # where they span decades
TIME_COLORS = ("0.55", "tab:blue", "tab:orange", "tab:green", "tab:red")

WIDTH = 12.0
LEFT = 0.9  # room for the labels of an axis
GAP, TITLE, XLABEL = 0.35, 0.4, 0.6  # between panels, above them, below the last of them
EXPONENT = 0.2  # above a panel, for the power of ten of its axis
PROFILE_HEIGHT = 1.6
HEAD, TITLE_SIZE = 0.4, 11  # room for the title of a sheet; its letters [points]
TITLE_LETTER, REMARK_LETTER = 0.095, 0.08  # width of a letter there


# ---- profiles: runs along x ------------------------------------------------------------------------------------------


def profiles_height(frames: Sequence[Frame], names: Sequence[str] = PROFILES) -> float:
    """Height that `draw_profiles` needs."""
    return len(_profile_names(frames, names)) * (PROFILE_HEIGHT + 0.5 * GAP) + XLABEL + TITLE


def draw_profiles(
    figure: Figure | SubFigure,
    frames: Sequence[Frame],
    fitted: Sequence[Frame] = (),
    names: Sequence[str] = PROFILES,
) -> None:
    """One row per field over x, one colour per time: cells as lines, particles as dots; axes fit the frames `fitted`,
    by default those drawn."""
    fitted = fitted or frames
    names = _profile_names(fitted, names)
    left, right, _, _ = frames[0].extent
    length, metres = scaled("m", right - left)
    margins, gaps = (LEFT, 0.3, XLABEL, TITLE), (0.0, 0.5 * GAP)
    rows = grid_of_panels(figure, len(names), 1, margins, gaps, sharex=True)[:, 0]
    for axes, name in zip(rows, names, strict=True):
        _draw_profile(axes, name, frames, fitted, length)
    times = [f"t = {format_time(frame.time)}" for frame in frames]
    handles = [axes.plot([], [], color=color)[0] for color, _ in zip(TIME_COLORS, frames, strict=False)]
    rows[0].legend(handles, times, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(frames), frameon=False)
    rows[-1].set(xlabel=f"{frames[0].names[0]} [{metres}]", xlim=(left / length, right / length))
    figure.align_ylabels(rows)


def _draw_profile(axes: Axes, name: str, frames: Sequence[Frame], fitted: Sequence[Frame], length: float) -> None:
    everything = [values for frame in fitted for _, values, _ in _curves(frame, name)]
    size, unit = scaled(UNITS.get(name, ""), largest(everything))
    for frame, color in zip(frames, TIME_COLORS, strict=False):
        for x, values, style in _curves(frame, name):
            axes.plot(x / length, values / size, style, color=color, markersize=3)
    norm = norm_of([values / size for values in everything])
    low, high = present(norm.vmin), present(norm.vmax)
    if name in LOGARITHMIC and isinstance(norm, LogNorm):
        axes.set(yscale="log", ylim=(low / 1.3, high * 1.3))
    else:
        room = 0.05 * ((high - low) or abs(high) or 1.0)
        axes.set_ylim(low - room, high + room)
    axes.set_ylabel(label_of(name, unit))
    axes.grid(alpha=0.3)


def _profile_names(frames: Sequence[Frame], names: Sequence[str]) -> list[str]:
    """Those of the fields that are worth a row: not zero everywhere at all times."""
    fractions = sorted({name for f in frames for name in f.cells if name.startswith("volume_fraction_")})
    names = [*names, *(fractions if "volume_fraction" in names else [])]
    return [name for name in names if largest(values for f in frames for _, values, _ in _curves(f, name)) > 0.0]


def _curves(frame: Frame, name: str) -> Iterator[tuple[np.ndarray, np.ndarray, str]]:
    """Positions, values and line style of a field; of a vector its component along x."""
    if name in frame.cells:
        yield frame.cell_centers, _along_x(frame.cells[name][0]), "-"
    if name in frame.particles:
        yield frame.particles["position"][:, 0], _along_x(frame.particles[name]), "o"


def _along_x(values: np.ndarray) -> np.ndarray:
    return values[:, 0] if values.ndim == 2 else values


# ---- what panels share -----------------------------------------------------------------------------------------------


def draw_legend(axes: Axes, columns: int = 2) -> None:
    """A small legend above a panel, clear of the exponent of its axis."""
    height = axes.get_window_extent().height / present(axes.get_figure(root=True)).dpi
    axes.legend(
        fontsize="x-small",
        loc="lower left",
        bbox_to_anchor=(-0.01, 1.0 + EXPONENT / height),
        ncols=columns,
        frameon=False,
        borderaxespad=0.0,
    )


def headed(width: float, heights: Sequence[float], left: str, right: str = "") -> tuple[Figure, list[SubFigure]]:
    """A sheet with a title on the left and a remark on the right above parts of these heights; it and the parts."""
    figure = Figure(figsize=(width, HEAD + sum(heights)))
    grid = figure.subfigures(1 + len(heights), 1, squeeze=False, height_ratios=[HEAD, *heights], hspace=0.0)
    head, *parts = grid.ravel()
    inset = 0.2 / width
    letters = int((width - 0.6 - REMARK_LETTER * len(right)) / TITLE_LETTER)
    title = shorten(left, max(letters, 20), placeholder=" ...")
    head.text(inset, 0.5, title, va="center", weight="bold", fontsize=TITLE_SIZE)
    head.text(1.0 - inset, 0.5, right, va="center", ha="right", color="0.35")
    return figure, parts


# ---- layout of the sheet ---------------------------------------------------------------------------------------------


def grid_of_panels(
    figure: Figure | SubFigure,
    rows: int,
    columns: int,
    margins: tuple[float, float, float, float],
    gaps: tuple[float, float],
    **shared: Any,
) -> np.ndarray:
    """Equal panels within the margins (left, right, below, above), `gaps` apart along x and y."""
    width, height = figure.bbox.width / figure.dpi, figure.bbox.height / figure.dpi
    left, right, below, above = margins
    panel_width = (width - left - right - (columns - 1) * gaps[0]) / columns
    panel_height = (height - below - above - (rows - 1) * gaps[1]) / rows
    layout = {
        "left": left / width,
        "right": 1.0 - right / width,
        "bottom": below / height,
        "top": 1.0 - above / height,
        "wspace": gaps[0] / panel_width,
        "hspace": gaps[1] / panel_height,
    }
    return figure.subplots(rows, columns, squeeze=False, gridspec_kw=layout, **shared)


def draw_bar(figure: Figure | SubFigure, axes: Iterable[Axes], colors: ScalarMappable, label: str, side: str) -> None:
    """A colour bar along the right or the lower edge of some panels."""
    width, height = figure.bbox.width / figure.dpi, figure.bbox.height / figure.dpi
    box = Bbox.union([panel.get_position() for panel in axes])
    if side == "right":
        edges = (box.x1 + 0.25 / width, box.y0, 0.15 / width, box.height)
        figure.colorbar(colors, cax=figure.add_axes(edges), label=label)
    else:
        edges = (box.x0, box.y0 - (XLABEL + 0.15) / height, box.width, 0.15 / height)
        figure.colorbar(colors, cax=figure.add_axes(edges), label=label, orientation="horizontal")
