"""The row of panels that tells how a run went: energies, overpressure at gauges, the time step and what limits it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from distfsi.output.panels import LEFT, XLABEL, draw_legend, grid_of_panels
from distfsi.output.scales import DECADES, largest, scaled
from distfsi.output.tables import at_points

HEIGHT = 3.9  # inches
ROUNDING = 1e-12  # an energy that changes by less, relatively, is not drawn
CONSERVED = 1e-9  # drifts below are told in a word, not drawn
GAUGES = 6  # whose curves are drawn, at most: those with the highest overpressure
OVERPRESSURE = "overpressure [Pa]"

Table = Mapping[str, Any]


def draw_history(figure: Figure | SubFigure, history: Table, gauges: Mapping[str, Table]) -> None:
    """Over time: the change of each energy, the overpressure of the `gauges` that have one (tables by name), the time
    step by what limited it, and the drift of conserved totals where it is more than round-off."""
    size, unit = scaled("s", largest([history["time [s]"]]))
    changes, blasts, drifts = _changes(_energies(history)), _loudest(gauges), _drifts(history)
    drawn: list[Callable[[Axes, float], None]] = [partial(_draw_steps, history)]
    if blasts:
        drawn.insert(0, partial(_draw_blasts, blasts))
    if changes:
        drawn.insert(0, partial(_draw_changes, history, changes))
    if worst_drift(history) > CONSERVED:
        drawn.append(partial(_draw_drifts, history, drifts))
    panels = grid_of_panels(figure, 1, len(drawn), (LEFT, 0.3, XLABEL, 1.1), (1.0, 0.0))[0]
    for axes, draw in zip(panels, drawn, strict=True):
        draw(axes, size)
        axes.set_xlabel(f"time [{unit}]")
        axes.grid(alpha=0.3)
    figure.text(0.99, 0.97, verdict(history), ha="right", va="top", fontsize="small", color="0.35")


def worst_drift(history: Table) -> float:
    """The largest relative drift of a conserved total."""
    return largest(_drifts(history).values())


def verdict(history: Table) -> str:
    """How many steps, and how well the totals are conserved, in words."""
    worst, steps = worst_drift(history), history["step"][-1]
    kept = "mass, momentum and energy are conserved" if worst <= CONSERVED else "totals drift"
    return f"{steps:,.0f} steps; {kept} (to {worst:.1e})"


def _drifts(history: Table) -> dict[str, np.ndarray]:
    return {name.removeprefix("drift "): values for name, values in history.items() if name.startswith("drift ")}


# ---- panels ----------------------------------------------------------------------------------------------------------


def _plot(axes: Axes, x: np.ndarray, y: np.ndarray, label: str) -> None:
    axes.plot(x, y, "-" if np.count_nonzero(np.isfinite(y)) > 2 else ".-", label=label, linewidth=1.2)


def _draw_changes(history: Table, changes: Mapping[str, np.ndarray], axes: Axes, seconds: float) -> None:
    size, unit = scaled(_unit_of_energy(history), largest(changes.values()))
    for name, values in changes.items():
        _plot(axes, history["time [s]"] / seconds, values / size, re.sub(r" \[.*", "", name).replace("_", " "))
    axes.set_ylabel(f"change of energy [{unit}]")
    draw_legend(axes)


def _draw_blasts(blasts: Mapping[str, Table], axes: Axes, seconds: float) -> None:
    size, unit = scaled("Pa", largest(table[OVERPRESSURE] for table in blasts.values()))
    for name, table in blasts.items():
        _plot(axes, table["time [s]"] / seconds, table[OVERPRESSURE] / size, name.replace("_", " "))
    axes.set_ylabel(f"overpressure [{unit}]")
    draw_legend(axes)


def _draw_steps(history: Table, axes: Axes, seconds: float) -> None:
    """Each step in the color of what limited it."""
    time, step = history["time [s]"] / seconds, np.asarray(history["time step [s]"])
    reasons = np.array([_kind(reason) for reason in history["limited by"]])
    free = ~np.isin(reasons, ["start", "end time"])
    size, unit = scaled("s", largest([step[free]]))
    axes.plot(time[free], step[free] / size, "-", color="0.8", linewidth=0.8)
    for reason in dict.fromkeys(reasons[free]):
        there = reasons == reason
        axes.plot(time[there], step[there] / size, ".", markersize=4, label=reason)
    if free.any() and step[free].max() > DECADES * step[free].min() > 0.0:
        axes.set_yscale("log")
    else:
        axes.set_ylim(0.0, 1.1 * float(step[free].max(initial=size)) / size)
    axes.set_ylabel(f"time step [{unit}]")
    if free.any():
        draw_legend(axes)


def _draw_drifts(history: Table, drifts: Mapping[str, np.ndarray], axes: Axes, seconds: float) -> None:
    for name, values in drifts.items():
        _plot(axes, history["time [s]"] / seconds, values, re.sub(r" \[.*", "", name).replace("_", " "))
    axes.set_ylabel("relative drift of totals")
    draw_legend(axes)


def _kind(reason: str) -> str:
    """What limits a step, without the cell or the particle: "sound of solid particle 3 of body ..." is "sound of
    solid"."""
    return re.split(r" particle |,| in cell| \(", reason)[0].removeprefix("limited by ")


# ---- what is drawn ---------------------------------------------------------------------------------------------------


def _loudest(gauges: Mapping[str, Table]) -> dict[str, Table]:
    """The gauges at points with the highest overpressures, in the order of their names."""
    points = at_points(gauges)
    peaks = {name: float(np.nanmax(table[OVERPRESSURE], initial=-np.inf)) for name, table in points.items()}
    chosen = sorted(peaks, key=lambda name: -peaks[name])[:GAUGES]
    return {name: points[name] for name in sorted(chosen) if peaks[name] > 0.0}


def _unit_of_energy(history: Table) -> str:
    """Of a run in three dimensions, or per metre."""
    return next((name.rpartition("[")[2].rstrip("]") for name in history if "energy [J" in name), "J")


def _energies(history: Table) -> dict[str, np.ndarray]:
    """Energies of the parts; what the coupling creates as one."""
    names = [name for name in history if "energy [J" in name]
    energies = {name: history[name] for name in names if not name.startswith("coupling ")}
    created = [history[name] for name in names if name.startswith("coupling ")]
    return energies | ({"created by the coupling": np.sum(created, axis=0)} if created else {})


def _changes(energies: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Energies that change, less what they are at the start."""
    largest_of_all = max((np.abs(values).max() for values in energies.values()), default=0.0)
    return {
        name: values - values[:1] for name, values in energies.items() if np.ptp(values) > ROUNDING * largest_of_all
    }
