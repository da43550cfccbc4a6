"""A run goes on from the end of another of fewer dimensions: everything arrives, and the wave goes on."""

import numpy as np
import pytest

from distfsi.commands.line import main
from distfsi.coordinates import coordinates_of
from distfsi.diagnostics.budget import Budget
from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.fluid.mapping import shell_parts
from distfsi.mesh.communicator import Communicator
from distfsi.output.fields import read_cells, series
from distfsi.output.history import read_history
from distfsi.output.restart import Restart, newest_restart
from distfsi.scene import load, overlaps
from distfsi.simulation import Simulation
from tubes import advance, fields, radii

PHASES = """
[fluid.phases]
gas = { eos = "ideal_gas", gamma = 1.4 }
charge = { eos = "jwl", rho0 = 1630, A = 3.712e11, B = 3.21e9, R1 = 4.15, R2 = 0.95, omega = 0.3 }
[[fluid.regions]]
phase = "gas"
density = 1.2
pressure = 1e5
"""
CHARGE = """[[fluid.regions]]
phase = "charge"
density = 1630
pressure = 8e9
shape = { kind = "ball", center = CENTER, radius = 0.05 }
"""
LINE = (
    """
[domain]
symmetry = "SYMMETRY"
lower = 0
upper = 0.5
cells = 100
x = ["axis", "outflow"]
[time]
end = 2.5e-5
"""
    + PHASES
    + CHARGE.replace("CENTER", "0")
)
AXIS = (
    """
[domain]
symmetry = "axisymmetric"
lower = [0, -0.4]
upper = [0.4, 0.4]
cells = [20, 40]
x = ["axis", "outflow"]
[time]
end = 2.5e-5
"""
    + PHASES
    + CHARGE.replace("CENTER", "[0, 0.02]")
    + "velocity = [0, 300]\n"
)
# dimensions and what else the target's domain says, by the run that it goes on from
TARGETS = {
    ("spherical", "axisymmetric"): ("[0, 0]", "[0.5, 0.5]", "[20, 20]", '["axis", "outflow"]'),
    ("spherical", "planar"): ("[0, 0, 0]", "[0.5, 0.5, 0.5]", "[14, 14, 14]", '["symmetry", "outflow"]'),
    ("spherical", "spherical"): ("0", "0.7", "31", '["axis", "outflow"]'),
    ("cylindrical", "planar"): ("[-0.51, -0.5]", "[0.6, 0.52]", "[22, 21]", '["outflow", "outflow"]'),
    ("axisymmetric", "planar"): ("[0, 0, -0.45]", "[0.5, 0.5, 0.45]", "[10, 10, 18]", '["symmetry", "outflow"]'),
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Output directories of short runs, by their symmetry."""
    directories = {}
    for symmetry in ("spherical", "cylindrical", "axisymmetric"):
        folder = tmp_path_factory.mktemp(symmetry)
        text = AXIS if symmetry == "axisymmetric" else LINE.replace("SYMMETRY", symmetry)
        (folder / "scene.toml").write_text(text)
        scene = load(folder / "scene.toml", [f"output.directory={folder / 'out'}"])
        run(scene, Communicator(), 1)
        directories[symmetry] = folder / "out"
    return directories


def target(folder, directory, symmetry, box, more=""):
    """The scene that goes on from the run in a directory."""
    lower, upper, cells, x = box
    domain = f'[domain]\nsymmetry = "{symmetry}"\nlower = {lower}\nupper = {upper}\ncells = {cells}\nx = {x}\n'
    path = folder / "target.toml"
    path.write_text(domain + "[time]\nend = 4e-5\n" + PHASES + f'[fluid.map]\nrun = "{directory}"\n' + more)
    return load(path)


def last_pressure(directory):
    """The highest pressure [Pa] at the end of a run."""
    _, cells, *_ = read_cells(series(directory, "cells")[-1][1])
    return cells["pressure"].max()


# ---- exact volumes ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("volume", "lower", "whole"),
    [
        (overlaps.ball_to_corner, (-1.3, -1.2, -1.1), 4.0 / 3.0 * np.pi),
        (overlaps.ball_to_ring, (0.0, -1.2), 4.0 / 3.0 * np.pi),
        (overlaps.disc_to_corner, (-1.3, -1.1), np.pi),
        (overlaps.ball_to_shell, (0.0,), 4.0 / 3.0 * np.pi),
        (overlaps.disc_to_circle, (0.0,), np.pi),
    ],
)
def test_shells_lie_in_cells_without_a_gap(volume, lower, whole):
    """All parts add up to the shells, and to the cells that are full; each against many points."""
    edges = [np.linspace(a, 1.25, 12) for a in lower]
    grids = [np.meshgrid(*(e[s] for e in edges), indexing="ij") for s in (np.s_[:-1], np.s_[1:])]
    low, high = (np.stack([g.ravel() for g in grid], axis=1) for grid in grids)
    radii_of_shells = np.array([0.0, 0.21, 0.5, 0.77, 1.0])
    parts = shell_parts(volume, low, high, radii_of_shells).toarray()
    power = 3 if whole > np.pi else 2
    np.testing.assert_allclose(parts.sum(axis=0), whole * np.diff(radii_of_shells**power), rtol=1e-13)
    assert parts.min() > -1e-14
    # by many points, weighted with what the coordinates make of a volume
    share = (np.arange(24) + 0.5) / 24
    points = np.stack([g.ravel() for g in np.meshgrid(*[share] * len(lower), indexing="ij")], axis=1)
    for cell in np.linspace(0, len(low) - 1, 9).astype(int):
        place = low[cell] + (high[cell] - low[cell]) * points
        weight = {"ball_to_ring": 2.0 * np.pi * place[:, 0], "disc_to_circle": 2.0 * np.pi * place[:, 0]}
        weight["ball_to_shell"] = 4.0 * np.pi * place[:, 0] ** 2
        each = weight.get(volume.__name__, np.ones(len(place))) * np.prod(high[cell] - low[cell]) / len(place)
        inside = (place**2).sum(axis=1) < 0.77**2
        assert parts[cell, :3].sum() == pytest.approx(each[inside].sum(), abs=0.05 * each.sum())


# ---- totals ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("source", "symmetry"), TARGETS)
def test_everything_arrives(finished, tmp_path, source, symmetry):
    """Masses, radial momentum (and that along the axis) and energy to 1e-12, and no pressure above the source's."""
    scene = target(tmp_path, finished[source], symmetry, TARGETS[source, symmetry])
    simulation = Simulation.of(scene, Communicator(), 1)
    mapping = simulation.fluid.mapping
    print("\n".join(mapping.lines()))
    np.testing.assert_allclose(mapping.after, mapping.before, rtol=1e-12)
    assert np.all(mapping.before != 0.0)
    assert simulation.time == pytest.approx(2.5e-5) and len(mapping.lines()) == 1 + len(mapping.before)
    highest = last_pressure(finished[source])
    assert fields(simulation)["pressure"].max() <= 1.001 * highest
    budget = Budget(simulation.fluid, None, None)
    budget.row(simulation)
    for _ in range(5):
        simulation.step()
    row = budget.row(simulation)
    assert max(abs(value) for key, value in row.items() if key.startswith("drift")) < 1e-12
    assert fields(simulation)["pressure"].max() <= 1.001 * highest


def test_single_precision_is_mapped_into_single_precision(tmp_path):
    """To its rounding; water counts its energies from one density in both runs, or is refused."""
    words = ["fluid.precision=float32", 'fluid.phases.gas={eos="stiffened_gas", gamma=4.4, p_inf=6e8}']
    words += ["fluid.regions.0.density=1000"]
    (tmp_path / "scene.toml").write_text(LINE.replace("SYMMETRY", "spherical"))
    run(load(tmp_path / "scene.toml", [f"output.directory={tmp_path / 'out'}", *words]), Communicator(), 1)
    target(tmp_path, tmp_path / "out", "spherical", TARGETS["spherical", "spherical"])
    simulation = Simulation.of(load(tmp_path / "target.toml", words), Communicator(), 1)
    mapping = simulation.fluid.mapping
    np.testing.assert_allclose(mapping.after, mapping.before, rtol=1e-6)
    highest = last_pressure(tmp_path / "out")
    for _ in range(5):
        simulation.step()
    assert fields(simulation)["pressure"].max() <= 1.001 * highest
    lighter = load(tmp_path / "target.toml", [*words[:2], "fluid.regions.0.density=990"])
    with pytest.raises(InputError, match=r"gas has 990.0 kg/m3 in its first one, from where float32 counts energies"):
        Simulation.of(lighter, Communicator(), 1)


def test_the_share_in_the_domain_is_told(finished, tmp_path):
    """An eighth of the sphere's masses and energy lies in an octant."""
    eighth = target(tmp_path, finished["spherical"], "planar", TARGETS["spherical", "planar"])
    whole = target(tmp_path, finished["spherical"], "spherical", TARGETS["spherical", "spherical"])
    part, all_of_it = (Simulation.of(scene, Communicator(), 1).fluid.mapping.before for scene in (eighth, whole))
    np.testing.assert_allclose(8.0 * part, all_of_it, rtol=1e-12)


def test_the_wave_goes_on(finished, tmp_path):
    """(r, z) from the sphere, beside the sphere that went on in its own coordinates."""
    line, plane = (
        advance(
            Simulation.of(
                target(tmp_path, finished["spherical"], symmetry, TARGETS["spherical", symmetry]), Communicator(), 1
            )
        )
        for symmetry in ("spherical", "axisymmetric")
    )
    p, r = fields(line)["pressure"].ravel(), radii(line)[0].ravel()
    found, distance = fields(plane)["pressure"], radii(plane)[0]
    error = np.abs(found - np.interp(distance, r, p)) / p.max()
    assert error[distance < 0.48].mean() < 0.02


def test_other_regions_stay(finished, tmp_path):
    """A pool of heavy gas under the map is painted over it."""
    pool = '[[fluid.regions]]\nphase = "gas"\ndensity = 50\npressure = 1e5\n'
    pool += 'shape = { kind = "box", lower = [0, 0], upper = [0.5, 0.05] }\n'
    box = TARGETS["spherical", "axisymmetric"]
    simulation = Simulation.of(target(tmp_path, finished["spherical"], "axisymmetric", box, pool), Communicator(), 1)
    found = fields(simulation)
    np.testing.assert_allclose(found["density"][0, :2], 50.0, rtol=1e-2)  # but for a trace of the charge
    np.testing.assert_allclose(found["pressure"][0, :2], 1e5, rtol=1e-9)
    assert found["pressure"][0, 2:].max() > 1e6


def test_what_does_not_fit_is_refused(finished, tmp_path):
    """In words, with the key."""
    box = TARGETS["spherical", "planar"]
    with pytest.raises(InputError, match=r"fluid.map.run.*no restart file"):
        target(tmp_path, tmp_path / "nowhere", "planar", box)
    flat = target(tmp_path, finished["spherical"], "planar", ("[0, 0]", "[1, 1]", "[8, 8]", '["symmetry", "outflow"]'))
    with pytest.raises(InputError, match=r"fluid.map.run: spherical in .* does not fit into 2D, planar"):
        Simulation.of(flat, Communicator(), 1)
    target(tmp_path, finished["spherical"], "planar", box)
    other = load(tmp_path / "target.toml", ["fluid.phases.gas.gamma=1.3"])
    with pytest.raises(InputError, match=r"fluid.phases.gas.eos.gamma: 1.3; was 1.4"):
        Simulation.of(other, Communicator(), 1)
    single = load(tmp_path / "target.toml", ["fluid.precision=float32"])
    with pytest.raises(InputError, match=r"fluid.precision: 'float32'; was 'float64'"):
        Simulation.of(single, Communicator(), 1)


def test_ranks_map_the_same_bits(finished, tmp_path, mpiexec):
    """On two ranks, and the run says what it has mapped."""
    target(tmp_path, finished["spherical"], "planar", TARGETS["spherical", "planar"])
    sizes = ("--set", "performance.block_cells=[7, 8, 6]", "--set", "performance.tile_cells=[7, 4, 3]")
    found = []
    for ranks in (1, 2):
        words = ("--threads", 1, *sizes, "--set", f"output.directory={tmp_path / str(ranks)}")
        printed = mpiexec(ranks, "-m", "distfsi", "run", tmp_path / "target.toml", *words)
        assert printed.count("mapped from") == 1 and "radial momentum [N s]" in printed
        found.append(read_cells(series(tmp_path / str(ranks), "cells")[-1][1])[1])
    for name, values in found[0].items():
        np.testing.assert_array_equal(found[1][name], values)


# ---- stages ----------------------------------------------------------------------------------------------------------

STAGES = (
    """
title = "a sphere, its wave around an axis, and in an octant"
[domain]
lower = [0, 0, 0]
upper = [0.4, 0.4, 0.4]
cells = [12, 12, 12]
x = ["symmetry", "outflow"]
y = ["symmetry", "outflow"]
z = ["symmetry", "outflow"]
[time]
end = 2.2e-5
"""
    + PHASES.replace("[[fluid", "[fluid.map]\ncenter = [0, 0, 0]\n[[fluid")
    + """
[[stages]]
domain = { symmetry = "spherical", lower = 0, upper = 0.3, cells = 60, x = ["axis", "outflow"] }
time = { end = 1e-5 }
regions = [
  { phase = "gas", density = 1.2, pressure = 1e5 },
  { phase = "charge", density = 1630, pressure = 8e9, shape = { kind = "ball", center = 0, radius = 0.05 } },
]
[[stages]]
time = { end = 1.6e-5 }
regions = [{ phase = "gas", density = 1.2, pressure = 1e5 }]
[stages.domain]
symmetry = "axisymmetric"
lower = [0, 0]
upper = [0.35, 0.35]
cells = [21, 21]
x = ["axis", "outflow"]
y = ["symmetry", "outflow"]
"""
)


def test_stages_lead_from_one_dimension_to_three(tmp_path, capsys):
    """One input: a sphere, (r, z), an octant; totals at both links to 1e-12."""
    path = tmp_path / "scene.toml"
    path.write_text(STAGES)
    scene = load(path, [f"output.directory={tmp_path / 'out'}"])
    assert [stage.domain.dimensions for stage in scene.stages] == [1, 2]
    main(["check", str(path)])
    report = capsys.readouterr().out
    assert "symmetry   spherical" in report and "symmetry   axisymmetric" in report and "is nowhere" not in report
    octant = run(scene, Communicator(), 1)
    printed = capsys.readouterr().out
    assert printed.count("mapped from") == 2
    np.testing.assert_allclose(octant.fluid.mapping.after, octant.fluid.mapping.before, rtol=1e-12)
    # a quarter of the half that lies in (r, z)
    _, half, *_ = (read_history(tmp_path / f"out-stage-{n}" / "history.csv") for n in (1, 2))
    assert octant.time == pytest.approx(2.2e-5)
    assert octant.fluid.mapping.before[1] == pytest.approx(half["fluid mass_2 [kg]"][-1] / 4.0, rel=1e-3)


def test_faults_of_a_stage_are_told_with_their_keys(tmp_path):
    """Those of the scene beside them."""
    path = tmp_path / "scene.toml"
    path.write_text(STAGES)
    words = ["stages.0.domain.cells=0", "stages.1.domain.symmetry=spherical", "stages.1.time.end=-1", "time.cfl=2"]
    with pytest.raises(InputError) as found:
        load(path, words)
    told = "\n".join(found.value.faults)
    for key in ("stages.0.domain.cells", "stages.1.domain.symmetry", "stages.1.time.end", "time.cfl"):
        assert key in told, told


POOL = """
[[stages.regions]]
phase = "gas"
density = 1.2
pressure = 1e5
[[stages.regions]]
phase = "gas"
density = 9
pressure = 1e5
shape = { kind = "half_space", point = [0, 0.2], normal = [0, -1] }
"""


def test_a_stage_ends_before_the_first_contact(tmp_path):
    """The front is two cells away from the nearest of what the next run has, and a restart of the stage stays ended."""
    path = tmp_path / "scene.toml"
    text = STAGES.replace("time = { end = 1e-5 }", 'time = { end = 1, front = "contact" }')
    alone = 'regions = [{ phase = "gas", density = 1.2, pressure = 1e5 }]\n'
    path.write_text(text.replace(alone, "") + POOL)
    stage = load(path, [f"output.directory={tmp_path / 'out'}"]).stages[0]
    assert stage.time.front == pytest.approx(0.2 - 2.0 * 0.35 / 21, rel=1e-12)
    ended = run(stage, Communicator(), 1)
    found = fields(ended)["pressure"].ravel()
    disturbed = np.flatnonzero(np.abs(found / 1e5 - 1.0) > 1e-3)[-1]
    assert (disturbed + 0.5) * 0.005 == pytest.approx(stage.time.front, abs=0.01) and ended.time < 1e-4
    again = Simulation.of(stage, Communicator(), 1)
    assert not again.done
    again.restore(ended.snapshot())
    assert again.done


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["time.front=0.1"], "time.front.*is for a fluid in 'spherical' or 'cylindrical' coordinates"),
        (["stages.0.time.front=0.5"], "stages.0.time.front.*0.5 m lies outside the domain"),
        (["stages.0.time.front=contact"], "stages.0.time.front.*nothing is met; expected it in the stage"),
        (
            ["stages.0.time.front=contact", "stages.1.domain.y=['symmetry', 'wall']"],
            "the first contact is 0.3167 m from",
        ),
        (["stages.1.time.front=contact"], "stages.1.time.front.*is for a fluid in"),
    ],
)
def test_fronts_that_nothing_comes_to_are_faults(tmp_path, words, told):
    path = tmp_path / "scene.toml"
    path.write_text(STAGES)
    with pytest.raises(InputError, match=told):
        load(path, words)


BURNING = """
[domain]
symmetry = "axisymmetric"
lower = [0, 0]
upper = ["80 mm", "80 mm"]
cells = [16, 16]
x = ["axis", "outflow"]
y = ["symmetry", "outflow"]
[time]
end = "12 us"
[fluid.phases.air]
material = "air"
[fluid.phases.charge]
material = "TNT"
[[fluid.regions]]
phase = "air"
[fluid.detonation]
phase = "charge"
[[fluid.detonation.detonators]]
kind = "point"
position = [0, 0]
[fluid.afterburn]
phase = "charge"
law = { kind = "miller", energy = "10 MJ/kg", rate = "2e4 1/s" }
[[stages]]
domain = { symmetry = "spherical", lower = 0, upper = "70 mm", cells = 70, x = ["axis", "outflow"] }
time = { end = "4 us" }
detonators = [{ kind = "point", position = 0 }]
regions = [{ phase = "air" }, { phase = "charge", shape = { kind = "ball", center = 0, radius = "50 mm" } }]
"""


def test_a_charge_goes_on_burning(tmp_path):
    """Half burnt at the end of the stage: the rest of the charge arrives unburnt and is lit on time."""
    path = tmp_path / "scene.toml"
    path.write_text(BURNING)
    scene = load(path, [f"output.directory={tmp_path / 'out'}"])
    run(scene.stages[0], Communicator(), 1)
    sphere = Restart(newest_restart(tmp_path / "out-stage-1")).array("fluid/cells/state")[:, 0, 0]
    faces = np.linspace(0.0, 0.07, 71)
    shell = coordinates_of("spherical").volume(faces[:-1], faces[1:])
    simulation = Simulation.of(scene, Communicator(), 1)
    np.testing.assert_allclose(simulation.fluid.mapping.after, simulation.fluid.mapping.before, rtol=1e-12)
    cells = simulation.fluid.cells(0)
    for there, here in ((5, 6), (6, 7)):  # the masses that are unburnt, and that the afterburn has left
        held = simulation.fluid.metrics.weighted(cells[here], 0).sum() * 0.005**2
        assert held == pytest.approx((sphere[there] * shell).sum() / 2.0, rel=1e-12)
    budget = Budget(simulation.fluid, None, None)
    budget.row(simulation)
    assert cells[6].sum() > 0.3 * cells[1].sum()  # unburnt so far
    advance(simulation)
    assert simulation.fluid.cells(0)[6].sum() < 1e-3 * simulation.fluid.cells(0)[1].sum()
    row = budget.row(simulation)
    assert abs(row["drift energy"]) < 1e-12


def test_other_reactions_are_refused(tmp_path):
    """What shares mean must be the same in both runs."""
    path = tmp_path / "scene.toml"
    path.write_text(BURNING)
    words = [f"output.directory={tmp_path / 'out'}"]
    run(load(path, words).stages[0], Communicator(), 1)
    with pytest.raises(InputError, match=r"fluid.afterburn.law.rate: .*; was 20000"):
        Simulation.of(load(path, [*words, "fluid.afterburn.law.rate=3e4"]), Communicator(), 1)
