"""One picture that sums up a finished run, from its files alone.

Names that it knows. Cells: density, pressure, velocity, volume_fraction...; particles: velocity, plastic_strain, and
those of the cells. Columns of the history: "time [s]", "time step [s]", "... energy [J]" and "drift ...".
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from distfsi.output.frames import load_frames
from distfsi.output.history import read_history
from distfsi.output.panels import (
    HISTORY_HEIGHT,
    WIDTH,
    draw_history,
    draw_maps,
    draw_profiles,
    maps_height,
    profiles_height,
)

TIMES = 4
STYLE = {
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
    with matplotlib.rc_context(STYLE):
        if frames[0].dimensions == 1:
            frames = [frames[0], *frames[1:][-1:]]
            draw, height = draw_profiles, profiles_height(frames)
        else:
            draw, height = draw_maps, maps_height(frames)
        heights = [height, HISTORY_HEIGHT]
        figure = Figure(figsize=(WIDTH, sum(heights)))
        fields, curves = figure.subfigures(2, 1, height_ratios=heights, hspace=0.0)
        draw(fields, frames)
        draw_history(curves, history)
        path = directory / "summary.png"
        figure.savefig(path, dpi=110)
    return path
