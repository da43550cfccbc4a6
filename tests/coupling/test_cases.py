"""The cases of the paper as studies that users run, coarse here; `-m full` runs them finer."""

import numpy as np
import pytest

from distfsi.mesh.communicator import Communicator
from distfsi.output.charts import Chart, Curve, Picture, draw_charts, draw_pictures
from distfsi.scene import load
from distfsi.study import fitted_cylinder, fitted_liftoff, liftoff, shock_bubble, shock_bubble_speed, undex_2d
from distfsi.study.references import SHOCK_BUBBLE_SPEEDS, UNDEX_2D
from distfsi.study.tracks import crossing, velocity, write_tracks

PLATEAUS = {0.5: (0.5, 0.6, 0.7, 0.8), 0.4: (0.4, 0.5, 0.6, 0.7)}  # radii where nothing changes fast [m]
MACH = 1.22


# ---- tracks ----------------------------------------------------------------------------------------------------------


def test_crossing_is_the_first_along_the_line_and_linear_between_points():
    x = np.array([0.0, 1.0, 2.0, 3.0])
    values = np.array([0.0, 4.0, 4.0, 0.0])
    assert crossing(x, values, 1.0) == 0.25
    assert crossing(x[::-1], values[::-1], 1.0) == 2.75
    assert np.isnan(crossing(x, values, 5.0))


def test_velocity_is_fitted_in_its_window_only():
    time = np.linspace(0.0, 10.0, 101)
    position = np.where(time < 5.0, 3.0 * time, 15.0 - 2.0 * (time - 5.0))
    position[3] = np.nan
    assert velocity(time, position, (0.0, 4.0)) == pytest.approx(3.0, rel=1e-12)
    assert velocity(time, position, (6.0, 10.0)) == pytest.approx(-2.0, rel=1e-12)
    assert np.isnan(velocity(time, position, (9.0, 20.0)))


def test_tracks_are_kept_as_csv(tmp_path):
    write_tracks(tmp_path / "tracks.csv", {"time [us]": np.array([0.0, 1.5]), "front [mm]": np.array([250.0, np.nan])})
    assert (tmp_path / "tracks.csv").read_text() == "time [us],front [mm]\n0,250\n1.5,nan\n"


def test_charts_and_pictures_are_drawn(tmp_path):
    x = np.linspace(0.0, 1.0, 5)
    chart = Chart("a", "x [m]", "y", [Curve(x, x, "line"), Curve(x, x**2, style="o")])
    picture = Picture("b", np.outer(x, x), (0.0, 1.0, 0.0, 1.0), label="p")
    for path in (draw_charts(tmp_path / "c.png", [chart], 2), draw_pictures(tmp_path / "p.png", [picture], 2, "m")):
        assert path.read_bytes().startswith(b"\x89PNG")


# ---- underwater explosion --------------------------------------------------------------------------------------------


def explode(tmp_path, monkeypatch, charge, *overrides):
    monkeypatch.setattr(undex_2d, "DIRECTORY", tmp_path)
    return undex_2d.explode(Communicator(), charge, overrides)


def assert_as_radial(explosion, cells, plateau):
    """Shock and interface within so many cells of the radial computation, axis and diagonal within one of each other;
    pressure and velocity within a share `plateau` where they change slowly."""
    for reference in explosion.references:
        for what in ("shock", "interface"):
            found = [explosion.radius(what, direction, reference.time) for direction in undex_2d.DIRECTIONS]
            assert np.abs(np.array(found) - getattr(reference, what)).max() < cells * explosion.spacing
            assert np.ptp(found) < explosion.spacing
    for radius, pressure, velocity_there, _ in explosion.references[-1].points:
        if radius in PLATEAUS[explosion.references[-1].charge]:
            for direction in undex_2d.DIRECTIONS:
                assert explosion.at(direction, "pressure", radius) == pytest.approx(pressure, rel=plateau)
                assert explosion.at(direction, "velocity", radius) == pytest.approx(velocity_there, rel=plateau)


def test_underwater_explosion_coarse(tmp_path, monkeypatch):
    """200 x 200 cells: shock and interface within a cell, plateaus within 2 %."""
    explosion = explode(tmp_path, monkeypatch, 0.5, "domain.cells=[200,200]", "time.end=1.01e-4")
    assert_as_radial(explosion, cells=1.0, plateau=0.02)
    assert len(undex_2d.table(explosion).splitlines()) == 7 + len(explosion.references[-1].points)


@pytest.mark.full
@pytest.mark.parametrize("charge", undex_2d.RADII)
def test_underwater_explosion(tmp_path, monkeypatch, charge):
    """The paper's 400 x 400 cells: shock and interface within a cell, plateaus within 1 %."""
    assert_as_radial(explode(tmp_path, monkeypatch, charge), cells=1.0, plateau=0.01)


def test_the_references_cover_both_charges():
    assert {reference.charge for reference in UNDEX_2D} == set(undex_2d.RADII)


# ---- shock and bubble ------------------------------------------------------------------------------------------------


def bubble_velocities(tmp_path, monkeypatch, gas, cells):
    monkeypatch.setattr(shock_bubble, "DIRECTORY", tmp_path)
    scene, tracks = shock_bubble.run_gas(Communicator(), gas, [f"domain.cells={cells}", "time.end=95"])
    shock_bubble.draw(gas, scene)
    assert {path.name for path in tmp_path.glob("*.png")} == {f"maps_{gas}.png", f"schlieren_{gas}.png"}
    return shock_bubble.velocities(tracks, scene)


def test_the_shock_meets_the_bubble_when_mach_1_22_says():
    scene = load(shock_bubble.INPUT)
    assert shock_bubble.arrival_of(scene) == pytest.approx(25.0 / (MACH * np.sqrt(1.4)), rel=1e-4)


def test_shock_and_bubble_coarse(tmp_path, monkeypatch):
    """50 cells across the bubble: the shocks outside it have converged, the rest is near the fine computations."""
    found = bubble_velocities(tmp_path, monkeypatch, "contaminated", [325, 89])
    assert found["Vs"] == pytest.approx(MACH * shock_bubble.SOUND_SPEED, rel=0.005)
    assert found["Vs"] == pytest.approx(422.0, rel=0.01)
    assert 0.98 * 377.0 < found["VT"] < 1.02 * 382.0
    assert np.isnan(found["Vuf"])  # the run ends before
    assert len(shock_bubble.table({"contaminated": found}).splitlines()) == 1 + len(found)


@pytest.mark.full
def test_shock_and_bubble(tmp_path, monkeypatch):
    """100 cells across the bubble: refracted shock and interfaces, too, are near fine runs or the experiment."""
    found = bubble_velocities(tmp_path, monkeypatch, "contaminated", [650, 178])
    assert found["Vs"] == pytest.approx(MACH * shock_bubble.SOUND_SPEED, rel=0.001)
    assert 0.99 * 377.0 < found["VT"] < 1.01 * 382.0
    assert 0.97 * 943.0 < found["VR"] < 1.03 * 953.0
    experiment = shock_bubble.SHOCK_BUBBLE[0]
    for name in ("Vs", "VR", "VT", "Vui", "Vdi", "Vj"):
        assert found[name] == pytest.approx(getattr(experiment, name), rel=0.1), name


# ---- a cylinder that a shock throws ---------------------------------------------------------------------------------


def test_the_fitted_meshes_agree_with_finer_ones_of_their_own():
    """And the channel's wall matters only when its echo is back."""
    for mesh in (fitted_cylinder.unbounded, fitted_cylinder.channel):
        coarse, fine = (fitted_cylinder.fly(mesh(n), 10.77, 0.08) for n in (25, 50))
        assert coarse.x[-1] - 0.15 == pytest.approx(fine.x[-1] - 0.15, rel=0.01)
    free, shut_in = (
        fitted_cylinder.fly(mesh(25), 10.77, 0.02) for mesh in (fitted_cylinder.unbounded, fitted_cylinder.channel)
    )
    assert free.u[-1] == pytest.approx(shut_in.u[-1], rel=0.01)


def test_the_fitted_mesh_between_floor_and_ceiling_is_twice_half_a_channel():
    whole = fitted_liftoff.lift(fitted_cylinder.HEIGHT - 0.05, 10.77, 0.1, 25)
    half = fitted_cylinder.fly(fitted_cylinder.channel(25), 10.77, 0.1)
    assert whole.x[-1] - 0.15 == pytest.approx(half.x[-1] - 0.15, rel=0.01)
    assert abs(whole.y[-1] - 0.1) < 5e-4  # there are fewer rows below than above


@pytest.mark.full
def test_a_shock_lifts_a_cylinder_off_the_floor(tmp_path, monkeypatch):
    """Twenty cells across; others by a ghost-cell method."""
    monkeypatch.setattr(liftoff, "DIRECTORY", tmp_path)
    for found, other in zip(liftoff.centres(liftoff.run(Communicator(), 40, ())), liftoff.LIFTOFF, strict=True):
        assert found[0] == pytest.approx(other.x, rel=0.03)
        assert found[1] == pytest.approx(other.y, rel=0.05)


@pytest.mark.full
def test_a_shock_lifts_a_cylinder_as_on_a_fitted_mesh(tmp_path, monkeypatch):
    """From a hundredth above the floor, two cells; the height is of first order."""
    monkeypatch.setattr(liftoff, "DIRECTORY", tmp_path)
    found, fitted = liftoff.run_raised(Communicator(), 40, ["time.end=0.1"]), liftoff.lift_raised(0.1, 25)
    assert found["x"][-1] - 0.15 == pytest.approx(fitted["x"][-1] - 0.15, rel=0.02)
    assert found["y"][-1] - 0.05 == pytest.approx(fitted["y"][-1] - 0.05, rel=0.05)


THROWN = [
    ("unbounded gas", 0.1, (0.5, 0.2)),
    *(pytest.param(name, 0.30085, None, marks=pytest.mark.full) for name in liftoff.SURROUNDINGS),
]


@pytest.mark.parametrize(("name", "end", "upper"), THROWN)
def test_a_shock_throws_a_cylinder_as_on_a_fitted_mesh(tmp_path, monkeypatch, name, end, upper):
    """20 cells across; the path is of first order: 3 % with 10, 0.5 % with 40."""
    monkeypatch.setattr(liftoff, "DIRECTORY", tmp_path)
    around = liftoff.SURROUNDINGS[name]
    around = around._replace(upper=upper) if upper else around
    found = liftoff.throw(Communicator(), around, 20, [f"time.end={end}"])
    fitted = liftoff.flight(around, end, 50)
    assert found["x"][-1] - 0.15 == pytest.approx(fitted["x"][-1] - 0.15, rel=0.015)
    assert found["u"][-1] == pytest.approx(fitted["u"][-1], rel=0.02)


def test_the_papers_table_2_counts_the_cells_of_its_own_meshes():
    for row in SHOCK_BUBBLE_SPEEDS:
        nx, ny = round(325 / row.spacing), round(90 / row.spacing)
        assert nx * ny == row.cells
        assert abs(2 * (nx + 1) * (ny + 1) - row.nodes) <= 1  # the second is one short
        assert shock_bubble_speed.cells_of(row) == (nx, round(89 / row.spacing))
    assert "1,851,200" in shock_bubble_speed.line(SHOCK_BUBBLE_SPEEDS[-1], 10.0)
