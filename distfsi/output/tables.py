"""Curves of a gauge's table: its quantities over time, or along a line at some times."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from distfsi.narrowing import present
from distfsi.output.panels import LEFT, LOGARITHMIC, TITLE, XLABEL, draw_legend, grid_of_panels
from distfsi.output.progress import format_time
from distfsi.output.scales import largest, norm_of, scaled

WIDTH, PANEL_HEIGHT, GAP = 10.0, 1.7, 0.65  # inches
COLUMNS, TIMES = 2, 5
COLUMN = re.compile(r"(?P<name>.*?)(_(?P<part>[rxyz]{1,2}))?( \[(?P<unit>.*)\])?")

Curves = dict[str, np.ndarray]


def draw_gauge(name: str, table: Mapping[str, Any]) -> Figure:
    """A panel for each quantity of a gauge's table, components of a vector in one panel."""
    table = dict(table)
    time = table.pop("time [s]")
    line = [table.pop(f"{axis} [m]") for axis in "rxyz" if f"{axis} [m]" in table]
    if line:
        along, unit, groups, labels = _along_line(time, np.stack(line, axis=1), table)
    else:
        size, unit = scaled("s", largest([time]))
        along, unit, groups, labels = time / size, f"time [{unit}]", _groups(table), None
    rows = -(-len(groups) // COLUMNS)
    top = TITLE + 0.5
    figure = Figure(figsize=(WIDTH, rows * PANEL_HEIGHT + (rows - 1) * GAP + XLABEL + top))
    panels = grid_of_panels(figure, rows, COLUMNS, (LEFT, 0.3, XLABEL, top), (LEFT + 0.2, GAP), sharex=True).ravel()
    for panel, ((quantity, si), curves) in zip(panels, groups.items(), strict=False):
        size, shown = scaled(si, largest(curves.values()))
        for part, values in curves.items():
            panel.plot(along, values / size, label=part, linewidth=1.0)
        panel.set_ylabel(f"{quantity.replace('_', ' ')} [{shown}]" if shown else quantity.replace("_", " "))
        panel.grid(alpha=0.3)
        if labels and quantity in LOGARITHMIC and isinstance(norm_of(list(curves.values())), LogNorm):
            panel.set_yscale("log")
        if labels is None and len(curves) > 1:
            draw_legend(panel, len(curves))
    for panel in panels[len(groups) :]:
        panel.set_visible(False)
    for panel in panels[max(0, len(groups) - COLUMNS) : len(groups)]:
        panel.set_xlabel(unit)
        panel.tick_params(labelbottom=True)
    if labels:
        figure.legend(panels[0].lines, labels, loc="upper right", ncols=TIMES, frameon=False)
    figure.suptitle(name, x=LEFT / WIDTH, ha="left")
    return figure


def _groups(table: Mapping[str, np.ndarray]) -> dict[tuple[str, str], Curves]:
    """Curves by quantity and unit; those of one quantity by component."""
    groups: dict[tuple[str, str], Curves] = {}
    for column, values in table.items():
        parts = present(COLUMN.fullmatch(column))
        groups.setdefault((parts["name"], parts["unit"] or ""), {})[parts["part"] or ""] = values
    return groups


def _along_line(
    time: np.ndarray, position: np.ndarray, table: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, str, dict[tuple[str, str], Curves], list[str]]:
    """Distance along the line, its label, the quantities at some times, and these times."""
    times = np.unique(time)
    chosen = times[np.unique(np.linspace(0, len(times) - 1, TIMES).round().astype(int))]
    points = int(np.count_nonzero(time == times[0]))
    distance = np.linalg.norm(position[:points] - position[0], axis=1)
    size, unit = scaled("m", largest([distance]))
    groups: dict[tuple[str, str], Curves] = {}
    for column, values in table.items():
        parts = present(COLUMN.fullmatch(column))
        name = parts["name"] + (f" {parts['part']}" if parts["part"] else "")
        groups[name, parts["unit"] or ""] = {format_time(t): values[time == t] for t in chosen}
    return distance / size, f"distance [{unit}]", groups, [format_time(t) for t in chosen]
