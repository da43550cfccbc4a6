"""Fields written by 1, 2 and 4 ranks as VTK and the own readers see them; history, schedule, progress, picture."""

import json
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader

import mpi_output
from distfsi.coordinates.planar import PLANAR
from distfsi.output import progress, status
from distfsi.output.fields import FieldWriter, read_cells, read_particles, series
from distfsi.output.frames import load_frames
from distfsi.output.history import History, read_history
from distfsi.output.picture import draw_summary
from distfsi.output.scales import scaled
from distfsi.output.schedule import Every
from launch import SUPPORT
from one_rank import OneRank

SCRIPT = SUPPORT / "mpi_output.py"
RANKS = (1, 2, 4)


@pytest.fixture(scope="module")
def runs(mpiexec, tmp_path_factory) -> dict[int, Path]:
    """The directories that mpi_output.py wrote from each number of ranks."""
    directories = {ranks: tmp_path_factory.mktemp(f"ranks{ranks}") for ranks in RANKS}
    for ranks, directory in directories.items():
        mpiexec(ranks, SCRIPT, directory, seconds=120)
    return directories


def read_with_vtk(path):
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutputDataObject(0)


def arrays_of(data):
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def contents(path) -> dict:
    """All datasets and attributes of an HDF5 file by name."""
    found = {}

    def note(name, item):
        found.update({f"{name}@{key}": value for key, value in item.attrs.items()})
        if isinstance(item, h5py.Dataset):
            found[name] = item[()]

    with h5py.File(path) as file:
        file.visititems(note)
    return found


def same(a: dict, b: dict) -> bool:
    return a.keys() == b.keys() and all(np.array_equal(a[key], b[key]) for key in a)


# ---- field files -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", mpi_output.SCENES)
@pytest.mark.parametrize("ranks", RANKS)
def test_vtk_reads_the_value_of_every_cell(runs, ranks, scene):
    cells, _, lower, upper = mpi_output.SCENES[scene]
    for time, path in series(runs[ranks] / scene, "cells"):
        image = read_with_vtk(path)
        assert image.GetNumberOfCells() == np.prod(cells)
        corners = np.array(image.GetBounds()).reshape(3, 2)[: len(cells)]
        assert corners == pytest.approx(np.stack([lower, upper], axis=1), rel=1e-14)
        low, step = np.array(image.GetOrigin()), np.array(image.GetSpacing())
        counts = np.ones(3, dtype=int)
        counts[: len(cells)] = cells
        index = np.stack(np.unravel_index(np.arange(np.prod(cells)), counts[::-1]), axis=-1)[:, ::-1]
        centers = low + step * np.where(counts > 1, index + 0.5, 0.5)
        arrays = arrays_of(image.GetCellData())
        assert arrays["pressure"] == pytest.approx(mpi_output.pressure(*centers.T, time), rel=1e-12)
        assert arrays["velocity"] == pytest.approx(mpi_output.velocity(*centers.T, time), rel=1e-12, abs=1e-12)
        assert arrays_of(image.GetFieldData())["TimeValue"] == [time]


@pytest.mark.parametrize("scene", mpi_output.SCENES)
@pytest.mark.parametrize("ranks", RANKS)
def test_vtk_reads_every_particle_as_a_vertex(runs, ranks, scene):
    for time, path in series(runs[ranks] / scene, "particles"):
        points = read_with_vtk(path)
        assert points.GetNumberOfVerts() == points.GetNumberOfPoints() == 200
        position = vtk_to_numpy(points.GetPoints().GetData())
        arrays = arrays_of(points.GetPointData())
        assert sorted(arrays["id"]) == list(range(200))
        assert np.array_equal(arrays["pressure"], mpi_output.pressure(*position.T, time))
        assert np.array_equal(arrays["velocity"], mpi_output.velocity(*position.T, time))
        vertices = [points.GetCell(i).GetPointId(0) for i in range(points.GetNumberOfCells())]
        assert vertices == list(range(200))


def test_files_are_the_same_from_any_number_of_ranks(runs):
    files = sorted(path.relative_to(runs[1]) for path in runs[1].rglob("*.vtkhdf*"))
    assert len(files) == 6 * len(mpi_output.SCENES) + 4
    for ranks in (2, 4):
        assert sorted(path.relative_to(runs[ranks]) for path in runs[ranks].rglob("*.vtkhdf*")) == files
        for file in files:
            one, many = runs[1] / file, runs[ranks] / file
            if file.suffix == ".series":
                assert one.read_text() == many.read_text()
            else:
                assert same(contents(one), contents(many)), file


@pytest.mark.parametrize("scene", mpi_output.SCENES)
def test_own_readers_see_what_was_written(runs, scene):
    cells, block_cells, lower, upper = mpi_output.SCENES[scene]
    dimensions = len(cells)
    listed = series(runs[2] / scene, "cells")
    assert [time for time, _ in listed] == list(mpi_output.TIMES)
    assert [path.name for _, path in listed] == ["cells-000000.vtkhdf", "cells-000010.vtkhdf"]
    time, fields, origin, spacing = read_cells(listed[1][1])
    assert time == mpi_output.TIMES[1]
    assert fields["pressure"].shape == (1,) * (3 - dimensions) + cells[::-1]
    assert fields["velocity"].shape == (*fields["pressure"].shape, 3)
    assert origin[:dimensions] == pytest.approx(np.array(lower))
    assert (origin + spacing * fields["pressure"].shape[::-1])[:dimensions] == pytest.approx(np.array(upper))
    time, columns = read_particles(series(runs[2] / scene, "particles")[1][1])
    assert time == mpi_output.TIMES[1]
    assert columns["position"].shape == columns["velocity"].shape == (200, 3)
    assert columns["id"].dtype == np.int64


def test_a_block_is_one_chunk(runs):
    with h5py.File(runs[4] / "space" / "cells-000000.vtkhdf") as file:
        assert file["VTKHDF/CellData/pressure"].chunks == (4, 8, 8)
        assert file["VTKHDF/CellData/velocity"].chunks == (4, 8, 8, 3)


@pytest.mark.parametrize("ranks", RANKS)
def test_no_particles_and_ranks_without_particles(runs, ranks):
    ((_, none),) = series(runs[ranks] / "no_particles", "particles")
    ((time, few),) = series(runs[ranks] / "few_particles", "particles")
    assert read_with_vtk(none).GetNumberOfPoints() == 0
    assert read_particles(none)[1]["velocity"].shape == (0, 3)
    columns = read_particles(few)[1]
    assert read_with_vtk(few).GetNumberOfVerts() == len(columns["id"]) > 0
    assert np.array_equal(columns["pressure"], mpi_output.pressure(*columns["position"].T, time))
    assert series(runs[ranks] / "no_particles", "cells") == []


@pytest.fixture
def small_blocks():
    grid = SimpleNamespace(
        dimensions=2, cells=(6, 3, 1), lower=(0.0, 0.0, 0.0), spacing=(1.0, 1.0, 1.0), coordinates=PLANAR
    )
    return SimpleNamespace(grid=grid, block_cells=(4, 3, 1), origin=np.array([[0, 0, 0], [4, 0, 0]]))


def test_a_run_that_dies_while_writing_leaves_the_listed_files_whole(tmp_path, small_blocks):
    communicator = OneRank()
    writer = FieldWriter(tmp_path, small_blocks, communicator)
    cells = {"a": np.ones((2, 1, 3, 4)), "b": np.ones((2, 1, 3, 4))}
    writer.write(0, 0.0, cells, None)
    communicator.dies = True
    with pytest.raises(KeyboardInterrupt):
        writer.write(1, 1.0, cells, None)
    assert (tmp_path / "cells-000001.vtkhdf.tmp").exists()
    ((time, path),) = series(tmp_path, "cells")
    assert time == 0.0
    assert np.array_equal(read_cells(path)[1]["b"], np.ones((1, 3, 6)))
    assert read_with_vtk(path).GetNumberOfCells() == 18


def test_a_new_run_removes_the_files_of_the_old_one(tmp_path, small_blocks):
    FieldWriter(tmp_path, small_blocks, OneRank()).write(3, 0.0, {"a": np.ones((2, 1, 3, 4))}, None)
    for name in ("cells-000004.vtkhdf.tmp", "cells-000005.vtkhdf", "cells-of-mine.vtkhdf"):
        (tmp_path / name).write_text("neither listed nor in a manifest")
    FieldWriter(tmp_path, small_blocks, OneRank())
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "cells-000004.vtkhdf.tmp",
        "cells-000005.vtkhdf",
        "cells-of-mine.vtkhdf",
    ]


def test_the_index_is_what_paraview_expects(tmp_path, small_blocks):
    writer = FieldWriter(tmp_path, small_blocks, OneRank())
    for number, time in ((0, 0.0), (1, 0.1)):
        writer.write(number, time, None, {"position": np.zeros((2, 3))})
    index = json.loads((tmp_path / "particles.vtkhdf.series").read_text())
    assert index == {
        "file-series-version": "1.0",
        "files": [
            {"name": "particles-000000.vtkhdf", "time": 0.0},
            {"name": "particles-000001.vtkhdf", "time": 0.1},
        ],
    }


def test_not_a_number_survives(tmp_path, small_blocks):
    values = np.arange(24.0).reshape(2, 1, 3, 4)
    values[0, 0, 1, 2] = np.nan
    FieldWriter(tmp_path, small_blocks, OneRank()).write(0, 0.0, {"a": values}, None)
    field = read_cells(tmp_path / "cells-000000.vtkhdf")[1]["a"]
    assert np.argwhere(np.isnan(field)).tolist() == [[0, 1, 2]]
    assert np.array_equal(field[0, :, 4:], values[1, 0, :3, :2])


# ---- history ---------------------------------------------------------------------------------------------------------


def test_history_gives_back_every_bit(tmp_path):
    path = tmp_path / "out" / "history.csv"
    numbers = np.array([0.1, np.pi * 1e-9, np.nextafter(1e30, 0), np.nan, 5e-324])
    history = History(path, ["step", "time [s]", "limited by"], OneRank())
    for step, number in enumerate(numbers):
        history.append({"limited by": "cell (3, 4), sound", "time [s]": number, "step": step})
        assert len(read_history(path)["step"]) == step + 1
    columns = read_history(path)
    assert np.array_equal(columns["time [s]"], numbers, equal_nan=True)
    assert columns["limited by"] == ["cell (3, 4), sound"] * 5
    assert path.read_text().splitlines()[1] == '0,0.1,"cell (3, 4), sound"'


def test_history_drops_a_row_cut_short(tmp_path):
    path = tmp_path / "history.csv"
    path.write_text("a,b\n1.0,2.0\n3.0,4")
    assert read_history(path) == {"a": [1.0], "b": [2.0]}


def test_history_refuses_other_columns(tmp_path):
    history = History(tmp_path / "history.csv", ["a"], OneRank())
    with pytest.raises(KeyError):
        history.append({"a": 1.0, "b": 2.0})


@pytest.mark.parametrize("ranks", RANKS)
def test_only_rank_0_writes_the_history(runs, ranks):
    assert read_history(runs[ranks] / "history.csv") == {"time [s]": [0.1], "limited by": ["rank 0"]}


# ---- schedule --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("interval", "times", "due"),
    [
        (1.0, [0.0, 0.4, 0.9, 1.1, 1.9, 2.0, 2.1], [0.0, 1.1, 2.0]),
        (1.0, [0.0, 3.5, 3.9, 4.2], [0.0, 3.5, 4.2]),
        (0.1, [0.0, 0.1, 0.2, 0.3, 0.6, 0.7], [0.0, 0.1, 0.2, 0.3, 0.6, 0.7]),
        (0.0, [0.0, 1.0, 2.0], [0.0]),
        (1e-7, [5e-7, 5.5e-7], [5e-7]),
    ],
)
def test_schedule(interval, times, due):
    every = Every(interval)
    assert [time for time in times if every.due(time)] == due


# ---- progress --------------------------------------------------------------------------------------------------------


@pytest.fixture
def wall_clock(monkeypatch):
    """A clock that the test moves by hand."""
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(progress.clock, "monotonic", lambda: now.seconds)
    return now


def test_progress_prints_a_line_every_few_seconds(capsys, wall_clock):
    report = progress.Progress(1e-3, OneRank())
    wall_clock.seconds += 60.0  # compiling
    for step in range(1, 82):
        report.update(step, 1e-6 * step, 1e-6, "sound in cell (3, 4)", "drift 1e-15")
        wall_clock.seconds += 0.125
    report.finish("done")
    first, second, last = capsys.readouterr().out.splitlines()
    assert first.startswith("step 41  t 41 µs of 1 ms  dt 1 µs (sound in cell (3, 4))  8 steps/s  ETA 1 min 59 s")
    assert second.startswith("step 81  t 81 µs") and second.endswith("drift 1e-15")
    assert last == "done"


def test_status_is_in_a_file_while_a_run_goes_on(tmp_path, wall_clock):
    """Nothing before the run has its directory; compiling and steps every few seconds; the end in any case."""
    noted = status.Status(tmp_path, OneRank())
    report = progress.Progress(1e-3, OneRank(), noted)
    report.compiling(1)
    assert status.read_status(tmp_path) == {} and not list(tmp_path.iterdir())
    with suppress(KeyError), noted:
        assert status.read_status(tmp_path)["status"] == "starting"
        wall_clock.seconds += 6.0
        report.compiling(2)
        assert status.read_status(tmp_path)["status"] == "compiling kernel 2, once for this kind of scene"
        report.update(1, 1e-6, 1e-6, "start")
        wall_clock.seconds += 60.0
        report.update(481, 481e-6, 1e-6, "fluid CFL")
        lines = status.read_status(tmp_path)
        assert (lines["status"], lines["step"], lines["time"]) == ("running", "481", "481 µs of 1 ms (48 %)")
        assert (lines["time step"], lines["left"]) == ("1 µs, limited by fluid CFL", "1 min 04 s")
        assert lines["memory"].endswith(" MB on rank 0")
        raise KeyError
    ended = status.read_status(tmp_path)
    assert (ended["status"], ended["step"]) == ("failed", "481")


def test_progress_is_silent_on_other_ranks(capsys, wall_clock):
    communicator = OneRank()
    communicator.rank = 1
    report = progress.Progress(1.0, communicator)
    for step in (1, 2):
        report.update(step, 0.25 * step, 0.25, "end")
        wall_clock.seconds += 60.0
    report.finish("done")
    assert capsys.readouterr().out == ""


def test_progress_shows_a_bar_on_a_terminal(capsys, monkeypatch, wall_clock):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    report = progress.Progress(1.0, OneRank())
    for step in (1, 2):
        report.update(step, 0.25 * step, 0.25, "end")
        wall_clock.seconds += 1.0
    report.finish("done")
    shown = capsys.readouterr().out
    assert "step 2" in shown and shown.endswith("done\n")


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (1.25e-6, "1.25 µs"), (2.0, "2 s"), (9.99999e-4, "1 ms"), (3e-12, "0.003 ns")],
)
def test_times_have_a_fitting_unit(seconds, text):
    assert progress.format_time(seconds) == text


@pytest.mark.parametrize(("seconds", "text"), [(12.4, "12 s"), (95.0, "1 min 35 s"), (4000.0, "1 h 06 min")])
def test_durations(seconds, text):
    assert progress.format_duration(seconds) == text


# ---- picture ---------------------------------------------------------------------------------------------------------

COLUMNS = (
    "step",
    "time [s]",
    "time step [s]",
    "limited by",
    "fluid energy [J]",
    "solid kinetic energy [J]",
    "drift energy [J]",
)


def finish_run(directory):
    """Put a history next to the field files."""
    history = History(directory / "history.csv", COLUMNS, OneRank())
    for step in range(3):
        history.append(
            dict(zip(COLUMNS, (step, 1e-6 * step, 1e-6 * min(step, 1), "sound", 9.0 - step, step, 0.0), strict=True))
        )


@pytest.fixture
def figures(monkeypatch):
    """The figures saved by the test."""
    saved = []
    save = Figure.savefig
    monkeypatch.setattr(
        Figure, "savefig", lambda figure, *args, **kw: (saved.append(figure), save(figure, *args, **kw))
    )
    return saved


def assert_nothing_overlaps(figure):
    """All that belongs to a panel, its labels included, is on the sheet and apart from the other panels."""
    boxes = [axes.get_tightbbox() for axes in figure.findobj(Axes)]
    sheet = figure.bbox
    for i, box in enumerate(boxes):
        assert sheet.x0 <= box.x0 < box.x1 <= sheet.x1 and sheet.y0 <= box.y0 < box.y1 <= sheet.y1
        for other in boxes[:i]:
            assert min(box.x1, other.x1) <= max(box.x0, other.x0) or min(box.y1, other.y1) <= max(box.y0, other.y0)


@pytest.mark.parametrize("scene", [*mpi_output.SCENES, "few_particles"])
def test_a_picture_has_no_overlapping_labels(runs, figures, scene):
    finish_run(runs[2] / scene)
    assert draw_summary(runs[2] / scene).read_bytes().startswith(b"\x89PNG")
    assert_nothing_overlaps(figures[0])


def write_bar(directory, blocks, dimensions, fluid):
    """Field files of five times of a bar of 20 x 4 particles (or 20 in one dimension), with a blast beside it."""
    writer = FieldWriter(directory, blocks, OneRank())
    y, x = np.mgrid[: 4 if dimensions == 2 else 1, :20] * 0.1
    position = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    for number in range(5):
        pressure = np.geomspace(1e5, 1e10 / (1 + number), 24).reshape(2, 1, 3, 4)
        pressure[0, 0, 0, 0] = np.nan
        particles = {
            "position": position * (1.0 + 0.1 * number),
            "velocity": position,
            "plastic_strain": number * position[:, 0],
        }
        writer.write(number, 1e-6 * number, {"pressure": pressure} if fluid else None, particles)
    finish_run(directory)


@pytest.mark.parametrize(("dimensions", "fluid"), [(1, False), (2, False), (2, True)])
def test_solids_are_drawn(tmp_path, small_blocks, figures, dimensions, fluid):
    write_bar(tmp_path, small_blocks, dimensions, fluid)
    draw_summary(tmp_path)
    assert_nothing_overlaps(figures[0])
    discs = figures[0].findobj(EllipseCollection)
    assert [len(d.get_offsets()) for d in discs] == ([] if dimensions == 1 else [80] * 4)
    assert bool(figures[0].findobj(AxesImage)) is fluid


def test_frames_show_a_plane_of_three_dimensions(runs):
    """Of particles all over 1.3 x 1.1 x 0.9, that along x and z in the middle."""
    first, last = load_frames(runs[2] / "space", 4)
    assert (first.time, last.time) == mpi_output.TIMES
    assert first.extent == pytest.approx((0.0, 1.3, 3.0, 3.9))
    z = 3.0 + (np.arange(9)[:, None] + 0.5) * 0.1
    assert first.cells["pressure"] == pytest.approx(mpi_output.pressure(first.cell_centers, -0.45, z, 0.0), rel=1e-12)
    near = np.abs(first.particles["position"][:, 1] + 0.45) <= 0.5 * first.spacing + 1e-9
    assert near.all() and 0 < near.size < 200


def test_a_picture_needs_field_files(tmp_path):
    with pytest.raises(FileNotFoundError, match="no field files"):
        draw_summary(tmp_path)


@pytest.mark.parametrize(
    ("unit", "largest", "scale"),
    [("Pa", 3e9, (1e9, "GPa")), ("m", 0.05, (1e-3, "mm")), ("s", 0.0, (1.0, "s")), ("kg/m³", 8e3, (1.0, "kg/m³"))],
)
def test_units_take_a_fitting_prefix(unit, largest, scale):
    assert scaled(unit, largest) == scale
