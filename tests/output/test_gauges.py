"""Gauges and the fields that cells remember, against exact answers; and the same files on any number of ranks."""

from copy import deepcopy
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from distfsi.coupling.kernels.cells import COVERED
from distfsi.device.interface import DualArray
from distfsi.diagnostics.gauges import GaugeRecorder
from distfsi.diagnostics.sampling import FluidSampler
from distfsi.diagnostics.schlieren import schlieren
from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.gauges import Gauge, TableProbe, each_step
from distfsi.mesh.communicator import Communicator
from distfsi.output.fields import read_cells, read_particles, series
from distfsi.output.history import read_history
from distfsi.scene import load
from distfsi.scene.law_tables import table_of
from distfsi.simulation import Simulation
from distfsi.solid.fields import cauchy_stress
from launch import ROOT, run_ranks

SOD, TUBE = ROOT / "inputs/sod.toml", ROOT / "inputs/steel_tube_full.toml"
STAR, SHOCK, CONTACT = 0.30313018, 1.75215573, 0.92745262  # Toro, Riemann Solvers, table 4.3
DENSITIES = 0.42631943, 0.26557371  # behind the contact, behind the shock
CELL = 1.0 / 400.0

# ---- Sod's tube, exactly known ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sod(tmp_path_factory):
    """Directory of Sod's tube with a point at 0.65, a line, and the peaks above the pressure on the right."""
    directory = tmp_path_factory.mktemp("sod")
    words = [
        f'output.directory="{directory}"',
        "gauges.point={kind='point', position=0.65}",
        "gauges.line={kind='line', from=0.7, to=0.8, points=3, every=0.05}",
        "output.peaks={ambient_pressure=0.1, arrival_overpressure=0.1}",
    ]
    run(load(SOD, words), Communicator(), threads=1)
    return directory


def test_history_of_a_point(sod):
    """The shock passes at the exact time within a cell, then the contact; between them the exact plateau."""
    gauge = read_history(sod / "gauges/point.csv")
    time, pressure, density = gauge["time [s]"], gauge["pressure [Pa]"], gauge["density [kg/m3]"]
    shock, contact = 0.15 / SHOCK, 0.15 / CONTACT
    assert len(time) == len(set(time)) > 300 and time[0] == 0.0 and time[-1] == 0.2
    arrived = time[np.flatnonzero(pressure > 0.5 * (0.1 + STAR))[0]]
    assert abs(arrived - shock) * SHOCK < CELL
    ahead, behind = time < shock - 0.02, time > contact + 0.025
    between = (time > shock + 0.01) & (time < contact - 0.025)
    assert pressure[ahead] == pytest.approx(0.1, rel=1e-6)
    assert pressure[between] == pytest.approx(STAR, rel=0.01)
    assert gauge["velocity_x [m/s]"][between] == pytest.approx(CONTACT, rel=0.01)
    assert density[between] == pytest.approx(DENSITIES[1], rel=0.01)
    assert density[behind] == pytest.approx(DENSITIES[0], rel=0.02)


def test_line_samples_at_its_own_interval(sod):
    """Three points at the first steps after multiples of 0.05; what has not been reached is as it was."""
    line = read_history(sod / "gauges/line.csv")
    times = np.unique(line["time [s]"])
    assert times[:4] == pytest.approx([0.0, 0.05, 0.1, 0.15], abs=1e-3) and all(times[1:4] >= [0.05, 0.1, 0.15])
    assert len(line["time [s]"]) == 3 * len(times)
    assert line["x [m]"][:3] == pytest.approx([0.7, 0.75, 0.8])
    early = line["time [s]"] < 0.11
    assert line["pressure [Pa]"][early] == pytest.approx(0.1, rel=1e-6)
    assert line["pressure [Pa]"][line["time [s]"] > 0.19] == pytest.approx(STAR, rel=0.01)


def test_what_the_cells_remember(sod):
    """Arrival by the shock's speed within a cell; peak, impulse and dynamic pressure from the exact solution."""
    time, fields, lower, spacing = read_cells(series(sod, "cells")[-1][1])
    fields = {name: field.ravel() for name, field in fields.items()}
    x = lower[0] + (np.arange(400) + 0.5) * spacing[0] - 0.5
    passed = (x > 0.02) & (x < 0.33)
    assert np.abs(fields["arrival_time"] * SHOCK - x)[passed].max() < CELL
    assert np.isnan(fields["arrival_time"][x > 0.36]).all() and (fields["arrival_time"][x < 0.0] == 0.0).all()
    assert fields["peak_overpressure"][passed] == pytest.approx(STAR - 0.1, rel=0.01)
    exact = (STAR - 0.1) * (time - x / SHOCK)
    assert np.abs(fields["positive_impulse"] - exact)[passed].max() < 0.01 * (STAR - 0.1) * time
    dynamic = 0.5 * CONTACT**2 * np.where(x < CONTACT * time, *DENSITIES)
    certain = passed & (np.abs(x - CONTACT * time) > 0.02)
    assert fields["peak_dynamic_pressure"][certain] == pytest.approx(dynamic[certain], rel=0.015)
    assert (fields["positive_impulse"][x > 0.37] < 1e-8).all()


# ---- fluid and solid, on one and two ranks ---------------------------------------------------------------------------

GAUGES = (
    "gauges.inside={kind='point', position=[0, 0]}",
    "gauges.wall={kind='point', position=['32 mm', 0]}",
    "gauges.line={kind='line', from=['-40 mm', '-40 mm'], to=['40 mm', '40 mm'], points=9, every='0.2 us'}",
    "gauges.across={kind='plane', axis='y', position='1 mm', every='0.2 us'}",
    "gauges.marked={kind='particle', body='tube', position=['-29 mm', 0]}",
    "gauges.tube={kind='body', body='tube'}",
    "gauges.end={kind='surface', side='x_high', every='0.2 us'}",
)
COARSE = ("domain.cells=[96,96]", "solid.bodies.tube.spacing=1.2 mm", "time.end=1.2 us")
FIELDS = ("output.peaks=true", "output.schlieren=true", "output.fields_every=0.4 us")


@pytest.fixture(scope="module")
def tubes(tmp_path_factory):
    """Directories of the full tube with every kind of gauge, by number of ranks."""
    directories = {}
    for ranks in (1, 2):
        directories[ranks] = tmp_path_factory.mktemp(f"ranks{ranks}")
        words = [*GAUGES, *COARSE, "performance.block_cells=[16,16]", *FIELDS, f"output.directory={directories[ranks]}"]
        sets = [part for word in words for part in ("--set", word)]
        run_ranks(ranks, ["-m", "distfsi", "run", TUBE, "--threads", "1", *sets], timeout=200.0)
    return directories


def test_gauges_do_not_depend_on_the_ranks(tubes):
    """CSV files to the byte; plane slices and derived fields to the bit."""
    names = ("inside", "wall", "line", "marked", "tube", "end")
    for name in names:
        one, two = ((tubes[ranks] / f"gauges/{name}.csv").read_bytes() for ranks in (1, 2))
        assert one == two and one.count(b"\n") > 3
    for folder in (".", "gauges/across", "gauges/end"):
        files = [series(tubes[ranks] / folder, "cells") for ranks in (1, 2)]
        assert [time for time, _ in files[0]] == [time for time, _ in files[1]]
        for (_, one), (_, two) in zip(*files, strict=True):
            fields = [read_cells(path)[1] for path in (one, two)]
            for name, field in fields[0].items():
                np.testing.assert_array_equal(field, fields[1][name], err_msg=name)


def test_the_force_on_a_body_is_its_rate_of_momentum(tubes):
    """A free body: to round-off. It moves with its velocity after the last step's force."""
    gauge = read_history(tubes[1] / "gauges/tube.csv")
    dt = np.diff(gauge["time [s]"])
    for axis in "xy":
        force, momentum = gauge[f"force_{axis} [N/m]"], gauge[f"momentum_{axis} [N s/m]"]
        assert np.isnan(force[0]) and momentum[0] == 0.0
        scale = np.abs(gauge["momentum_x [N s/m]"]).max()
        assert np.abs(np.diff(momentum) - force[1:] * dt).max() < 1e-9 * scale
    moved = np.cumsum(gauge["velocity_x [m/s]"][:-1] * dt)
    assert gauge["displacement_x [m]"][1:] == pytest.approx(moved, rel=1e-6, abs=1e-12)
    assert moved[-1] > 0.0


def test_a_marked_particle_is_followed(tubes):
    """Its rows are those of the particle files: the one nearest to the position given."""
    gauge = read_history(tubes[1] / "gauges/marked.csv")
    (_, first), *_, (end, last) = series(tubes[1], "particles")
    columns = read_particles(first)[1]
    place = columns["position"] - [-29e-3, 0.0, 0.0]
    marked = columns["id"][np.lexsort((columns["id"], (place**2).sum(axis=1)))[0]]
    columns = read_particles(last)[1]
    row = np.flatnonzero(columns["id"] == marked)[0]
    assert gauge["time [s]"][-1] == end
    assert gauge["position_y [m]"][-1] == columns["position"][row, 1]
    assert gauge["stress_zz [Pa]"][-1] == columns["stress"][row, 2]
    assert gauge["pressure [Pa]"][-1] == columns["pressure"][row]
    assert gauge["position_x [m]"][-1] < gauge["position_x [m]"][0]


def test_a_plane_is_a_slice_of_the_cells(tubes):
    """Its field files are the layer of the whole field files that holds the plane, where it belongs."""
    whole = dict(series(tubes[2], "cells"))
    slices = series(tubes[2] / "gauges/across", "cells")
    assert len(slices) > len(whole) == len(whole.keys() & dict(slices).keys()) > 2
    for time, path in slices:
        if time not in whole:
            continue
        found, fields, lower, spacing = read_cells(path)
        expected = read_cells(whole[time])
        assert found == time and np.array_equal(spacing, expected[3])
        layer = int((1e-3 - expected[2][1]) / spacing[1])
        assert lower == pytest.approx(expected[2] + [0.0, layer * spacing[1], 0.0], rel=1e-12)
        for name, field in fields.items():
            np.testing.assert_array_equal(field, expected[1][name][:, layer : layer + 1], err_msg=name)


def test_points_and_peaks_in_a_solid(tubes):
    """A point in the wall has no value; one in the charge has. A cell that the solid has left remembers less."""
    wall = read_history(tubes[1] / "gauges/wall.csv")
    assert np.isnan(wall["pressure [Pa]"]).all() and np.isnan(wall["volume_fraction"]).all()
    inside = read_history(tubes[1] / "gauges/inside.csv")
    assert inside["pressure [Pa]"][0] == pytest.approx(8.376e9, rel=1e-3)
    assert inside["volume_fraction"][0] == pytest.approx(1.0, abs=1e-5)
    _, fields, *_ = read_cells(series(tubes[1], "cells")[-1][1])
    covered = np.isnan(fields["pressure"])
    assert covered.any() and np.isnan(fields["peak_overpressure"][covered]).all()
    assert np.isnan(fields["schlieren"][covered]).all() and np.nanmax(fields["schlieren"]) == 1.0
    assert np.nanmin(fields["positive_impulse"]) >= 0.0


# ---- restarts --------------------------------------------------------------------------------------------------------

SOD_GAUGES = (
    "domain.cells=64",
    "gauges.point={kind='point', position=0.65}",
    "gauges.line={kind='line', from=0.7, to=0.8, points=3, every=0.02}",
    "output.peaks=true",
)


@pytest.mark.parametrize(("scene", "steps"), [("sod", 30), ("tube", 12)])
def test_a_restart_continues_the_files(tmp_path, scene, steps):
    """What was written after the restart is dropped and written again: the same bytes as without any restart."""
    words = {"sod": (SOD, SOD_GAUGES), "tube": (TUBE, [*GAUGES, *COARSE, "time.end=3 us", *FIELDS])}[scene]
    scenes = [load(words[0], [*words[1], f'output.directory="{tmp_path / name}"']) for name in ("whole", "stopped")]
    whole, stopped = (Simulation.of(scene, Communicator(), threads=1) for scene in scenes)
    advance(whole, 2 * steps)
    advance(stopped, steps)
    kept = deepcopy({name: part.snapshot() for name, part in stopped.kept().items()})
    advance(stopped, steps // 2)
    again = Simulation.of(scenes[1], Communicator(), threads=1)
    for name, part in again.kept().items():
        part.restore(kept[name])
    advance(again, steps)
    files = sorted(path.relative_to(tmp_path / "whole") for path in (tmp_path / "whole").rglob("*.*"))
    assert files == sorted(path.relative_to(tmp_path / "stopped") for path in (tmp_path / "stopped").rglob("*.*"))
    for file in files:
        assert (tmp_path / "whole" / file).read_bytes() == (tmp_path / "stopped" / file).read_bytes(), file
    for name, field in whole.outputs()[0].items():
        np.testing.assert_array_equal(field, again.outputs()[0][name], err_msg=name)


def advance(simulation, steps):
    """So many steps, after a look at the start."""
    if simulation.steps == 0:
        simulation.watch()
    for _ in range(steps):
        simulation.step()


# ---- the parts -------------------------------------------------------------------------------------------------------

BOX = """
[domain]
lower = [0, 0]
upper = [2, 1]
cells = [10, 8]
x = ["wall", "outflow"]
y = ["periodic", "periodic"]
[time]
end = 1
[performance]
block_cells = [4, 4]
tile_cells = [4, 4]
[fluid.phases.gas]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "gas"
density = 1
pressure = 1
"""


@pytest.fixture
def box(tmp_path):
    """A fluid in a box of 10 x 8 cells, and a function that sets its density and velocity along x."""
    path = tmp_path / "box.toml"
    path.write_text(BOX)
    fluid = Simulation.of(load(path), Communicator(), threads=1).fluid

    def fill(density, velocity):
        conserved = fluid.model.formula("conserved")
        for block in range(fluid.blocks.local_count):
            x, y, _ = fluid.blocks.cell_centers(block)
            x, y = np.broadcast_arrays(x[None, None], y[None, :, None])
            fluid.cells(block)[:] = conserved((density(x, y), velocity(x, y), 0.0 * x, 1.0 + 0.0 * x))

    return SimpleNamespace(fluid=fluid, fill=fill)


def test_interpolation_is_linear_and_knows_the_boundaries(box):
    """Exact for a bilinear field; the normal velocity goes to zero at a wall; periodic ends meet."""
    box.fill(lambda x, y: 1.0 + x, lambda x, y: 3.0 * x)
    points = np.array([[0.53, 0.41], [1.9, 0.5], [0.02, 0.99], [1.1, 0.0]])
    values = FluidSampler(box.fluid, None, points).values()
    assert values[0] == pytest.approx([1.0, 1.53, 1.59, 0.0], rel=1e-12)
    assert values[1, 1] == pytest.approx(2.9, rel=1e-12)
    assert values[2, 1:3] == pytest.approx([1.1, 0.06], rel=1e-12)
    assert values[3] == pytest.approx([1.0, 2.1, 3.3, 0.0], rel=1e-12)


def test_interpolation_leaves_out_what_is_covered(box):
    """Covered neighbours do not count; a point in a covered cell has no value."""
    box.fill(lambda x, y: np.where(x > 1.0, 1e6, 5.0), lambda x, y: 0.0 * x)
    kind = box.fluid.blocks.allocate(1, np.uint8)
    for block in range(box.fluid.blocks.local_count):
        x = box.fluid.blocks.cell_centers(block)[0]
        box.fluid.active(kind, block)[..., x > 1.0] = COVERED
    coupling = SimpleNamespace(kind=DualArray(box.fluid.device, kind))
    sampler = FluidSampler(box.fluid, coupling, np.array([[0.99, 0.3], [1.01, 0.3], [0.2, 0.2]]))
    density = sampler.values()[:, 1]
    assert density[0] == 5.0 and np.isnan(density[1]) and density[2] == 5.0


def test_schlieren(box):
    """A linear field is 1 but for its ends; next to covered cells differences are one-sided."""
    box.fill(lambda x, y: 1.0 + x, lambda x, y: 0.0 * x)
    fluid = box.fluid
    covered = np.zeros((fluid.blocks.local_count, *fluid.blocks.shape), dtype=bool)
    covered[fluid.state[:, 0] > 2.35] = True
    for block, field in enumerate(schlieren(fluid, covered)):
        x = fluid.blocks.cell_centers(block)[0]
        part = field[0, :4, : len(x)]
        expected = np.where(x > 1.4, np.nan, np.where(x < 0.2, 0.5, 1.0))
        assert part == pytest.approx(np.broadcast_to(expected, part.shape), rel=1e-12, nan_ok=True)
    box.fill(lambda x, y: 1.0 + 0.0 * x, lambda x, y: 0.0 * x)
    assert not schlieren(fluid, None).any()


@dataclass(frozen=True)
class Speed(Gauge):
    """A gauge of a kind that no other file knows: the largest speed at two points so far."""

    every: float | None = each_step()

    def probe(self, run):
        return SpeedProbe(run)


class SpeedProbe(TableProbe):
    def __init__(self, run):
        self.columns, self._points, self._largest = ["speed [m/s]"], run.fluid_points(np.array([[0.2], [0.6]])), 0.0

    def rows(self, run):
        self._largest = max(self._largest, np.abs(self._points.values()[:, 2]).max())
        return np.array([[self._largest]])

    def kept(self):
        return {"largest": np.array(self._largest)}

    def bring_back(self, kept):
        self._largest = float(kept["largest"])


def test_a_gauge_of_a_new_kind_is_one_file(tmp_path):
    """Its table of the input, its file, its times and its restart follow from it."""
    table = table_of(Speed, "kind", "speed")
    assert table(kind="speed", every="1 ms").build() == Speed(1e-3)
    simulation = Simulation.of(load(SOD, [f"output.directory={tmp_path}"]), Communicator(), 1)
    recorder = GaugeRecorder("fast", Speed(0.02), simulation)
    simulation.watchers.append(recorder)
    simulation.watch()
    while simulation.time < 0.07:
        simulation.step()
    kept = deepcopy(recorder.snapshot())
    while simulation.time < 0.13:
        simulation.step()
    assert len(read_history(tmp_path / "gauges/fast.csv")["time [s]"]) == 7
    again = GaugeRecorder("fast", Speed(0.02), simulation)
    again.restore(kept)
    again.after_step(simulation)  # what came after the snapshot is dropped, and a new sample taken
    rows = read_history(tmp_path / "gauges/fast.csv")
    assert len(rows["time [s]"]) == 5 and rows["speed [m/s]"][3] == kept["values"]["largest"] > 0.5


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_stress_of_particles(dimensions):
    """Pressure and deviator put together: the trace is -3 p, and the shear stresses stand where VTK looks for them."""
    D = dimensions
    deviator = {1: [5.0], 2: [5.0, 2.0, 7.0], 3: [5.0, 2.0, -7.0, 1.0, 2.0, 3.0]}[D]  # … xy, xz, yz
    stress = cauchy_stress(np.array([deviator]), np.array([10.0]), D)[0]
    expected = {1: [-5, -12.5, -12.5, 0, 0, 0], 2: [-5, -8, -17, 7, 0, 0], 3: [-5, -8, -17, 1, 3, 2]}[D]
    assert stress.tolist() == expected


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["gauges.a={kind='point', position=2}"], "gauges.a.position (--set): lies outside the domain"),
        (["gauges.a={kind='line', from=0, to=-1, points=3}"], "gauges.a.to (--set): lies outside the domain"),
        (["gauges.a={kind='line', from=0, to=1, points=1}"], "gauges.a.points (--set): 1; must be >= 2"),
        (["gauges.a={kind='line', from=0, points=2}"], "gauges.a.to (--set): is missing; expected last point [m]"),
        (["gauges.a={kind='point', position=0.5, every=0}"], "gauges.a.every (--set): 0; must be > 0"),
        (["gauges.a={kind='plane', axis='x', position=0}"], "gauges.a.axis (--set): 'x' in a domain of 1 dimension(s)"),
        (["gauges.a={kind='body', body='b'}"], "gauges.a.kind (--set): 'body' needs a solid"),
        (
            ["gauges.a={kind='pont', position=0}"],
            "gauges.a.kind (--set): \"pont\"; expected one of 'body', 'point', 'surface', 'wall', 'particle', 'plane', "
            "'line'; did you mean 'point'?",
        ),
        (
            ["gauges.a={kind='point', position=0.5, evry=1}"],
            "gauges.a.evry (--set): unknown key; expected one of 'kind', 'position', 'every'; did you mean 'every'?",
        ),
        (["output.schlieren=true"], "output.schlieren (--set): needs two or three dimensions"),
        (["output.peaks=3"], "output.peaks (--set): 3; expected a table"),
        (
            ["output.peaks.ambient=3"],
            "output.peaks.ambient (--set): unknown key; expected one of 'ambient_pressure', "
            "'arrival_overpressure'; did you mean 'ambient_pressure'?",
        ),
    ],
)
def test_faults(overrides, expected):
    with pytest.raises(InputError) as caught:
        load(SOD, overrides)
    assert caught.value.faults == [f"sod.toml: {expected}"]


def test_faults_of_names():
    with pytest.raises(InputError) as caught:
        load(TUBE, ["gauges.a={kind='body', body='tub'}", "gauges.b/c={kind='body', body='tube'}"])
    assert caught.value.faults == [
        "steel_tube_full.toml: gauges.a.body (--set): 'tub' is no body; expected one of 'tube'; did you mean 'tube'?",
        "steel_tube_full.toml: gauges.b/c (--set): is no name for a file; expected letters, digits, - and _",
    ]


# ---- what a blast does -----------------------------------------------------------------------------------------------


def test_overpressure_and_impulse_of_a_point(sod):
    """Above the ambient 0.1: the exact plateau, and its integral since the shock came."""
    gauge = read_history(sod / "gauges/point.csv")
    assert np.array_equal(gauge["overpressure [Pa]"], gauge["pressure [Pa]"] - 0.1)
    exact = (STAR - 0.1) * (0.2 - 0.15 / SHOCK)
    assert gauge["impulse [Pa s]"][-1] == pytest.approx(exact, rel=0.01)
    line = read_history(sod / "gauges/line.csv")
    assert line["impulse [Pa s]"][:3] == pytest.approx(0.0, abs=1e-12)


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """Directory of a plane wave that a wall stops, in two dimensions; stopped and gone on with on the way."""
    directory = tmp_path_factory.mktemp("wall")
    words = [
        "domain.lower=[0, 0]",
        "domain.upper=[1, 0.05]",
        "domain.cells=[100, 5]",
        "performance.block_cells=[32, 4]",
        "domain.x=['outflow', 'wall']",
        "domain.y=['wall', 'wall']",
        f'output.directory="{directory}"',
        "fluid.regions.1.shape={kind='box', lower=[0.5, -1], upper=[2, 1]}",
        "time.end=0.35",
        "gauges.face={kind='surface', side='x_high', every=0.1}",
        "gauges.point={kind='point', position=[0.995, 0.025]}",
    ]
    run(load(SOD, words), Communicator(), threads=1)
    return directory


def test_the_load_on_a_wall(wall):
    """Force and impulse are those of a point at the wall times its area; so are the maps."""
    face, point = (read_history(wall / f"gauges/{name}.csv") for name in ("face", "point"))
    at = np.searchsorted(point["time [s]"], face["time [s]"])
    over = point["pressure [Pa]"] - 1.0  # ambient: the first region's
    assert face["force [N/m]"] == pytest.approx(0.05 * over[at], rel=1e-9)
    assert face["impulse [N s/m]"] == pytest.approx(0.05 * point["impulse [Pa s]"][at], rel=1e-9, abs=1e-15)
    assert face["peak_overpressure [Pa]"] == pytest.approx(np.maximum.accumulate(np.maximum(over, 0.0))[at], abs=1e-12)
    _, fields, _, _ = read_cells(series(wall / "gauges/face", "cells")[-1][1])
    assert fields["impulse"].shape == (1, 5, 1)
    assert fields["impulse"].ravel() == pytest.approx(point["impulse [Pa s]"][at[-1]], rel=1e-9)
    assert set(fields) == {"overpressure", "peak_overpressure", "impulse"}


def test_a_surface_has_two_dimensions(tmp_path):
    with pytest.raises(InputError, match="'x_low' in a domain of 1 dimension"):
        load(SOD, ["gauges.a={kind='surface', side='x_low'}"])


def test_the_impulse_on_a_body_is_that_of_its_force(tubes):
    gauge = read_history(tubes[1] / "gauges/tube.csv")
    dt = np.diff(gauge["time [s]"])
    for axis in "xy":
        force, impulse = gauge[f"force_{axis} [N/m]"], gauge[f"impulse_{axis} [N s/m]"]
        assert impulse[0] == 0.0
        assert np.cumsum(force[1:] * dt) == pytest.approx(impulse[1:], rel=1e-9, abs=1e-9 * np.abs(impulse).max())


@pytest.mark.parametrize(("name", "columns"), [("detonation", [0]), ("three_materials", [0, 1, 2])])
def test_volume_fractions_at_a_point(name, columns):
    """Those of the cell, also where a phase carries shares behind them, and of three phases that of each."""
    fluid = Simulation.of(load(ROOT / f"inputs/{name}.toml"), Communicator(), 1).fluid
    middle = np.array([[fluid.blocks.cell_centers(0)[0][5]]])
    sampler, cell = FluidSampler(fluid, None, middle), fluid.cells(0)[:, 0, 0, 5]
    first = list(cell[fluid.model.fraction : fluid.model.fraction + fluid.model.phases - 1])
    expected = [*first, 1.0 - sum(first)]
    assert sampler.columns[-len(columns) :] == (
        ["volume_fraction"] if name == "detonation" else [f"volume_fraction_{m}" for m in ("products", "water", "air")]
    )
    assert np.allclose(sampler.values()[0, -len(columns) :], [expected[k] for k in columns], rtol=1e-12)
