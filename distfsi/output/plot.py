"""Pictures of a run from its files: `distfsi plot`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from distfsi.errors import InputError
from distfsi.output.frames import AXES, Film, Plane, as_line, load_frames
from distfsi.output.history import read_history
from distfsi.output.maps import Colors, Sheet, cell_colors, draw_maps, particle_colors, summary_colors, values
from distfsi.output.panels import HISTORY_HEIGHT, WIDTH, draw_history, draw_profiles, profiles_height
from distfsi.output.picture import STYLE
from distfsi.output.tables import draw_gauge

FOLDER = "plots"  # in the output directory
MAP_WIDTH, MAP_HEIGHT = 8.0, 9.0  # of a sheet; of the map at most [inches]
RESOLUTION = 100  # dots per inch
TIMES = 5  # at which a gauge's cells are drawn, at most
SECONDS_PER_FRAME = 0.15  # of a movie


def plot(
    directory: Path,
    field: str | None = None,
    particles: str | None = None,
    time: float | None = None,
    every: int = 1,
    slice: tuple[int, float] | None = None,
    gauges: bool = False,
    movie: bool = False,
    mirror: bool = False,
) -> Iterator[Path]:
    """Draw frames and history of the run in `directory` into its folder plots/, or its gauges; the files one by one.

    field: of the cells (default pressure); particles: field that colors the particles (default plastic strain or, where
    nothing has yielded, speed); time: only the frame nearest to it [s]; every: each so many frames; slice: plane of
    three dimensions, (axis, position [m]), by default the one that shows most of the bodies; movie: the frames as an
    animated GIF, too; mirror: both sides of the axis of an axisymmetric run. Runs along a line are drawn with all their
    fields. Raises InputError where the directory has no such thing.
    """
    folder = directory / FOLDER
    if gauges:
        yield from _draw_gauges(directory, folder)
        return
    film = _open(directory, slice, mirror)
    numbers: Sequence[int] = range(0, len(film), every)
    if time is not None:
        numbers = [int(np.argmin(np.abs(np.array(film.times) - time)))]
    folder.mkdir(exist_ok=True)
    first = next(film.frames([0]))
    label = "" if slice is None else f"-{AXES[slice[0]]}={slice[1]:g}"
    draw = _draw_lines if first.dimensions == 1 else _draw_planes
    frames = []
    for path in draw(film, numbers, folder, label, field, particles):
        frames.append(path)
        yield path
    if movie:
        yield _write_movie(frames)
    if (directory / "history.csv").exists() and time is None:
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(WIDTH, HISTORY_HEIGHT))
            draw_history(figure, read_history(directory / "history.csv"))
            yield _save(figure, folder / "history.png")


def _open(directory: Path, plane: Plane | None, mirror: bool) -> Film:
    try:
        film = Film(directory, plane, mirror)
        next(film.frames([0]))
    except (FileNotFoundError, ValueError) as error:
        raise InputError([f"{directory}: {error}"]) from error
    return film


def _save(figure: Figure, path: Path) -> Path:
    figure.savefig(path, dpi=RESOLUTION)
    return path


# ---- frames ----------------------------------------------------------------------------------------------------------


def _draw_lines(film: Film, numbers: Sequence[int], folder: Path, label: str, *_: object) -> Iterator[Path]:
    """Profiles of all fields, beside those of the first time, on axes that fit all times."""
    frames = dict(zip(numbers, film.frames(numbers), strict=True))
    first = next(film.frames([0]))
    fitted = [first, *frames.values()]
    for number, frame in frames.items():
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(MAP_WIDTH, profiles_height(fitted)))
            draw_profiles(figure, [first, frame] if number else [first], fitted)
            yield _save(figure, folder / f"profiles{label}-{number:06d}.png")


def _draw_planes(
    film: Film, numbers: Sequence[int], folder: Path, label: str, field: str | None, particles: str | None
) -> Iterator[Path]:
    """Maps with the same colors at all times."""
    name = _field(film, field)
    fields = [] if name is None else [_cell_colors(film, numbers, name)]
    names = [name] if name else []
    what = "-".join(filter(None, (name, particles))) or "particles"
    colors = _particle_colors(film, numbers, names, particles)
    for number, frame in zip(numbers, film.frames(numbers, names), strict=True):
        sheet = Sheet(frame.aspect, len(fields), 1, colors is not None, MAP_WIDTH, MAP_HEIGHT)
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(MAP_WIDTH, sheet.height))
            draw_maps(figure, sheet, [frame], fields, colors)
            yield _save(figure, folder / f"{what}{label}-{number:06d}.png")


def _field(film: Film, wanted: str | None) -> str | None:
    """The field of the cells to draw; None where the run has no cells."""
    present = film.cell_fields
    if wanted is None:
        return next((name for name in ("pressure", *present) if name in present), None)
    if wanted not in present:
        raise InputError([f"--field {wanted}: no such field; there are {', '.join(present) or 'none'}"])
    return wanted


def _cell_colors(film: Film, numbers: Sequence[int], name: str) -> Colors:
    extremes = [_extremes(values(frame.cells, name, 2)) for frame in film.frames(numbers, [name])]
    return cell_colors(name, extremes)


def _particle_colors(film: Film, numbers: Sequence[int], names: list[str], wanted: str | None) -> Colors | None:
    present = film.particle_fields
    if not present:
        return None
    if wanted is not None and wanted not in (*present, "speed"):
        raise InputError([f"--particles {wanted}: no such field; there are speed, {', '.join(present)}"])
    usual = [name for name in ("plastic_strain", "speed") if name in (*present, "speed")]
    for name in [wanted] if wanted else usual:
        extremes = [_extremes(values(frame.particles, name, 1)) for frame in film.frames(numbers, names)]
        if wanted or any(values.any() for values in extremes):
            break
    return particle_colors(name, extremes)


def _extremes(array: np.ndarray) -> np.ndarray:
    """Smallest and largest finite value; for logarithms the smallest must be what it is."""
    finite = array[np.isfinite(array)]
    return np.array([finite.min(), finite.max()]) if finite.size else finite


def _write_movie(frames: Sequence[Path]) -> Path:
    """The PNG files as an animated GIF that goes round."""
    path = frames[0].with_name(frames[0].stem.rsplit("-", 1)[0] + ".gif")
    images = [Image.open(frame).convert("RGB").quantize() for frame in frames]
    images[0].save(path, save_all=True, append_images=images[1:], duration=int(1000 * SECONDS_PER_FRAME), loop=0)
    return path


# ---- gauges ----------------------------------------------------------------------------------------------------------


def _draw_gauges(directory: Path, folder: Path) -> Iterator[Path]:
    """A sheet per gauge: curves over time, profiles or maps at some times."""
    source = directory / "gauges"
    tables, planes = sorted(source.glob("*.csv")), sorted(source.glob("*/cells.vtkhdf.series"))
    if not tables and not planes:
        raise InputError([f"{directory}: no gauges; [gauges.NAME] in the input makes some"])
    folder.mkdir(exist_ok=True)
    for table in tables:
        with matplotlib.rc_context(STYLE):
            yield _save(draw_gauge(table.stem, read_history(table)), folder / f"gauge-{table.stem}.png")
    for plane in planes:
        with matplotlib.rc_context(STYLE):
            yield _save(_draw_layer(plane.parent), folder / f"gauge-{plane.parent.name}.png")


def _draw_layer(directory: Path) -> Figure:
    """The layer of cells of a gauge at some times: maps or, where it is a row of cells, profiles."""
    frames = load_frames(directory, TIMES)
    lines = [line for line in map(as_line, frames) if line]
    if lines:
        figure = Figure(figsize=(MAP_WIDTH, profiles_height(lines)))
        draw_profiles(figure, lines)
        return figure
    fields, particles = summary_colors(frames)
    sheet = Sheet(frames[0].aspect, len(fields), len(frames), particles is not None)
    figure = Figure(figsize=(WIDTH, sheet.height))
    draw_maps(figure, sheet, frames, fields, particles)
    return figure
