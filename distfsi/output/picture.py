"""One picture that sums up a finished run, from its files alone.

Names that it knows. Cells: density, pressure, velocity, volume_fraction...; particles: velocity, plastic_strain, and
those of the cells. Columns of the history: "time [s]", "time step [s]", "... energy [J]" and "drift ...".
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from distfsi.output.frames import load_frames
from distfsi.output.history import read_history
from distfsi.output.maps import Sheet, draw_maps, summary_colors
from distfsi.output.panels import HISTORY_HEIGHT, WIDTH, draw_history, draw_profiles, profiles_height

TIMES, RESOLUTION = 4, 110  # dots per inch
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,
}


def draw_summary(directory: Path) -> Path:
    """Draw `summary.png` from the field files and `history.csv` of the run in `directory`; returns its path.

    One-dimensional runs: profiles at the first and the last time. Others: maps at up to four times, of the middle plane
    in three dimensions. Raises FileNotFoundError when a file is missing.
    """
    directory = Path(directory)
    frames = load_frames(directory, TIMES)
    history = read_history(directory / "history.csv")
    lines = frames[0].dimensions == 1
    if lines:
        frames = [frames[0], *frames[1:][-1:]]
    else:
        fields, particles = summary_colors(frames)
        sheet = Sheet(frames[0].aspect, len(fields), len(frames), particles is not None)
    with matplotlib.rc_context(STYLE):
        heights = [profiles_height(frames) if lines else sheet.height, HISTORY_HEIGHT]
        figure = Figure(figsize=(WIDTH, sum(heights)))
        upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=heights, hspace=0.0).ravel()
        if lines:
            draw_profiles(upper, frames)
        else:
            draw_maps(upper, sheet, frames, fields, particles)
        draw_history(lower, history)
        path = directory / "summary.png"
        figure.savefig(path, dpi=RESOLUTION)
    return path
