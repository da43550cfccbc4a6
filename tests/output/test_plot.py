"""Pictures and words about the results of runs, from the files that runs leave."""

import io
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage, imread
from PIL import Image

from distfsi.commands.line import main
from distfsi.errors import Diverged, InputError
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output import fields, frames
from distfsi.output.fields import read_cells, read_layer, series
from distfsi.output.frames import Film, fullest_plane, telling_plane
from distfsi.output.info import describe
from distfsi.output.journal import Journal, read_journal
from distfsi.output.plot import plot
from distfsi.output.tables import draw_blasts, draw_gauge
from distfsi.output.timeline import draw_history, verdict
from distfsi.output.watch import sparkline
from distfsi.scene import load
from launch import ROOT

SPACE = """
title = "A ball of gas and a plate"
[domain]
lower = [0, 0, -0.5]
upper = [1.6, 0.8, 0.5]
cells = [16, 8, 10]
[time]
end = 1
maximum_steps = 3
[fluid.phases]
gas = {eos = "ideal_gas", gamma = 1.4}
[[fluid.regions]]
phase = "gas"
density = 1
pressure = 1
[[fluid.regions]]
phase = "gas"
density = 2
pressure = 10
shape = {kind = "ball", center = [0.4, 0.4, 0], radius = 0.25}
[solid.bodies.plate]
shape = {kind = "box", lower = [1.0, 0.2, -0.2], upper = [1.2, 0.6, 0.2]}
spacing = 0.05
density = 10
eos = {kind = "linear", bulk_modulus = 100}
strength = "none"
[gauges]
point = {kind = "point", position = [0.8, 0.4, 0]}
line = {kind = "line", from = [0.1, 0.4, 0], to = [1.5, 0.4, 0], points = 9, every = 1e-9}
cut = {kind = "plane", axis = "x", position = 0.4, every = 0.5}
body = {kind = "body", body = "plate"}
"""


@pytest.fixture(scope="module")
def space(tmp_path_factory):
    """Output directory of a short coupled run in three dimensions, with gauges."""
    folder = tmp_path_factory.mktemp("space")
    (folder / "space.toml").write_text(SPACE)
    run(load(folder / "space.toml", [f'output.directory="{folder}/out"']), Communicator(), threads=1)
    return folder / "out"


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    """Output directory of Sod's tube."""
    folder = tmp_path_factory.mktemp("line")
    changes = [f'output.directory="{folder}"', "output.fields_every=0.1", "domain.cells=50"]
    run(load(ROOT / "inputs" / "sod.toml", changes), Communicator(), threads=1)
    return folder


@pytest.fixture
def figures(monkeypatch):
    """The figures saved by the test."""
    saved, save = [], Figure.savefig

    def note(figure, *arguments, **options):
        saved.append(figure)
        save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", note)
    return saved


def assert_tidy(figure):
    """Panels with labels, on the sheet, apart from each other."""
    panels = [axes for axes in figure.findobj(Axes) if axes.get_visible()]
    boxes = [axes.get_tightbbox() for axes in panels]
    sheet = figure.bbox
    for i, box in enumerate(boxes):
        assert sheet.x0 <= box.x0 < box.x1 <= sheet.x1 and sheet.y0 <= box.y0 < box.y1 <= sheet.y1
        for other in boxes[:i]:
            assert min(box.x1, other.x1) <= max(box.x0, other.x0) or min(box.y1, other.y1) <= max(box.y0, other.y0)
    assert any(axes.get_xlabel() for axes in panels) and any(axes.get_ylabel() for axes in panels)


# ---- plot ------------------------------------------------------------------------------------------------------------


def test_profiles_of_all_times_on_the_same_axes(line, figures):
    paths = list(plot(line))
    names = [f"profiles-{number:06d}.png" for number in range(3)]
    assert [path.name for path in paths] == [*names, "history.png"]
    assert all(imread(path).ndim == 3 for path in paths)
    for figure in figures:
        assert_tidy(figure)
    limits = [[axes.get_ylim() for axes in figure.axes] for figure in figures[:3]]
    assert limits[0] == limits[1] == limits[2]


def test_maps_of_a_slice_with_particles(space, figures):
    paths = list(plot(space, field="density", particles="speed", slice=(1, 0.35), every=2))
    assert [path.name for path in paths] == ["density-speed-y=0.35-000000.png", "history.png"]
    (image,) = figures[0].findobj(AxesImage)[:1]
    _, fields, _, _ = read_cells(series(space, "cells")[0][1])
    shown, there = image.get_array().filled(np.nan), np.isfinite(fields["density"][:, 3])
    assert np.array_equal(shown[there], fields["density"][:, 3][there])
    assert not there.all() and np.isfinite(shown).sum() > there.sum()  # no white blocks between particles and fluid
    first = figures[0].axes[0]
    assert (first.get_xlabel(), first.get_ylabel()) == ("x [m]", "z [m]")
    assert image.get_extent() == pytest.approx([0.0, 1.6, -0.5, 0.5])
    for figure in figures:
        assert_tidy(figure)


def test_the_frame_nearest_to_a_time(line, figures):
    assert [path.name for path in plot(line, time=0.12)] == ["profiles-000001.png"]


def test_a_movie_holds_all_frames(space, line):
    paths = list(plot(space, movie=True))
    assert paths[2].name == "pressure.gif"
    with Image.open(paths[2]) as movie:
        assert movie.n_frames == 2
    assert list(plot(line, movie=True))[3].name == "profiles.gif"


def test_gauges(space, figures):
    paths = [path.name for path in plot(space, gauges=True)]
    assert paths == ["gauge-body.png", "gauge-line.png", "gauge-point.png", "gauge-cut.png"]
    heads = [figure.subfigs[0].texts[0].get_text() for figure in figures]
    assert heads[0] == "body: body 'plate'" and heads[2:] == ["point: (0.8, 0.4, 0) m", "cut: x = 0.4 m"]
    for figure in figures[:3]:
        assert_tidy(figure)
    assert len(figures[1].axes[0].lines) == 4  # times of the line
    assert {"y [m]", "z [m]"} <= {label for axes in figures[3].axes for label in (axes.get_xlabel(), axes.get_ylabel())}


def test_a_gauge_shows_what_varies_and_tells_the_rest(figures):
    """Overpressure and impulse come first; a pressure that is overpressure beside a constant is drawn once."""
    time, wave = np.linspace(0.0, 1e-3, 9), 1e6 * np.sin(np.linspace(0.0, 3.0, 9))
    table = {
        "time [s]": time,
        "pressure [Pa]": 101325.0 + wave,
        "density [kg/m3]": np.full(9, 1.25),
        "velocity_x [m/s]": wave / 400.0,
        "velocity_y [m/s]": 0.0 * wave,
        "volume_fraction": np.full(9, np.nan),
        "overpressure [Pa]": wave,
        "impulse [Pa s]": np.cumsum(wave) * 1e-4,
    }
    figure = draw_gauge("wall", table, "x = 1 m")
    figure.savefig(io.BytesIO())
    labels = [axes.get_ylabel() for axes in figure.findobj(Axes) if axes.get_visible()]
    assert labels == ["overpressure [kPa]", "impulse [Pa s]", "velocity [m/s]"]
    assert [text.get_text() for text in figure.subfigs[0].texts] == ["wall: x = 1 m", "0 s to 1 ms"]
    (constants,) = figure.subfigs[1].texts
    assert (
        constants.get_text()
        == "constant: ambient pressure 101.3 kPa, density 1.25 kg/m3, volume fraction without values"
    )
    assert_tidy(figure)


def test_the_blast_at_points_decades_apart_is_logarithmic():
    time = np.linspace(0.0, 1e-3, 9)
    tables = {
        name: {"time [s]": time, "overpressure [Pa]": peak * time, "impulse [Pa s]": peak * time**2}
        for name, peak in (("near", 1e9), ("far", 1e5))
    }
    scales = [axes.get_yscale() for axes in draw_blasts(tables, "Blast").findobj(Axes)]
    assert scales == ["log", "log"]
    alike = {"near": tables["near"], "as_near": tables["near"]}
    assert [axes.get_yscale() for axes in draw_blasts(alike, "Blast").findobj(Axes)] == ["linear", "linear"]


HISTORY = {
    "step": np.arange(4.0),
    "time [s]": np.arange(4.0),
    "time step [s]": np.array([0.0, 1.0, 0.9, 0.5]),
    "limited by": ["start", "fluid CFL, 1 m/s in cell (1, 2)", "sound of solid particle 3 of body 'a'", "end time"],
    "fluid energy [J]": np.array([5.0, 4.0, 3.0, 2.0]),
    "left energy [J]": np.array([0.0, 1.0, 2.0, 3.0]),
    "drift energy": np.array([0.0, 1e-15, -2e-15, 1e-15]),
}


def test_history_tells_what_is_fine_and_draws_what_is_not():
    """Energies, overpressure where a gauge has it, and the step by what limits it; drifts only beyond round-off."""

    def labels(history, gauges):
        figure = Figure(figsize=(12.0, 3.9))
        draw_history(figure, history, gauges)
        return [axes.get_ylabel() for axes in figure.axes], figure

    blast = {"time [s]": np.arange(4.0), "overpressure [Pa]": np.array([0.0, 0.0, 2e6, 1e6])}
    shown, figure = labels(HISTORY, {"wall": blast})
    assert shown == ["change of energy [J]", "overpressure [MPa]", "time step [s]"]
    reasons = [text.get_text() for text in figure.axes[2].get_legend().get_texts()]
    assert reasons == ["fluid CFL", "sound of solid"]
    assert verdict(HISTORY) == "3 steps; mass, momentum and energy are conserved (to 2.0e-15)"
    leaking = HISTORY | {"drift energy": np.array([0.0, 1e-5, 2e-5, 3e-5])}
    assert labels(leaking, {})[0] == ["change of energy [J]", "time step [s]", "relative drift of totals"]
    assert verdict(leaking) == "3 steps; totals drift (to 3.0e-05)"


def test_peaks_are_drawn_where_cells_remember_them(tmp_path, figures):
    changes = [f'output.directory="{tmp_path}"', "domain.cells=50", "output.fields_every=0"]
    changes.append("output.peaks={ambient_pressure=0.1, arrival_overpressure=0.1}")
    run(load(ROOT / "inputs" / "sod.toml", changes), Communicator(), threads=1)
    assert "peaks.png" in [path.name for path in plot(tmp_path)]
    labels = [axes.get_ylabel() for axes in figures[-2].findobj(Axes)]
    assert labels == ["peak overpressure [Pa]", "positive impulse [Pa s]", "arrival time [ms]"]
    assert figures[-2].subfigs[0].texts[0].get_text() == "Sod's shock tube"


@pytest.mark.parametrize(("low", "at"), [(-8.5, 0.0), (0.5, 0.5)])
def test_particles_alone_are_cut_where_most_of_them_are(low, at):
    """A round bar, and the quarter of one above its symmetry planes."""
    steps = np.arange(low, 9.0)
    grid = np.stack([axis.ravel() for axis in np.meshgrid(np.arange(9.0), steps, steps)], axis=1)
    bar = grid[np.hypot(grid[:, 1], grid[:, 2]) < 8.6]
    normal, found = fullest_plane({"position": bar})
    assert normal == 2 and abs(found - at) <= 0.5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"field": "presure"}, "--field presure: no such field; there are density, pressure, velocity"),
        ({"particles": "colour"}, "--particles colour: no such field"),
        ({"slice": (2, 0.7)}, "outside of the domain along z"),
    ],
)
def test_what_cannot_be_drawn_is_told(space, options, words):
    with pytest.raises(InputError, match=words):
        list(plot(space, **options))


def test_what_is_not_there_is_told(tmp_path, line):
    for call in (lambda: list(plot(tmp_path)), lambda: describe(tmp_path), lambda: list(plot(line, gauges=True))):
        with pytest.raises(InputError, match="no "):
            call()
    with pytest.raises(InputError, match="only three dimensions"):
        list(plot(line, slice=(0, 0.5)))
    assert not list(tmp_path.iterdir())


def test_plot_by_the_command_line(line, tmp_path, capsys):
    main(["plot", str(line), "--time", "100 ms"])
    assert capsys.readouterr().out == f"{line}/plots/profiles-000001.png\n"
    for wrong in (["--time", "1 kg"], ["--slice", "w=1"], ["--every", "0"], ["--time", "1", "--every", "2"]):
        with pytest.raises(SystemExit) as ended:
            main(["plot", str(line), *wrong])
        assert ended.value.code == 2
    command = [sys.executable, "-m", "distfsi", "plot", str(tmp_path)]
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert (told.returncode, told.stderr) == (2, f"{tmp_path}: no field files in {tmp_path}\n")


# ---- frames ----------------------------------------------------------------------------------------------------------


def test_a_layer_is_that_of_the_whole_field(space):
    path = series(space, "cells")[-1][1]
    time, fields, lower, spacing = read_cells(path)
    for axis, (place, layer) in enumerate([(0.81, 8), (0.01, 0), (0.49, 9)]):
        found, layers, (low, high) = read_layer(path, axis, place, ["pressure", "velocity"])
        assert found == time
        for name in ("pressure", "velocity"):
            assert np.array_equal(layers[name], np.take(fields[name], layer, axis=2 - axis), equal_nan=True)
        assert low[axis] == pytest.approx(lower[axis] + layer * spacing[axis])
        assert high[axis] == pytest.approx(low[axis] + spacing[axis])
    with pytest.raises(KeyError):
        read_layer(path, 2, None, ["nothing"])


def test_large_layers_are_thinned_out(space, monkeypatch):
    path = series(space, "cells")[0][1]
    _, whole, corners = read_layer(path, 1, 0.3)
    monkeypatch.setattr(fields, "LARGEST_LAYER", 7)  # of 16 x 10 cells
    _, thin, same_corners = read_layer(path, 1, 0.3)
    for name, values in thin.items():
        assert np.array_equal(values, whole[name][::2, ::3], equal_nan=True)
    assert np.array_equal(corners, same_corners)


def test_particles_of_a_slice_lie_near_it(space):
    film = Film(space, (1, 0.3))
    assert film.cell_fields == ["density", "pressure", "velocity", "overpressure"]
    (over,) = film.frames([0], ["overpressure", "pressure"])
    assert np.array_equal(over.cells["overpressure"], over.cells["pressure"] - 1.0, equal_nan=True)
    assert "von_mises" in film.particle_fields
    (frame,) = film.frames([0])
    assert frame.axes == (0, 2)
    assert 0 < len(frame.particles["position"]) < 4 * 8 * 8
    assert np.abs(frame.particles["position"][:, 1] - 0.3).max() <= 0.5 * frame.spacing + 1e-12


@pytest.mark.parametrize(
    ("lower", "upper", "plane"),
    [
        ((0.0, 0.0, 0.6), (0.7, 0.7, 0.65), (1, 0.05)),  # a quarter of a slab
        ((0.2, 0.2, 0.6), (0.8, 0.8, 0.65), (1, 0.5)),
        ((0.4, 0.45, 0.0), (0.5, 0.65, 0.9), (1, 0.55)),  # a column on the floor
        ((0.45, 0.4, 0.0), (0.65, 0.5, 0.9), (0, 0.55)),
        ((-0.5, -0.5, -0.5), (2.0, 2.0, 2.0), (1, 0.5)),  # beyond the domain
    ],
)
def test_the_plane_that_shows_most_of_the_bodies(monkeypatch, lower, upper, plane):
    corners = {"position": np.array([lower, upper])}
    monkeypatch.setattr(frames, "read_grid", lambda path: (np.full(3, 10), np.zeros(3), np.full(3, 0.1)))
    monkeypatch.setattr(frames, "read_particles", lambda path: (0.0, corners))
    assert telling_plane(Path("cells"), Path("particles")) == pytest.approx(plane)


# ---- info ------------------------------------------------------------------------------------------------------------


def test_info_tells_what_a_folder_holds(space, capsys):
    main(["info", str(space)])
    text = capsys.readouterr().out
    assert text.startswith("A ball of gas and a plate\n  ended      done after ")
    assert "on 1 rank(s) of 1 thread(s)" not in text and "1 rank(s) of 1 thread(s)" in text
    assert "after 3 steps" in text
    assert "cells      2 time(s) from 0 s to " in text
    assert "density, pressure, velocity" in text
    assert "gauges     body, cut, line, point" in text


@pytest.mark.parametrize(
    ("error", "status", "told"),
    [
        (None, "done", "done after"),
        (Diverged("no valid state\nlast files"), "diverged", "ended by an invalid state after"),
        (RuntimeError("broken"), "failed", "ended by an error after"),
    ],
)
def test_the_journal_notes_how_a_run_ended(tmp_path, error, status, told):
    scene = load(ROOT / "inputs" / "sod.toml")
    try:
        with Journal(tmp_path, scene, Communicator(), 3, {"stage": 3.0004, "output": 1.0}):
            assert read_journal(tmp_path)["status"] == "running"
            assert "still running" in describe(tmp_path)
            if error:
                raise error
    except type(error or KeyError()):
        pass
    notes = json.loads((tmp_path / "run.json").read_text())
    assert (notes["status"], notes["title"], notes["threads per rank"]) == (status, scene.title, 3)
    assert told in describe(tmp_path)
    assert notes["seconds by part"] == {"stage": 3.0, "output": 1.0}
    assert "time in    stage 75 %, output 25 %" in describe(tmp_path)
    if error:
        assert f"because    {notes['message'].splitlines()[0]}" in describe(tmp_path)


# ---- watch -----------------------------------------------------------------------------------------------------------


def test_watch_says_how_a_run_went(space, capsys):
    """Off a terminal once: the run's own lines, the budget, and gauges as sparklines."""
    main(["watch", str(space)])
    shown = dict(re.split(r"\s{2,}", line, maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert (shown["run"], shown["status"]) == ("A ball of gas and a plate", "done")
    assert shown["budget"].startswith("3 steps; mass, momentum and energy are conserved")
    assert re.fullmatch(r"[▁-█]{4} now -?\S+, peak \S+ Pa", shown["gauge point"])
    with pytest.raises(InputError, match=r"no run has left its run\.json there"):
        main(["watch", str(space / "gauges")])


def test_a_sparkline_keeps_peaks():
    values = np.zeros(400)
    values[123] = 8.0
    assert sparkline(values, 8) == "▁▁█▁▁▁▁▁"
    assert sparkline(np.linspace(0.0, 7.0, 8)) == "▁▂▃▄▅▆▇█"
    assert sparkline(np.ones(3)) == "▁▁▁"
