"""Curves of gauges: the quantities of one over time or along a line, and the blast at several points side by side."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from distfsi.narrowing import present
from distfsi.output.history import read_history
from distfsi.output.panels import LEFT, LOGARITHMIC, XLABEL, draw_legend, grid_of_panels, headed
from distfsi.output.progress import format_time
from distfsi.output.scales import DECADES, largest, norm_of, scaled

WIDTH, PANEL_HEIGHT, GAP, FOOT = 10.0, 1.9, 0.65, 0.3  # inches
COLUMNS, TIMES = 2, 5
COLUMN = re.compile(r"(?P<name>.*?)(_(?P<part>[rxyz]{1,2}))?( \[(?P<unit>.*)\])?")
FIRST = ("overpressure", "impulse")  # what a reader of a blast looks for
CONSTANT = 1e-9  # relative: a quantity that varies by less is told, not drawn

Table = Mapping[str, Any]
Curves = dict[str, np.ndarray]
Groups = dict[tuple[str, str], Curves]


def draw_gauge(name: str, table: Table, location: str = "") -> Figure:
    """A panel for each quantity of a gauge's table that varies, components of a vector in one panel, overpressure and
    impulse first; the others are told below. `location`: where the gauge is, in words."""
    table = dict(table)
    time = table.pop("time [s]")
    line = [table.pop(f"{axis} [m]") for axis in "rxyz" if f"{axis} [m]" in table]
    if line:
        along, label, groups, labels = _along_line(time, np.stack(line, axis=1), table)
    else:
        size, unit = scaled("s", largest([time]))
        along, label, groups, labels = time / size, f"time [{unit}]", _groups(table), None
    groups, constants = _varying(groups)
    rows = max(1, -(-len(groups) // COLUMNS))
    margins = (LEFT, 0.3, XLABEL + FOOT, 0.45 if labels else 0.35)
    height = rows * PANEL_HEIGHT + (rows - 1) * GAP + margins[2] + margins[3]
    span = f"{format_time(float(time[0]))} to {format_time(float(time[-1]))}" if len(time) else "no samples"
    figure, (body,) = headed(WIDTH, [height], f"{name}: {location}" if location else name, span)
    panels = grid_of_panels(body, rows, COLUMNS, margins, (LEFT + 0.2, GAP), sharex=True).ravel()
    for panel, ((quantity, si), curves) in zip(panels, groups.items(), strict=False):
        _draw_panel(panel, along, quantity, si, curves)
        if labels and quantity in LOGARITHMIC and isinstance(norm_of(list(curves.values())), LogNorm):
            panel.set_yscale("log")
        if labels is None and len(curves) > 1:
            draw_legend(panel, len(curves))
    for panel in panels[len(groups) :]:
        panel.set_visible(False)
    for panel in panels[max(0, len(groups) - COLUMNS) : len(groups)]:
        panel.set_xlabel(label)
        panel.tick_params(labelbottom=True)
    if labels and groups:
        body.legend(panels[0].lines, labels, loc="upper right", ncols=TIMES, frameon=False)
    if constants:
        body.text(0.2 / WIDTH, 0.08 / height, f"constant: {', '.join(constants)}", fontsize="small", color="0.35")
    return figure


def draw_blasts(tables: Mapping[str, Table], title: str) -> Figure:
    """Overpressure and impulse over time of gauges at points, by name; logarithmic where their peaks are decades
    apart."""
    size, unit = scaled("s", largest(table["time [s]"] for table in tables.values()))
    margins = (LEFT, 0.3, XLABEL, 0.3 + 0.2 * -(-len(tables) // 2))
    height = 2.0 * PANEL_HEIGHT + margins[2] + margins[3]
    figure, (body,) = headed(WIDTH, [height], title)
    panels = grid_of_panels(body, 1, 2, margins, (LEFT + 0.2, 0.0))[0]
    for panel, (quantity, si) in zip(panels, (("overpressure", "Pa"), ("impulse", "Pa s")), strict=True):
        curves = {name: table[f"{quantity} [{si}]"] for name, table in tables.items()}
        peaks = [largest([values]) for values in curves.values()]
        factor, shown = scaled(si, max(peaks))
        for name, values in curves.items():
            panel.plot(tables[name]["time [s]"] / size, values / factor, label=name.replace("_", " "), linewidth=1.2)
        if max(peaks) > DECADES * min(peaks) > 0.0:
            panel.set_yscale("log")
            panel.set_ylim(1e-2 * min(peaks) / factor, 2.0 * max(peaks) / factor)
        panel.set(xlabel=f"time [{unit}]", ylabel=f"{quantity} [{shown}]")
        panel.grid(alpha=0.3)
        draw_legend(panel)
    return figure


def read_gauges(directory: Path) -> dict[str, dict[str, Any]]:
    """The tables of the gauges of a run that have samples, by name."""
    tables = {path.stem: read_history(path) for path in sorted((directory / "gauges").glob("*.csv"))}
    return {name: table for name, table in tables.items() if len(table["time [s]"])}


def at_points(tables: Mapping[str, Table]) -> dict[str, Table]:
    """Those of gauges at points of the fluid."""
    return {name: t for name, t in tables.items() if "overpressure [Pa]" in t and "x [m]" not in t}


def _draw_panel(panel: Axes, along: np.ndarray, quantity: str, si: str, curves: Curves) -> None:
    size, shown = scaled(si, largest(curves.values()))
    for part, values in curves.items():
        panel.plot(along, values / size, label=part, linewidth=1.0)
    words = quantity.replace("_", " ")
    panel.set_ylabel(f"{words} [{shown}]" if shown else words)
    panel.grid(alpha=0.3)


def _groups(table: Table) -> Groups:
    """Curves by quantity and unit; those of one quantity by component."""
    groups: Groups = {}
    for column, values in table.items():
        parts = present(COLUMN.fullmatch(column))
        groups.setdefault((parts["name"], parts["unit"] or ""), {})[parts["part"] or ""] = values
    return groups


def _varying(groups: Groups) -> tuple[Groups, list[str]]:
    """The groups in which something varies, overpressure and impulse first, and the others in words. A pressure that
    is overpressure beside a constant is no other quantity."""
    over, pressure = groups.get(("overpressure", "Pa")), groups.get(("pressure", "Pa"))
    constants = []
    if over and pressure:
        ambient = np.concatenate([pressure[part] - over[part] for part in over])
        if _is_constant(ambient, largest(pressure.values())):
            groups = {key: curves for key, curves in groups.items() if key != ("pressure", "Pa")}
            constants.append(f"ambient pressure {_value(ambient, 'Pa')}")
    varying: Groups = {}
    for (name, unit), curves in sorted(groups.items(), key=lambda item: item[0][0] not in FIRST):
        size = largest(curves.values())
        if all(_is_constant(values, size) for values in curves.values()):
            texts = {f"{part} {_value(values, unit)}".strip(): None for part, values in curves.items()}
            constants.append(f"{name.replace('_', ' ')} {', '.join(texts)}")
        else:
            varying[name, unit] = curves
    return varying, constants


def _is_constant(values: np.ndarray, size: float) -> bool:
    finite = values[np.isfinite(values)]
    return finite.size == 0 or float(np.ptp(finite)) <= CONSTANT * size


def _value(values: np.ndarray, unit: str) -> str:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "without values"
    size, shown = scaled(unit, abs(float(finite[0])))
    return f"{finite[0] / size:.4g} {shown}".strip()


def _along_line(time: np.ndarray, position: np.ndarray, table: Table) -> tuple[np.ndarray, str, Groups, list[str]]:
    """Distance along the line, its label, the quantities at some times, and these times."""
    times = np.unique(time)
    chosen = times[np.unique(np.linspace(0, len(times) - 1, TIMES).round().astype(int))]
    points = int(np.count_nonzero(time == times[0]))
    distance = np.linalg.norm(position[:points] - position[0], axis=1)
    size, unit = scaled("m", largest([distance]))
    groups: Groups = {}
    for column, values in table.items():
        parts = present(COLUMN.fullmatch(column))
        name = parts["name"] + (f" {parts['part']}" if parts["part"] else "")
        groups[name, parts["unit"] or ""] = {format_time(t): values[time == t] for t in chosen}
    return distance / size, f"distance [{unit}]", groups, [format_time(t) for t in chosen]
