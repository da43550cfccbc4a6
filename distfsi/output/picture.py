"""One picture that sums up a finished run, from its files alone.

Names that it knows. Cells: density, pressure, velocity, volume_fraction...; particles: velocity, plastic_strain, and
those of the cells. Columns of the history: "time [s]", "time step [s]", "... energy [J]" and "drift ...".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import SubFigure

from distfsi.output.frames import Frame, load_frames
from distfsi.output.history import read_history
from distfsi.output.journal import read_journal
from distfsi.output.maps import Sheet, draw_maps, is_mixed, summary_colors
from distfsi.output.panels import WIDTH, draw_profiles, headed, profiles_height
from distfsi.output.tables import read_gauges
from distfsi.output.timeline import HEIGHT as HISTORY_HEIGHT
from distfsi.output.timeline import draw_history

TIMES, RESOLUTION = 4, 110  # dots per inch
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,
}


def draw_summary(directory: Path) -> Path:
    """Draw `summary.png` from the files of the run in `directory`; returns its path.

    One-dimensional runs: profiles at the first and the last time. Others: maps at up to four times, of the middle plane
    in three dimensions. Raises FileNotFoundError when a file is missing.
    """
    directory = Path(directory)
    results, history, notes = Overview.of(directory), read_history(directory / "history.csv"), read_journal(directory)
    with matplotlib.rc_context(STYLE):
        heights = [results.height, HISTORY_HEIGHT]
        figure, (upper, lower) = headed(WIDTH, heights, title_of(notes, directory), remark(results.frames, notes))
        results.draw(upper)
        draw_history(lower, history, read_gauges(directory))
        path = directory / "summary.png"
        figure.savefig(path, dpi=RESOLUTION)
    return path


@dataclass(frozen=True)
class Overview:
    """The fields of a run at some times, on a part of a sheet of this `height` [inches]: profiles of a run along a
    line at the first and the last time, maps of others."""

    frames: Sequence[Frame]
    height: float
    draw: Callable[[SubFigure], None]

    @classmethod
    def of(cls, directory: Path) -> Overview:
        """Raises FileNotFoundError when there are no field files."""
        frames = load_frames(directory, TIMES)
        if frames[0].dimensions == 1:
            frames = [frames[0], *frames[1:][-1:]]
            return cls(frames, profiles_height(frames), partial(draw_profiles, frames=frames))
        fields, particles = summary_colors(frames)
        sheet = Sheet(frames[0].aspect, len(fields), len(frames), particles is not None)
        return cls(
            frames,
            sheet.height,
            partial(draw_maps, sheet=sheet, frames=frames, fields=fields, particles=particles),
        )


def title_of(notes: Mapping[str, Any], directory: Path) -> str:
    """What a run is called in the head of a sheet."""
    return notes.get("title") or directory.resolve().name


def remark(frames: Sequence[Frame], notes: Mapping[str, Any]) -> str:
    """Where the plane of the frames lies, and what the line in them means."""
    words = [frames[0].location] if frames[0].location else []
    phases = notes.get("phases", ())
    if len(phases) > 1 and any(is_mixed(frame) for frame in frames):
        words.append(f"white line: between {', '.join(phases[:-1])} and {phases[-1]}")
    return "; ".join(words)
