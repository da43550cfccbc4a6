"""The panels of a picture: profiles along a line, maps of a plane, curves over time. Lengths on paper are in inches."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import FigureBase
from matplotlib.transforms import Bbox

from distfsi.output.frames import Frame
from distfsi.output.progress import format_time

UNITS = {"density": "kg/m³", "pressure": "Pa", "velocity": "m/s", "speed": "m/s"}
PROFILES = ("density", "pressure", "velocity", "volume_fraction", "plastic_strain")
MAPS = {"pressure": "viridis", "density": "bone_r"}
PARTICLE_COLORS = "plasma"
TIME_COLORS = ("0.55", "tab:blue")
PREFIXES = {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "µ", 1e-9: "n"}
DECADES = 100.0  # positive values whose largest and smallest differ by more get a logarithmic scale

ROUNDING = 1e-12  # an energy that changes by less, relatively, is not drawn

WIDTH = 12.0
LEFT, BAR_RIGHT, BAR_BELOW = 0.9, 1.2, 0.75  # room for the labels of an axis, for a colour bar beside or below panels
GAP, TITLE, XLABEL = 0.35, 0.4, 0.6  # between panels, above them, below the last of them
PROFILE_HEIGHT, HISTORY_HEIGHT, MAPS_HEIGHT = 1.6, 4.0, 11.0
UPRIGHT_ASPECT = 0.6  # height over width of a domain from which on its maps stand side by side


# ---- profiles: runs along x ------------------------------------------------------------------------------------------


def profiles_height(frames: Sequence[Frame]) -> float:
    """Height that `draw_profiles` needs."""
    return len(_profile_names(frames[0])) * (PROFILE_HEIGHT + 0.5 * GAP) + XLABEL + TITLE


def draw_profiles(figure: FigureBase, frames: Sequence[Frame]) -> None:
    """One row per field over x, one colour per time: cells as lines, particles as dots."""
    names = _profile_names(frames[0])
    left, right, _, _ = frames[0].extent
    length, metres = scaled("m", right - left)
    margins, gaps = (LEFT, 0.3, XLABEL, TITLE), (0.0, 0.5 * GAP)
    rows = _panels(figure, len(names), 1, margins, gaps, sharex=True)[:, 0]
    for axes, name in zip(rows, names, strict=True):
        curves = [list(_curves(frame, name)) for frame in frames]
        everything = [values for some in curves for _, values, _ in some]
        size, unit = scaled(UNITS.get(name, ""), _largest(everything))
        for some, color in zip(curves, TIME_COLORS, strict=False):
            for x, values, style in some:
                axes.plot(x / length, values / size, style, color=color, markersize=3)
        if name in MAPS and isinstance(_norm(everything), LogNorm):
            axes.set_yscale("log")
        axes.set_ylabel(_label(name, unit))
        axes.grid(alpha=0.3)
    times = [f"t = {format_time(frame.time)}" for frame in frames]
    handles = [axes.plot([], [], color=color)[0] for color, _ in zip(TIME_COLORS, frames, strict=False)]
    rows[0].legend(handles, times, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
    rows[-1].set(xlabel=f"x [{metres}]", xlim=(left / length, right / length))
    figure.align_ylabels(rows)


def _profile_names(frame: Frame) -> list[str]:
    present = dict.fromkeys([*frame.cells, *frame.particles])
    return [name for known in PROFILES for name in present if name.startswith(known)]


def _curves(frame: Frame, name: str) -> Iterator[tuple[np.ndarray, np.ndarray, str]]:
    """Places, values and line style of a field; of a vector its component along x."""
    if name in frame.cells:
        yield frame.cell_centers, _along_x(frame.cells[name][0]), "-"
    if name in frame.particles:
        yield frame.particles["position"][:, 0], _along_x(frame.particles[name]), "o"


def _along_x(values: np.ndarray) -> np.ndarray:
    return values[:, 0] if values.ndim == 2 else values


# ---- maps: runs in a plane, or the middle plane of three dimensions --------------------------------------------------


def maps_height(frames: Sequence[Frame]) -> float:
    """Height that `draw_maps` needs."""
    rows, _, _, height, (_, _, below, above) = _map_sheet(frames)
    return rows * height + (rows - 1) * (TITLE + 0.1) + below + above


def draw_maps(figure: FigureBase, frames: Sequence[Frame]) -> None:
    """Each field at each time, particles on top; times side by side, or one below the other where domains are wide."""
    names, upright = _map_names(frames[0]), _upright(frames)
    rows, columns, _, _, margins = _map_sheet(frames)
    grid = _panels(figure, rows, columns, margins, (GAP, TITLE + 0.1), sharex=True, sharey=True)
    by_field = grid if upright else grid.T
    left, right, bottom, top = frames[0].extent
    length, metres = scaled("m", max(right - left, top - bottom))
    for axes, name in zip(by_field, names, strict=True):
        if name:
            _draw_field(figure, axes, frames, name, length, "right" if upright else "below")
        for panel, frame in zip(axes, frames, strict=True):
            panel.set(title=f"t = {format_time(frame.time)}")
    if _has_particles(frames):
        _draw_particles(figure, by_field, frames, length, "below" if upright else "right")
    grid[0, 0].set(xlim=(left / length, right / length), ylim=(bottom / length, top / length))
    for panel in grid[-1]:
        panel.set_xlabel(f"x [{metres}]")
    for panel in grid[:, 0]:
        panel.set_ylabel(f"y [{metres}]")


def _map_names(frame: Frame) -> list[str | None]:
    """The fields worth a map; a single None for particles alone."""
    return [name for name in MAPS if name in frame.cells] or [None]


def _upright(frames: Sequence[Frame]) -> bool:
    return frames[0].aspect > UPRIGHT_ASPECT


def _map_sheet(frames: Sequence[Frame]) -> tuple[int, int, float, float, tuple[float, float, float, float]]:
    """Rows, columns, width and height of a panel, and margins, of the maps."""
    fields, times = len(_map_names(frames[0])), len(frames)
    upright, particles = _upright(frames), _has_particles(frames)
    rows, columns = (fields, times) if upright else (times, fields)
    beside = bool(frames[0].cells) if upright else particles
    below = particles if upright else bool(frames[0].cells)
    right, bottom = BAR_RIGHT if beside else 0.3, XLABEL + BAR_BELOW * below
    room = (WIDTH - LEFT - right - (columns - 1) * GAP) / columns
    width = min(room, MAPS_HEIGHT / rows / frames[0].aspect)
    # What the panels leave of the width goes to both sides.
    spare = 0.5 * columns * (room - width)
    return rows, columns, width, width * frames[0].aspect, (LEFT + spare, right + spare, bottom, TITLE)


def _draw_field(
    figure: FigureBase, axes: Sequence[Axes], frames: Sequence[Frame], name: str, length: float, side: str
) -> None:
    size, unit = scaled(UNITS[name], _largest(frame.cells[name] for frame in frames))
    norm = _norm([frame.cells[name] / size for frame in frames])
    extent = [value / length for value in frames[0].extent]
    for panel, frame in zip(axes, frames, strict=True):
        values = np.ma.masked_invalid(frame.cells[name] / size)
        panel.imshow(values, origin="lower", extent=extent, norm=norm, cmap=MAPS[name], aspect="auto")
    _draw_bar(figure, axes, ScalarMappable(norm, MAPS[name]), _label(name, unit), side)


def _has_particles(frames: Sequence[Frame]) -> bool:
    return any(len(frame.particles.get("position", ())) for frame in frames)


def _draw_particles(
    figure: FigureBase, by_field: np.ndarray, frames: Sequence[Frame], length: float, side: str
) -> None:
    """Discs of the size of the particles, coloured by plastic strain or, where nothing has yielded, by speed."""
    name, values = _particle_colors(frames)
    colors = ScalarMappable(Normalize(0.0, _largest(values) or 1.0), PARTICLE_COLORS)
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
                facecolors=colors.to_rgba(value),
                linewidths=0.0,
            )
            panel.add_collection(discs)
    _draw_bar(figure, by_field.ravel(), colors, _label(name, UNITS.get(name, "")), side)


def _particle_colors(frames: Sequence[Frame]) -> tuple[str, list[np.ndarray]]:
    strains = [frame.particles.get("plastic_strain", np.zeros(0)) for frame in frames]
    if _largest(strains) > 0.0:
        return "plastic_strain", strains
    return "speed", [np.linalg.norm(frame.particles["velocity"], axis=1) for frame in frames]


# ---- history ---------------------------------------------------------------------------------------------------------


def draw_history(figure: FigureBase, history: Mapping[str, np.ndarray]) -> None:
    """Over time: the change of each energy, the drift of each conserved total, and the time step."""
    time = history["time [s]"]
    size, unit = scaled("s", _largest([time]))
    step = np.where(history["time step [s]"] > 0.0, history["time step [s]"], np.nan)
    step_size, step_unit = scaled("s", _largest([step]))
    drifts = {name.removeprefix("drift "): values for name, values in history.items() if name.startswith("drift ")}
    energies = {
        name: values - values[:1]
        for name, values in history.items()
        if name.endswith("energy [J]")
        and not name.startswith("drift ")
        and np.ptp(values) > ROUNDING * np.abs(values).max()
    }
    panels = (
        ("change of energy [J]", energies),
        ("relative drift of totals", drifts),
        (f"time step [{step_unit}]", {"": step / step_size}),
    )
    for axes, (title, curves) in zip(
        _panels(figure, 1, 3, (LEFT, 0.3, XLABEL, 1.3), (1.0, 0.0))[0], panels, strict=True
    ):
        for name, values in curves.items():
            axes.plot(time / size, values, label=re.sub(r" \[.*", "", name).replace("_", " "))
        axes.set(xlabel=f"time [{unit}]", ylabel=title)
        axes.grid(alpha=0.3)
        if len(curves) > 1:
            axes.legend(fontsize="x-small", loc="lower left", bbox_to_anchor=(-0.15, 1.06), ncols=2, frameon=False)


# ---- places on the sheet ---------------------------------------------------------------------------------------------


def _panels(
    figure: FigureBase,
    rows: int,
    columns: int,
    margins: tuple[float, float, float, float],
    gaps: tuple[float, float],
    **shared: bool,
) -> np.ndarray:
    """Equal panels within the margins (left, right, below, above), `gaps` apart along x and y."""
    width, height = figure.bbox.width / figure.dpi, figure.bbox.height / figure.dpi
    left, right, below, above = margins
    panel_width = (width - left - right - (columns - 1) * gaps[0]) / columns
    panel_height = (height - below - above - (rows - 1) * gaps[1]) / rows
    places = {
        "left": left / width,
        "right": 1.0 - right / width,
        "bottom": below / height,
        "top": 1.0 - above / height,
        "wspace": gaps[0] / panel_width,
        "hspace": gaps[1] / panel_height,
    }
    return figure.subplots(rows, columns, squeeze=False, gridspec_kw=places, **shared)


def _draw_bar(figure: FigureBase, axes: Sequence[Axes], colors: ScalarMappable, label: str, side: str) -> None:
    """A colour bar along the right or the lower edge of some panels."""
    width, height = figure.bbox.width / figure.dpi, figure.bbox.height / figure.dpi
    box = Bbox.union([panel.get_position() for panel in axes])
    if side == "right":
        place = (box.x1 + 0.25 / width, box.y0, 0.15 / width, box.height)
        figure.colorbar(colors, cax=figure.add_axes(place), label=label)
    else:
        place = (box.x0, box.y0 - (XLABEL + 0.15) / height, box.width, 0.15 / height)
        figure.colorbar(colors, cax=figure.add_axes(place), label=label, orientation="horizontal")


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
    values = np.concatenate([array[np.isfinite(array)] for array in arrays])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return LogNorm(low, high) if 0.0 < low < high / DECADES else Normalize(low, high)


def _label(name: str, unit: str) -> str:
    words = name.replace("_", " ")
    return f"{words} [{unit}]" if unit else words
