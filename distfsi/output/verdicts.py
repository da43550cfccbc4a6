"""Maps of verdicts: a table of squares per method, each in the color of what came out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from distfsi.output.charts import RESOLUTION, STYLE

HEIGHT, WIDTH = 2.5, 3.2  # of one map [inches]
HEAD = 0.9  # for title and legend [inches]


@dataclass(frozen=True)
class VerdictMap:
    """Numbers of verdicts (rows, columns); row and column names are those of all maps of a sheet."""

    title: str
    verdicts: np.ndarray


def draw_verdicts(
    path: Path,
    title: str,
    maps: Sequence[VerdictMap],
    rows: tuple[str, Sequence[str]],
    columns: tuple[str, Sequence[str]],
    colors: Mapping[str, str],
    across: int = 4,
) -> Path:
    """Draw maps side by side; returns `path`. `rows` and `columns`: a label and names; `colors`: of verdict 0, 1 …"""
    across = min(across, max(2, len(maps)))  # two leave room for the legend
    down = -(-len(maps) // across)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(across * WIDTH, down * HEIGHT + HEAD), layout="constrained")
        grid = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True)
        shades, norm = (
            ListedColormap(list(colors.values())),
            BoundaryNorm(np.arange(len(colors) + 1) - 0.5, len(colors)),
        )
        for axes, shown in zip(grid.flat, maps, strict=False):
            axes.pcolormesh(shown.verdicts, cmap=shades, norm=norm, edgecolors="white", linewidth=0.6)
            axes.set_title(shown.title)
            axes.set_xticks(np.arange(len(columns[1])) + 0.5, columns[1], rotation=90, fontsize=7)
            axes.set_yticks(np.arange(len(rows[1])) + 0.5, rows[1], fontsize=7)
        for axes in list(grid.flat)[len(maps) :]:
            axes.set_visible(False)
        for axes in list(grid.flat)[max(len(maps) - across, 0) : len(maps)]:  # the lowest of each column
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(columns[0], fontsize=7)
        figure.supylabel(rows[0], fontsize=9)
        figure.suptitle(title, fontsize=10)
        patches = [Patch(color=color, label=name) for name, color in colors.items()]
        figure.legend(handles=patches, loc="outside lower right", ncols=len(patches), frameon=False, fontsize=7)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=RESOLUTION)
    return path
