"""Pictures of a run from its files: `distfsi plot`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from distfsi.errors import InputError
from distfsi.output.frames import AXES, Film, Plane, as_line, load_frames
from distfsi.output.history import read_history
from distfsi.output.journal import read_journal
from distfsi.output.maps import (
    MIXED,
    Colors,
    Sheet,
    cell_colors,
    draw_maps,
    field_colors,
    particle_colors,
    summary_colors,
    values,
)
from distfsi.output.panels import PROFILES, WIDTH, draw_profiles, headed, profiles_height
from distfsi.output.picture import STYLE, remark, title_of
from distfsi.output.tables import at_points, draw_blasts, draw_gauge, read_gauges
from distfsi.output.timeline import HEIGHT as HISTORY_HEIGHT
from distfsi.output.timeline import draw_history

FOLDER = "plots"  # in the output directory
MAP_WIDTH, MAP_HEIGHT = 8.0, 9.0  # of a sheet; of the map at most [inches]
RESOLUTION = 100  # dots per inch
TIMES = 5  # at which a gauge's cells are drawn, at most
SECONDS_PER_FRAME = 0.15  # of a movie
PEAKS = ("peak_overpressure", "positive_impulse", "arrival_time")  # of what cells remember those that are drawn
LOADS = ("overpressure", "peak_overpressure", "impulse")  # on a surface


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
    film, notes = _open(directory, slice, mirror), read_journal(directory)
    title = title_of(notes, directory)
    numbers: Sequence[int] = range(0, len(film), every)
    if time is not None:
        numbers = [int(np.argmin(np.abs(np.array(film.times) - time)))]
    folder.mkdir(exist_ok=True)
    first = next(film.frames([0]))
    label = "" if slice is None else f"-{AXES[slice[0]]}={slice[1]:g}"
    draw = _draw_lines if first.dimensions == 1 else _draw_planes
    frames = []
    for path in draw(film, numbers, folder, label, title, notes, field, particles):
        frames.append(path)
        yield path
    if movie:
        yield _write_movie(frames)
    if time is None:
        yield from _draw_peaks(film, folder, label, title)
        if (directory / "history.csv").exists():
            with matplotlib.rc_context(STYLE):
                figure, (body,) = headed(WIDTH, [HISTORY_HEIGHT], title)
                draw_history(body, read_history(directory / "history.csv"), read_gauges(directory))
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


def _draw_lines(film: Film, numbers: Sequence[int], folder: Path, label: str, title: str, *_: object) -> Iterator[Path]:
    """Profiles of all fields, beside those of the first time, on axes that fit all times."""
    frames = dict(zip(numbers, film.frames(numbers), strict=True))
    first = next(film.frames([0]))
    fitted = [first, *frames.values()]
    for number, frame in frames.items():
        with matplotlib.rc_context(STYLE):
            figure, (body,) = headed(MAP_WIDTH, [profiles_height(fitted)], title)
            draw_profiles(body, [first, frame] if number else [first], fitted)
            yield _save(figure, folder / f"profiles{label}-{number:06d}.png")


def _draw_planes(
    film: Film,
    numbers: Sequence[int],
    folder: Path,
    label: str,
    title: str,
    notes: Mapping[str, Any],
    field: str | None,
    particles: str | None,
) -> Iterator[Path]:
    """Maps with the same colors at all times."""
    name = _field(film, field)
    fields = [] if name is None else [_cell_colors(film, numbers, name)]
    names = [name] if name else []
    what = "-".join(filter(None, (name, particles))) or "particles"
    colors = _particle_colors(film, numbers, names, particles)
    mixed = [name for name in film.cell_fields if name.startswith(MIXED)]
    shown = [*names, *(name for name in mixed if name not in names)]
    for number, frame in zip(numbers, film.frames(numbers, shown), strict=True):
        sheet = Sheet(frame.aspect, len(fields), 1, colors is not None, MAP_WIDTH, MAP_HEIGHT)
        with matplotlib.rc_context(STYLE):
            figure, (body,) = headed(MAP_WIDTH, [sheet.height], title, remark([frame], notes))
            draw_maps(body, sheet, [frame], fields, colors)
            yield _save(figure, folder / f"{what}{label}-{number:06d}.png")


def _draw_peaks(film: Film, folder: Path, label: str, title: str) -> Iterator[Path]:
    with matplotlib.rc_context(STYLE):
        figure = peaks_figure(film, title)
        if figure is not None:
            yield _save(figure, folder / f"peaks{label}.png")


def peaks_figure(film: Film, title: str) -> Figure | None:
    """What the cells remember of a blast at the last time; None where they do not (output.peaks)."""
    names = [name for name in PEAKS if name in film.cell_fields]
    if not names:
        return None
    (frame,) = film.frames([len(film) - 1], names)
    frame = replace(frame, particles={})
    if frame.dimensions == 1:
        figure, (body,) = headed(WIDTH, [profiles_height([frame], names)], title)
        draw_profiles(body, [frame], names=names)
    else:
        fields = field_colors([frame], names)
        sheet = Sheet(frame.aspect, len(fields), 1, False, WIDTH)
        figure, (body,) = headed(WIDTH, [sheet.height], title, frame.location)
        draw_maps(body, sheet, [frame], fields, None)
    return figure


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
    """A sheet per gauge: curves over time, profiles or maps at some times; and one of the blast at several points."""
    tables, planes = read_gauges(directory), sorted((directory / "gauges").glob("*/cells.vtkhdf.series"))
    if not tables and not planes:
        raise InputError([f"{directory}: no gauges; [gauges.NAME] in the input makes some"])
    notes = read_journal(directory)
    locations = notes.get("gauges", {})
    folder.mkdir(exist_ok=True)
    with matplotlib.rc_context(STYLE):
        points = at_points(tables)
        if len(points) > 1:
            yield _save(draw_blasts(points, title_of(notes, directory)), folder / "gauges.png")
        for name, table in tables.items():
            yield _save(draw_gauge(name, table, locations.get(name, "")), folder / f"gauge-{name}.png")
        for plane in planes:
            name = plane.parent.name
            path = folder / (f"gauge-{name}-maps.png" if name in tables else f"gauge-{name}.png")
            yield _save(draw_layer(plane.parent, name, locations.get(name, "")), path)


def draw_layer(directory: Path, name: str, location: str) -> Figure:
    """The layer of cells of a gauge at some times: maps or, where it is a row of cells, profiles."""
    frames = load_frames(directory, TIMES)
    title = f"{name}: {location}" if location else name
    lines = [line for line in map(as_line, frames) if line]
    if lines:
        names = [*PROFILES, *LOADS]
        figure, (body,) = headed(MAP_WIDTH, [profiles_height(lines, names)], title)
        draw_profiles(body, lines, names=names)
        return figure
    fields, particles = summary_colors(frames)
    fields += field_colors(frames, LOADS)
    sheet = Sheet(frames[0].aspect, len(fields), len(frames), particles is not None)
    figure, (body,) = headed(WIDTH, [sheet.height], title)
    draw_maps(body, sheet, frames, fields, particles)
    return figure
