"""One picture that sums up a finished run, from its files alone.

Names that it knows. Cells: density, pressure, velocity, volume_fraction, volume_fraction_NAME. Particles: velocity,
plastic_strain, and those of the cells. Columns of the history: "time [s]", "time step [s]", and those with "energy" or
"mass" in their name.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure, FigureBase

from distfsi.output.frames import Frame, load_frames
from distfsi.output.history import read_history
from distfsi.output.panels import draw_history, draw_maps, draw_profiles, map_names, profile_names

TIMES = 4
UPRIGHT_ASPECT = 0.6  # height over width of a domain from which on its maps stand side by side
HISTORY_HEIGHT = 3.8  # inches
STYLE = {
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,
    "figure.constrained_layout.w_pad": 0.1,
    "figure.constrained_layout.h_pad": 0.08,
}


def draw_summary(directory: Path) -> Path:
    """Draw `summary.png` from the field files and `history.csv` of the run in `directory`; returns its path.

    One-dimensional runs: profiles at the first and the last time. Others: maps at up to four times, of the middle plane
    in three dimensions. Raises FileNotFoundError when there are no field files.
    """
    directory = Path(directory)
    draw, width, height = _fields(load_frames(directory, TIMES))
    history = directory / "history.csv"
    rows = [(draw, height)]
    if history.exists():
        columns = read_history(history)
        rows.append((lambda figure: draw_history(figure, columns), HISTORY_HEIGHT))
    with matplotlib.rc_context(STYLE):
        heights = [height for _, height in rows]
        figure = Figure(figsize=(width, sum(heights)), layout="compressed")
        parts = np.atleast_1d(figure.subfigures(len(rows), 1, height_ratios=heights))
        for (draw, _), part in zip(rows, parts, strict=True):
            draw(part)
        path = directory / "summary.png"
        figure.savefig(path, dpi=110)
    return path


def _fields(frames: list[Frame]) -> tuple[Callable[[FigureBase], None], float, float]:
    """How to draw the fields, and the width and height [inches] that it takes."""
    first, last = frames[0], frames[-1]
    if first.dimensions == 1:
        shown = [first, last] if last is not first else [first]
        return lambda figure: draw_profiles(figure, shown), 11.0, 2.0 * len(profile_names(first)) + 0.5
    left, right, bottom, top = first.extent
    aspect = (top - bottom) / (right - left)
    upright = aspect > UPRIGHT_ASPECT
    fields, times = len(map_names(first)), len(frames)
    rows, columns = (fields, times) if upright else (times, fields)
    panel = min(6.0, 12.0 / columns, 5.0 / aspect)
    width = max(10.0, columns * panel + 1.5)
    return lambda figure: draw_maps(figure, frames, upright), width, rows * (panel * aspect + 0.5) + 1.2
