"""Maps: fields over a plane as colors, particles as discs on top. Lengths on paper are in inches."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure, SubFigure
from matplotlib.patheffects import Normal, Stroke
from scipy.ndimage import distance_transform_edt

from distfsi.narrowing import of_kind, present
from distfsi.output.frames import Frame
from distfsi.output.panels import GAP, LEFT, TITLE, WIDTH, XLABEL, draw_bar, grid_of_panels
from distfsi.output.progress import format_time
from distfsi.output.quantities import UNITS
from distfsi.output.scales import label_of, largest, norm_of, scaled

COLORS = {"density": "bone_r", "schlieren": "gray_r"}  # others: OTHER_COLORS
OTHER_COLORS = "viridis"
PARTICLE_COLORS = ListedColormap(
    colormaps["OrRd"](np.linspace(0.2, 1.0, 256)), "particles"
)  # none of the cells' colors
SUMMARY = ("pressure", "density")  # the fields of a summary
BAR_RIGHT, BAR_BELOW = 1.2, 0.75  # room for a color bar beside or below panels
HIGHEST = 11.0  # all rows of panels together
UPRIGHT_ASPECT = 0.6  # height over width of a domain from which on its maps stand side by side
DISC = 1.25  # diameter over the distance of particles: discs of a body leave no gaps
COVERED = "0.82"  # color of cells that hold no fluid
BESIDE = (
    1.6  # such cells that are no farther [cells] from fluid than this are drawn like it, where particles lie over them
)
MIXED, BOUNDARY = "volume_fraction", "white"  # how fields of shares begin; color of the line where one is a half


@dataclass(frozen=True)
class Colors:
    """How the field `name` becomes colors: values over `size`, the unit of the `label`, by `map`."""

    name: str
    size: float
    label: str
    map: ScalarMappable


def values(columns: Mapping[str, np.ndarray], name: str, axes: int) -> np.ndarray:
    """A field with one value per cell or particle, in `axes` axes; of a vector its magnitude, also named "speed"."""
    array = columns["velocity" if name == "speed" and name not in columns else name]
    return array if array.ndim == axes else np.linalg.norm(array, axis=-1)


def cell_colors(name: str, arrays: Sequence[np.ndarray]) -> Colors:
    """Colors of a field of the cells, for these values; logarithmic where they span decades."""
    size, unit = scaled(UNITS.get(name, ""), largest(arrays))
    norm = norm_of([array / size for array in arrays])
    return Colors(name, size, label_of(name, unit), ScalarMappable(norm, COLORS.get(name, OTHER_COLORS)))


def particle_colors(name: str, arrays: Sequence[np.ndarray]) -> Colors:
    """Colors of a field of the particles, for these values, from zero on where they have one sign."""
    size, unit = scaled(UNITS.get(name, ""), largest(arrays))
    finite = np.concatenate([array[np.isfinite(array)] for array in arrays]) / size
    low, high = finite.min(initial=0.0), finite.max(initial=0.0)
    norm = Normalize(low, high if high > low else low + 1.0)
    return Colors(name, size, label_of(name, unit), ScalarMappable(norm, PARTICLE_COLORS))


def field_colors(frames: Sequence[Frame], names: Sequence[str]) -> list[Colors]:
    """Colors of those of the fields that the cells have."""
    there = [name for name in names if name in frames[0].cells]
    return [cell_colors(name, [values(frame.cells, name, 2) for frame in frames]) for name in there]


def summary_colors(frames: Sequence[Frame]) -> tuple[list[Colors], Colors | None]:
    """Pressure and density of the cells; of the particles plastic strain or, where nothing has yielded, the speed."""
    fields = field_colors(frames, SUMMARY)
    if not any(len(frame.particles.get("position", ())) for frame in frames):
        return fields, None
    strained = largest(frame.particles.get("plastic_strain", np.zeros(0)) for frame in frames) > 0.0
    name = "plastic_strain" if strained else "speed"
    return fields, particle_colors(name, [values(frame.particles, name, 1) for frame in frames])


# ---- sheets ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Sheet:
    """Layout of the maps of some fields (or of particles alone) at some times: side by side, or where domains are wide
    one below the other."""

    aspect: float
    fields: int
    times: int
    particles: bool
    width: float = WIDTH
    highest: float = HIGHEST

    @property
    def upright(self) -> bool:
        """Whether each field has a row, and not a column."""
        return self.aspect > UPRIGHT_ASPECT

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of panels."""
        rows = max(self.fields, 1)
        return (rows, self.times) if self.upright else (self.times, rows)

    @property
    def _bars(self) -> tuple[bool, bool]:
        """Whether color bars stand beside and below the panels."""
        bars = self.fields > 0, self.particles
        return bars if self.upright else bars[::-1]

    @property
    def _panel_width(self) -> float:
        columns = self.shape[1]
        return (self.width - LEFT - self._right - (columns - 1) * GAP) / columns

    @property
    def _right(self) -> float:
        return BAR_RIGHT if self._bars[0] else 0.3

    @property
    def panel(self) -> tuple[float, float]:
        """Width and height of a panel."""
        width = min(self._panel_width, self.highest / self.shape[0] / self.aspect)
        return width, width * self.aspect

    @property
    def margins(self) -> tuple[float, float, float, float]:
        """Left, right, below, above; what the panels leave of the width goes to both sides."""
        spare = 0.5 * self.shape[1] * (self._panel_width - self.panel[0])
        return LEFT + spare, self._right + spare, XLABEL + BAR_BELOW * self._bars[1], TITLE

    @property
    def height(self) -> float:
        """Of the whole sheet."""
        rows = self.shape[0]
        return rows * self.panel[1] + (rows - 1) * (TITLE + 0.1) + sum(self.margins[2:])


def draw_maps(
    figure: Figure | SubFigure,
    sheet: Sheet,
    frames: Sequence[Frame],
    fields: Sequence[Colors],
    particles: Colors | None,
) -> None:
    """Each field at each time, particles on top."""
    grid = grid_of_panels(figure, *sheet.shape, sheet.margins, (GAP, TITLE + 0.1), sharex=True, sharey=True)
    by_field = grid if sheet.upright else grid.T
    left, right, bottom, top = frames[0].extent
    length, metres = scaled("m", max(right - left, top - bottom))
    sides = ("right", "below") if sheet.upright else ("below", "right")
    for axes, colors in zip(by_field, fields, strict=len(fields) > 0):
        _draw_field(axes, frames, colors, length)
        draw_bar(figure, axes, colors.map, colors.label, sides[0])
    for axes in by_field:
        for panel, frame in zip(axes, frames, strict=True):
            panel.set(title=f"t = {format_time(frame.time)}")
            if particles:
                _draw_particles(panel, frame, particles, length)
    if particles:
        draw_bar(figure, by_field.ravel().tolist(), particles.map, particles.label, sides[1])
    grid[0, 0].set(xlim=(left / length, right / length), ylim=(bottom / length, top / length))
    horizontal, vertical = (frames[0].names[axis] for axis in frames[0].axes)
    for panel in grid[-1]:
        panel.set_xlabel(f"{horizontal} [{metres}]")
    for panel in grid[:, 0]:
        panel.set_ylabel(f"{vertical} [{metres}]")


def _draw_field(axes: Iterable[Axes], frames: Sequence[Frame], colors: Colors, length: float) -> None:
    for panel, frame in zip(axes, frames, strict=True):
        field = values(frame.cells, colors.name, 2)
        image = np.ma.masked_invalid((_grown(field) if len(frame.particles) else field) / colors.size)
        left, right, low, high = (edge / length for edge in frame.extent)
        norm, edges = of_kind(Normalize, colors.map.norm), (left, right, low, high)
        map = present(colors.map.cmap).with_extremes(bad=COVERED)
        panel.imshow(image, origin="lower", extent=edges, norm=norm, cmap=map, aspect="auto")
        for share in _shares(frame):
            if _has_boundary(share):
                _draw_boundary(panel, share, edges)


def is_mixed(frame: Frame) -> bool:
    """Whether materials meet in a plane of cells, and not only bodies between them."""
    return any(_has_boundary(share) for share in _shares(frame))


def _shares(frame: Frame) -> list[np.ndarray]:
    """The volume fractions that cells know: of two materials that of the first, of more that of each."""
    return [share for name, share in frame.cells.items() if name.startswith(MIXED)]


def _has_boundary(share: np.ndarray) -> bool:
    if min(share.shape) == 1:
        return False
    return any(
        bool((np.diff(share > 0.5, axis=axis) & np.isfinite(np.diff(share, axis=axis))).any()) for axis in (0, 1)
    )


def _draw_boundary(panel: Axes, share: np.ndarray, edges: tuple[float, float, float, float]) -> None:
    """A line where one material gives way to the other."""
    rows, columns = share.shape
    left, right, low, high = edges
    x = left + (np.arange(columns) + 0.5) / columns * (right - left)
    y = low + (np.arange(rows) + 0.5) / rows * (high - low)
    lines = panel.contour(x, y, np.ma.masked_invalid(share), levels=[0.5], colors=BOUNDARY, linewidths=0.8)
    lines.set_path_effects([Stroke(linewidth=1.8, foreground="black"), Normal()])


def _grown(field: np.ndarray) -> np.ndarray:
    """A field whose empty cells beside others take the value of the nearest one: particles lie over them, but not over
    all of each."""
    empty = ~np.isfinite(field)
    if not empty.any() or empty.all():
        return field
    far, nearest = distance_transform_edt(empty, return_indices=True)
    return np.where(far <= BESIDE, field[tuple(nearest)], np.nan)


def _draw_particles(panel: Axes, frame: Frame, colors: Colors, length: float) -> None:
    positions = frame.particles["position"][:, list(frame.axes)] / length
    diameters = np.full(len(positions), DISC * frame.spacing / length)
    discs = EllipseCollection(
        diameters,
        diameters,
        np.zeros(len(positions)),
        units="xy",
        offsets=positions,
        offset_transform=panel.transData,
        facecolors=colors.map.to_rgba(values(frame.particles, colors.name, 1) / colors.size),
        linewidths=0.0,
    )
    panel.add_collection(discs)
