"""The pictures of a report, each as the bytes of a PNG file with a text for those who do not see it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from distfsi.output.frames import Film
from distfsi.output.history import read_history
from distfsi.output.journal import read_journal
from distfsi.output.panels import WIDTH, grid_of_panels, headed
from distfsi.output.picture import STYLE, Overview, remark, title_of
from distfsi.output.plot import draw_layer, peaks_figure
from distfsi.output.progress import format_time
from distfsi.output.scales import largest, scaled
from distfsi.output.tables import at_points, draw_blasts, draw_gauge, read_gauges
from distfsi.output.timeline import HEIGHT, draw_history

RESOLUTION = 90  # dots per inch
GAUGES = 12  # that get a picture of their own, at most
BINS = 20


@dataclass(frozen=True)
class Picture:
    """kind: "fields", "peaks", "blast", "gauge", "history" or "fragments"; text: what it shows, in words."""

    kind: str
    text: str
    png: bytes


def sheets(directory: Path) -> Iterator[Picture]:
    """The pictures of the run in a directory, as far as its files allow."""
    notes, tables = read_journal(directory), read_gauges(directory)
    title, locations = title_of(notes, directory), notes.get("gauges", {})
    with matplotlib.rc_context(STYLE):
        if any((directory / f"{kind}.vtkhdf.series").exists() for kind in ("cells", "particles")):
            yield _fields(directory, title)
            peaks = peaks_figure(Film(directory), title)
            if peaks is not None:
                yield _picture("peaks", "Peak overpressure, impulse and arrival of the blast in the cells", peaks)
        points = at_points(tables)
        if len(points) > 1:
            yield _picture("blast", "Overpressure and impulse over time at all gauges", draw_blasts(points, title))
        for name, table in list(tables.items())[:GAUGES]:
            figure = draw_gauge(name, table, locations.get(name, ""))
            yield _picture("gauge", f"Gauge {name}, {locations.get(name, '')}: its quantities over time", figure)
        for path in sorted((directory / "gauges").glob("*/cells.vtkhdf.series")):
            name = path.parent.name
            figure = draw_layer(path.parent, name, locations.get(name, ""))
            yield _picture("gauge", f"Gauge {name}, {locations.get(name, '')}: maps at some times", figure)
        if (directory / "history.csv").exists():
            figure, (body,) = headed(WIDTH, [HEIGHT], title)
            draw_history(body, read_history(directory / "history.csv"), tables)
            yield _picture("history", "Change of energies, and the time step by what limits it, over time", figure)


def draw_fragments(mass: np.ndarray, speed: np.ndarray, size: np.ndarray, per: str) -> Picture:
    """How many fragments are heavier than a mass [kg `per`], and how many have which size [m] and speed [m/s]."""
    with matplotlib.rc_context(STYLE):
        figure, (body,) = headed(WIDTH, [3.4], f"{len(mass)} fragments")
        heavier, sizes, speeds = grid_of_panels(body, 1, 3, (0.9, 0.3, 0.6, 0.3), (0.9, 0.0))[0]
        heavier.step(np.sort(mass)[::-1], np.arange(1, len(mass) + 1), where="post")
        heavier.set(xscale="log", xlabel=f"mass [kg{per}]", ylabel="fragments at least as heavy")
        heavier.xaxis.set_minor_formatter(NullFormatter())
        length, metres = scaled("m", largest([size]))
        sizes.hist(size / length, BINS)
        sizes.set(xlabel=f"size [{metres}]", ylabel="fragments")
        speeds.hist(speed, BINS)
        speeds.set(xlabel="speed [m/s]", ylabel="fragments")
        for panel in (heavier, sizes, speeds):
            panel.grid(alpha=0.3)
        return _picture("fragments", "Mass, size and speed of the fragments", figure)


def _fields(directory: Path, title: str) -> Picture:
    results = Overview.of(directory)
    figure, (body,) = headed(WIDTH, [results.height], title, remark(results.frames, read_journal(directory)))
    results.draw(body)
    times = ", ".join(format_time(frame.time) for frame in results.frames)
    return _picture("fields", f"Fields of cells and particles at t = {times}", figure)


def _picture(kind: str, text: str, figure: Figure) -> Picture:
    file = io.BytesIO()
    figure.savefig(file, dpi=RESOLUTION, format="png")
    return Picture(kind, text.replace(", :", ":"), file.getvalue())
