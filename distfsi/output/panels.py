"""The panels of a picture: profiles along a line, maps of a plane, curves over time."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import FigureBase

from distfsi.output.frames import Frame
from distfsi.output.progress import format_time

UNITS = {"density": "kg/m³", "pressure": "Pa", "velocity": "m/s", "speed": "m/s", "temperature": "K"}
PROFILES = ("density", "pressure", "velocity", "volume_fraction", "plastic_strain")
MAPS = {"pressure": "viridis", "density": "bone_r"}
PARTICLE_COLORS = "plasma"
PREFIXES = {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "µ", 1e-9: "n"}
DECADES = 100.0  # positive values whose largest and smallest differ by more get a logarithmic scale


# ---- profiles: runs along x ------------------------------------------------------------------------------------------


def profile_names(frame: Frame) -> list[str]:
    """The fields of a one-dimensional run that are worth a row, in the order of the rows."""
    present = dict.fromkeys([*frame.cells, *frame.particles])
    return [name for known in PROFILES for name in present if name.startswith(known)]


def draw_profiles(figure: FigureBase, frames: Sequence[Frame]) -> None:
    """One row per field over x, one colour per time: cells as lines, particles as dots."""
    names = profile_names(frames[0])
    left, right, _, _ = frames[0].extent
    length, metres = scaled("m", right - left)
    rows = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(rows, names, strict=True):
        curves = [list(_curves(frame, name)) for frame in frames]
        size, unit = scaled(UNITS.get(name, ""), _largest(values for some in curves for _, values, _ in some))
        for frame, some, color in zip(frames, curves, ("0.55", "tab:blue"), strict=False):
            label = f"t = {format_time(frame.time)}"
            for x, values, style in some:
                axes.plot(x / length, values / size, style, color=color, markersize=3, label=label)
                label = None
        if name in MAPS:
            axes.set_yscale(_norm([values for some in curves for _, values, _ in some]).__class__ is LogNorm and "log" or "linear")
        axes.set_ylabel(_label(name, unit))
        axes.grid(alpha=0.3)
    rows[0].legend(loc="best")
    rows[-1].set_xlabel(f"x [{metres}]")


def _curves(frame: Frame, name: str) -> Iterator[tuple[np.ndarray, np.ndarray, str]]:
    """Places, values and line style of a field; of a vector its component along x."""
    if name in frame.cells:
        yield frame.cell_centers, frame.cells[name].reshape(frame.cell_centers.size, -1)[:, 0], "-"
    if name in frame.particles:
        values = frame.particles[name]
        yield frame.particles["position"][:, 0], values.reshape(len(values), -1)[:, 0] if len(values) else values, "o"


# ---- maps: runs in a plane, or the middle plane of a body ------------------------------------------------------------


def map_names(frame: Frame) -> list[str | None]:
    """The fields worth a map; a single None for particles alone."""
    return [name for name in MAPS if name in frame.cells] or [None]


def draw_maps(figure: FigureBase, frames: Sequence[Frame], upright: bool) -> None:
    """Each field at each time, particles on top; times side by side (`upright`) or one below the other."""
    names = map_names(frames[0])
    grid = figure.subplots(*_turn(len(names), len(frames), upright), sharex=True, sharey=True, squeeze=False)
    by_field = grid if upright else grid.T
    left, right, bottom, top = frames[0].extent
    length, metres = scaled("m", max(right - left, top - bottom))
    for axes, name in zip(by_field, names, strict=True):
        if name:
            _draw_field(figure, axes, frames, name, length, "right" if upright else "bottom")
    _draw_particles(figure, by_field, frames, length, "bottom" if upright else "right")
    for axes in by_field:
        for panel, frame in zip(axes, frames, strict=True):
            panel.set(title=f"t = {format_time(frame.time)}", aspect="equal")
            panel.set(xlim=(left / length, right / length), ylim=(bottom / length, top / length))
    for panel in grid[-1]:
        panel.set_xlabel(f"x [{metres}]")
    for panel in grid[:, 0]:
        panel.set_ylabel(f"y [{metres}]")


def _draw_field(
    figure: FigureBase, axes: Sequence[Axes], frames: Sequence[Frame], name: str, length: float, bar_side: str
) -> None:
    size, unit = scaled(UNITS[name], _largest(frame.cells[name] for frame in frames))
    norm = _norm([frame.cells[name] / size for frame in frames])
    for panel, frame in zip(axes, frames, strict=True):
        extent = [value / length for value in frame.extent]
        values = np.ma.masked_invalid(frame.cells[name] / size)
        image = panel.imshow(values, origin="lower", extent=extent, norm=norm, cmap=MAPS[name])
    figure.colorbar(image, ax=axes, location=bar_side, label=_label(name, unit))


def _draw_particles(
    figure: FigureBase, by_field: np.ndarray, frames: Sequence[Frame], length: float, bar_side: str
) -> None:
    """Discs of the size of the particles, coloured by plastic strain or, where nothing has yielded, by speed."""
    if not any(len(frame.particles.get("position", ())) for frame in frames):
        return
    name, values = _particle_colors(frames)
    size, unit = scaled(UNITS.get(name, ""), _largest(values))
    colors = ScalarMappable(Normalize(0.0, max(_largest(values) / size, 1e-30)), PARTICLE_COLORS)
    for axes in by_field:
        for panel, frame, value in zip(axes, frames, values, strict=True):
            diameters = np.full(len(value), frame.spacing / length)
            discs = EllipseCollection(
                diameters,
                diameters,
                np.zeros(len(value)),
                units="xy",
                offsets=frame.particles["position"][:, :2] / length,
                offset_transform=panel.transData,
                facecolors=colors.to_rgba(value / size),
            )
            panel.add_collection(discs)
    figure.colorbar(colors, ax=by_field, location=bar_side, label=_label(name, unit), shrink=0.6)


def _particle_colors(frames: Sequence[Frame]) -> tuple[str, list[np.ndarray]]:
    strains = [frame.particles.get("plastic_strain", np.zeros(0)) for frame in frames]
    if _largest(strains) > 0.0:
        return "plastic_strain", strains
    return "speed", [np.linalg.norm(frame.particles["velocity"], axis=1) for frame in frames]


# ---- history ---------------------------------------------------------------------------------------------------------


def draw_history(figure: FigureBase, history: Mapping[str, np.ndarray]) -> None:
    """Over time: the change of each energy, the relative change of each mass, and the time step."""
    size, unit = scaled("s", _largest([history["time [s]"]]))
    energies = {name: values - values[:1] for name, values in history.items() if "energy" in name}
    masses = {
        name: values / values[0] - 1.0
        for name, values in history.items()
        if "mass" in name and len(values) and values[0] != 0.0
    }
    step_size, step_unit = scaled("s", _largest([history["time step [s]"]]))
    panels = {
        f"change of energy [{_unit_of(next(iter(energies), ''))}]": energies,
        "relative change of mass": masses,
        f"time step [{step_unit}]": {"": history["time step [s]"] / step_size},
    }
    panels = {title: curves for title, curves in panels.items() if curves}
    for axes, (title, curves) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels.items(), strict=True):
        for name, values in curves.items():
            axes.plot(history["time [s]"] / size, values, label=re.sub(r" \[.*", "", name))
        axes.set(xlabel=f"time [{unit}]", ylabel=title)
        axes.grid(alpha=0.3)
        if len(curves) > 1:
            axes.legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.06), ncols=2)


def _unit_of(column: str) -> str:
    return column[column.find("[") + 1 :].rstrip("]")


# ---- scales and labels -----------------------------------------------------------------------------------------------


def scaled(unit: str, largest: float) -> tuple[float, str]:
    """The decimal multiple of a unit that suits values up to `largest`: (1e6, "MPa"); only m, s and Pa take one."""
    if unit not in ("m", "s", "Pa"):
        return 1.0, unit
    size = next((size for size in PREFIXES if largest >= 0.9999 * size), 1.0)
    return size, PREFIXES[size] + unit


def _largest(arrays: Iterable[np.ndarray]) -> float:
    """The largest finite magnitude in any of the arrays, 0 if there is none."""
    return max((float(np.abs(a[np.isfinite(a)]).max(initial=0.0)) for a in arrays), default=0.0)


def _norm(arrays: Sequence[np.ndarray]) -> Normalize:
    values = np.concatenate([array[np.isfinite(array)] for array in arrays] or [np.zeros(1)])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return LogNorm(low, high) if 0.0 < low < high / DECADES else Normalize(low, high)


def _label(name: str, unit: str) -> str:
    words = name.replace("_", " ")
    return f"{words} [{unit}]" if unit else words


def _turn(fields: int, times: int, upright: bool) -> tuple[int, int]:
    return (fields, times) if upright else (times, fields)
