"""What `check` tells before a run, against what the run then takes."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from distfsi.commands.line import main
from distfsi.execution import run
from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.mesh.communicator import Communicator
from distfsi.resources import bench
from distfsi.resources.estimate import Resources
from distfsi.resources.report import report
from distfsi.resources.works import SMALLEST, blast_on_copper, gases
from distfsi.scene import load
from distfsi.scene.advice import advice
from distfsi.scene.signals import Layout, moving_share, steps, sub_steps
from distfsi.scene.waves import Side, meet
from distfsi.simulation import Simulation, deal_blocks
from distfsi.study.exact import PureState, exact_riemann
from distfsi.study.references import AIR, WATER_AIR
from launch import ROOT, run_ranks

INPUTS = sorted((ROOT / "inputs").glob("*.toml"))
TUBE, SOD, IMPACT = (ROOT / "inputs" / f"{name}.toml" for name in ("steel_tube", "sod", "plate_impact"))


def advised(scene):
    return list(advice(scene, Layout(scene) if scene.fluid else None))


# ---- the report ------------------------------------------------------------------------------------------------------


ADVICE = {  # on purpose
    "cavitation": ("phase 'air' fills no cell",),  # only traces of it, from which the bubbles grow
    "thin_plate": ("thinner than sqrt(2) cells",),
    "concrete_slab": ("2.7 cells per radius",),
    "undex_plate": ("fewer than 4 particles", "thinner than sqrt(3) cells"),
    "steel_tube_full": ("the rest is hidden", "into body 'tube'"),  # the charge leans against the tube
}


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_every_example_gets_a_report_without_advice(path):
    scene = load(path)
    text = report(scene)
    assert text.startswith(scene.title)
    known = ADVICE.get(path.stem, ())
    assert [text for text in advised(scene) if not any(words in text for words in known)] == []
    for name in ("domain", "blocks", "memory", "output", "steps", "time"):
        assert f"\n  {name} " in text
    assert "distfsi bench" in text


def test_the_report_counts_what_the_scene_holds():
    text = report(load(TUBE, ["domain.cells=[160, 160]", "solid.bodies.tube.spacing=0.25 mm"]), ranks=2)
    assert "25,600 cells" in text
    assert re.search(r"6 of 128 x 64 cells; (\d) to (\d) on each of 2 ranks", text)
    assert "16 particles, 8 cells" in text
    assert "3 have none" in report(load(SOD, ["performance.block_cells=400"]), ranks=4)


def test_former_words_are_in_the_report():
    notes = [line for line in report(load(TUBE, ["coupling.scheme=stairs"])).splitlines() if line.startswith("  note ")]
    assert len(notes) == 1 and "'stairs' is called 'staircase' now" in notes[0]


def test_check_by_the_command_line(tmp_path, monkeypatch):
    command = [sys.executable, "-m", "distfsi", "check", str(SOD), "--ranks", "2"]
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert told.returncode == 0 and told.stderr == ""
    assert told.stdout.startswith("Sod's shock tube\n")


def test_check_draws_the_scene(tmp_path, monkeypatch, capsys):
    """Sections in any number of dimensions, and a view in three."""
    pytest.importorskip("vtk")
    monkeypatch.chdir(tmp_path)
    drop = "[domain]\nlower = [0, 0, 0]\nupper = [1, 1, 1]\ncells = [4, 4, 4]\n[time]\nend = 1.0\n"
    gas = '[fluid.phases.air]\neos = "ideal_gas"\ngamma = 1.4\n[[fluid.regions]]\nphase = "air"\ndensity = 1.0\n'
    more = 'pressure = 1.0\n[[fluid.regions]]\nphase = "air"\ndensity = 2.0\npressure = 2.0\n'
    region = 'shape = { kind = "ball", center = [0.2, 0.2, 0.2], radius = 0.1 }\n'
    block = 'spacing = 0.1\nshape = { kind = "box", lower = [0.4, 0.4, 0.4], upper = [0.8, 0.6, 0.6] }\n'
    gauge = '[gauges.near]\nkind = "point"\nposition = [0.9, 0.9, 0.9]\n'
    (tmp_path / "drop.toml").write_text(drop + gas + more + region + "[solid.obstacles.block]\n" + block + gauge)
    main(["check", str(SOD), "--picture", "sod.png"])
    main(["check", "drop.toml", "--picture"])
    assert capsys.readouterr().out.splitlines()[-2:] == ["drop-scene.png", "drop-scene-view.png"]
    for name in ("sod", "drop-scene", "drop-scene-view"):
        assert np.ptp(pixels(tmp_path / f"{name}.png")) > 100


def pixels(path):
    """(rows, columns, 3) of 0 to 255."""
    return np.asarray(Image.open(path).convert("RGB"))


# ---- steps -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("left", "right", "eos"),
    [
        (
            (PureState(1.0, 1.0), Side(IdealGas(1.4), 1.0, 1.0, 0.0)),
            (PureState(0.125, 0.1), Side(IdealGas(1.4), 0.125, 0.1, 0.0)),
            (AIR, AIR),
        ),
        (
            (WATER_AIR.left, Side(StiffenedGas(4.4, 6e8), 1000.0, 1e9, 0.0)),
            (WATER_AIR.right, Side(IdealGas(1.4), 50.0, 1e5, 0.0)),
            (WATER_AIR.eos_left, WATER_AIR.eos_right),
        ),
    ],
    ids=["sod", "water_air"],
)
def test_meeting_states_form_those_of_the_exact_solution(left, right, eos):
    exact = exact_riemann(left[0], right[0], *eos)
    states = meet(left[1], right[1])
    assert [state.velocity for state in states[1:3]] == pytest.approx([exact.u_star] * 2, rel=1e-4)
    assert states[0].velocity == states[3].velocity == 0.0


def test_burnt_tnt_in_air():
    tnt, air = Jwl(1630.0, 3.712e11, 3.21e9, 4.15, 0.95, 0.3), IdealGas(1.4)
    _, products, shocked, _ = meet(Side(tnt, 1630.0, 8.376e9, 0.0), Side(air, 1.225, 101325.0, 0.0))
    assert products.velocity == shocked.velocity > 3000.0
    strong = 0.5 * 2.4 * 1.225 * shocked.velocity**2  # pressure behind a strong shock in air, (gamma + 1)/2 rho u^2
    assert shocked.sound == pytest.approx((1.4 * strong / (6.0 * 1.225)) ** 0.5, rel=0.02)


def test_vacuum_and_tension_do_not_stop_the_estimate():
    air, water = IdealGas(1.4), StiffenedGas(4.4, 6e8)
    apart = meet(Side(air, 1.0, 1.0, -20.0), Side(air, 1.0, 1.0, -20.0))
    assert [state.velocity for state in apart] == [-20.0, 20.0]
    assert len(meet(Side(water, 1000.0, -1e5, 0.0), Side(water, 1000.0, 1e5, 0.0))) == 2


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("sod", []),
        ("water_air", []),
        ("plate_impact", []),
        ("steel_tube", ["domain.cells=[48, 48]", "solid.bodies.tube.spacing=0.8 mm", "time.end=4 us"]),
        ("steel_tube_full", ["domain.cells=[80, 80]", "solid.bodies.tube.spacing=1 mm", "time.end=4 us"]),
        ("shock_bubble", ["domain.cells=[130, 36]", "time.end=20"]),
    ],
)
def test_steps_are_those_of_the_run(tmp_path, name, changes):
    scene = load(ROOT / "inputs" / f"{name}.toml", [*changes, f'output.directory="{tmp_path}"'])
    taken = run(scene, Communicator(), threads=1).steps
    assert steps(scene, Layout(scene) if scene.fluid else None) == pytest.approx(taken, rel=0.25)


# ---- memory and output -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", [gases((40, 30), (IdealGas(1.4),), (1.0, 2.0), (1.0, 1.0)), blast_on_copper(24, 3)])
def test_fields_are_those_of_the_run(scene):
    resources = Resources(scene, 1)
    simulation = Simulation.of(scene, Communicator(), 1)
    cells, _ = simulation.outputs()
    made = simulation.fluid.memory() + sum(field.nbytes for field in cells.values())
    if simulation.coupling:
        made += simulation.coupling.memory()
        assert resources.particles == len(simulation.solid.columns["id"])
    assert resources.field_bytes(simulation.blocks) == made


@pytest.mark.parametrize("name", ["sod", "plate_impact", "steel_tube"])
def test_files_are_as_large_as_told(tmp_path, name):
    changes = ["time.maximum_steps=2", "domain.cells=[64, 64]", "solid.bodies.tube.spacing=0.5 mm"]
    changes = changes if name == "steel_tube" else changes[:1]
    scene = load(ROOT / "inputs" / f"{name}.toml", [*changes, f'output.directory="{tmp_path}"'])
    run(scene, Communicator(), threads=1)
    written = sum(path.stat().st_size for path in tmp_path.glob("*-000000.vtkhdf"))
    overhead = 60e3  # of HDF5
    assert Resources(scene, 1).output_bytes() == pytest.approx(written, rel=0.1, abs=overhead)


def test_all_blocks_and_particles_are_counted_on_any_number_of_ranks():
    scene = load(TUBE)
    one, three = Resources(scene, 1), Resources(scene, 3)
    assert [blocks.local_count for blocks in one.blocks] == [6]
    assert sum(blocks.local_count for blocks in three.blocks) == 6
    assert three.particles_of_ranks.sum() == one.particles == one.particles_of_ranks[0]
    assert np.array_equal(deal_blocks(scene, Communicator()).owners, one.blocks[0].owners)
    assert three.memory() < one.memory()


MEMORY = """
import os, resource, sys
from distfsi.commands.line import main
main(["run", *sys.argv[1:]])
line = f"peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024}\\n"
os.write(1, line.encode())  # at once: ranks share the pipe
"""


@pytest.mark.full
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_memory_is_that_of_the_run(tmp_path, request, path, ranks):
    """Within 10 %, kernels compiled before."""
    if (path.stem, ranks) == ("undex_plate", 2):
        reason = "the rank with the plate takes 519 MB when its bonds are made, 422 MB are told"
        request.applymarker(pytest.mark.xfail(strict=True, reason=reason))
    scene = load(path)
    changes = ["--set", "time.maximum_steps=20", "--set", f"output.directory={tmp_path}"]
    for stage in range(len(scene.stages)):
        changes += ["--set", f"stages.{stage}.time.maximum_steps=20"]
    command = ["-c", MEMORY, str(path), "--threads", "1", *changes]
    told = run_ranks(ranks, command, 280)
    if "compiling kernel" in told:  # which takes memory of its own
        told = run_ranks(ranks, command, 280)
    peaks = [float(bytes_) for bytes_ in re.findall(r"peak (\d+)", told)]  # not always at the start of a line
    assert len(peaks) == ranks
    assert Resources(scene, ranks).memory() == pytest.approx(max(peaks), rel=0.1)


# ---- time ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """A bench is kept in a place of its own."""
    monkeypatch.setattr(bench, "cache_directory", lambda: tmp_path)


def test_a_bench_is_kept_for_this_version_only(kept, monkeypatch):
    assert bench.kept_bench() is None
    bench._write(bench._kept_file(), {"distfsi": bench.__version__, "ranks": 1})
    assert bench.kept_bench()["ranks"] == 1
    monkeypatch.setattr(bench, "__version__", "another")
    assert bench.kept_bench() is None


def test_a_partial_bench_is_printed_but_not_kept(kept, capsys):
    result = bench.main(Communicator(), 1, "smallest_fluid", seconds=0.01)
    assert json.loads(capsys.readouterr().out) == result
    assert result["smallest_fluid"]["seconds_per_step"] > 0.0
    assert bench.kept_bench() is None


def test_a_bench_that_was_interrupted_goes_on(kept, monkeypatch, capsys):
    """Each measurement is told on standard error and kept at once."""
    for name in ("SMALLEST", "SIZES", "SOLIDS", "COUPLED"):
        monkeypatch.setattr(bench, name, {})
    measured = []

    def fake(work, *_):
        if work == 3 and len(measured) == 2:
            raise KeyboardInterrupt
        measured.append(work)
        return {"speed": float(work)}

    monkeypatch.setattr(bench, "FLUIDS", {f"flow {n}": lambda n=n: n for n in (1, 2, 3)})
    monkeypatch.setattr(bench, "bench_fluid", fake)
    with pytest.raises(KeyboardInterrupt):
        bench.main(Communicator(), 1)
    assert "2 of 3: flow 2" in capsys.readouterr().err
    assert bench.kept_bench() is None
    monkeypatch.setattr(bench, "bench_fluid", lambda work, *_: {"speed": 10.0 * work})
    result = bench.main(Communicator(), 1)
    assert [result[f"flow {n}"]["speed"] for n in (1, 2, 3)] == [1.0, 2.0, 30.0]
    assert bench.kept_bench() == result
    assert bench.main(Communicator(), 1)["flow 1"]["speed"] == 10.0  # a complete one begins anew


FIXED = {"start_seconds": 1.0, "seconds_per_step": 9e-4, "history_row_seconds": 1e-3}
RATES = {
    "ranks": 1,
    "threads_per_rank": 1,
    **{f"smallest_{name}": FIXED for name in SMALLEST},
    **{f"shock_bubble_{d}d": {"cell_stages_per_second": 3e7 / d} for d in (1, 3)},
    "shock_bubble_2d": {"cell_stages_per_second": 1.5e7, "cells": 1000, "history_row_seconds": 1e-4},
    "shock_bubble_2d_float32": {"cell_stages_per_second": 3e7},
    **{f"{name}_2d": {"cell_stages_per_second": 6e6} for name in ("water_air", "tnt_air", "euler")},
    **{f"copper_block_{d}d": {"particle_steps_per_second": 1e6} for d in (1, 2, 3)},
    **{f"blast_on_copper_{d}d": {"band_cells": 10, "particles": 1000, "wall_seconds_per_step": 1e-3} for d in (2, 3)},
    **{f"blast_on_plate_{d}d": {"band_cells": 100, "particles": 100, "wall_seconds_per_step": 1e-3} for d in (2, 3)},
}


def test_the_time_is_start_and_steps_and_files():
    def seconds(path, ranks, threads, *changes):
        resources = Resources(load(path, changes), ranks)
        files = resources.output_times() * (0.01 + resources.output_bytes() / 5e8)
        return (resources.seconds(threads, RATES) - 1.25 - files) / resources.steps

    bubble, whole = ROOT / "inputs" / "shock_bubble.toml", "performance.tile_cells=[128, 64]"
    one, four = seconds(bubble, 1, 1), seconds(bubble, 2, 2)
    row = 462800 * 1e-7 / 10
    assert 0.9 * 3 * 462800 / 1.5e7 < one - 1e-3 - row < 3 * 462800 / 1.5e7
    assert four - 1e-3 == pytest.approx((one - 1e-3) / 4)
    tube = Resources(load(TUBE), 1)
    moving, neighbours = moving_share(tube.scene, tube.layout), (tube.scene.solid.smoothing / 1.3) ** 2
    per_cell, per_particle = np.linalg.solve([[10, 1000], [100, 100]], [1e-3, 1e-3])
    wall = tube.band_cells * per_cell + tube.particles * per_particle
    solid = sub_steps(tube.scene, tube.layout) * tube.particles * neighbours * 1e-6
    coupled = 1e-3 + moving * 3 * tube.cells / 6e6 + solid + wall + tube.cells * 1e-8
    assert seconds(TUBE, 1, 1) == pytest.approx(coupled)
    assert seconds(bubble, 1, 1, "time.maximum_steps=10", whole) < 0.5 * one  # most of the air is still at rest
    assert "on 2 rank(s) of 1 thread(s), by the bench of this machine" in report(tube.scene, 2, 1, RATES)


@pytest.mark.idle
def test_the_time_is_that_of_the_run(tmp_path, kept):
    """Within a factor of 1.5 on a machine that does nothing else; the best of three runs; the first compiles."""
    measured = bench.main(Communicator(), 1, None, seconds=0.2)
    for path in INPUTS:
        changes = ["time.maximum_steps=200", f"output.directory={tmp_path}"]
        options = [word for change in changes for word in ("--set", change)]
        command = [sys.executable, "-m", "distfsi", "run", str(path), "--threads", "1", *options]
        told = [subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout for _ in range(3)]
        taken = min(float(text.split(" steps in ")[1].split()[0]) for text in told)
        expected = Resources(load(path, changes), 1).seconds(1, measured)
        assert (taken - 0.05) / 1.5 < expected < (taken + 0.05) * 1.5, (path.stem, expected, taken)  # printed to 0.1 s


# ---- advice ----------------------------------------------------------------------------------------------------------


def test_advice_on_what_looks_wrong():
    changes = ["solid.bodies.tube.spacing=0.35 mm", "output.fields_every=1", "domain.cells=[160, 80]"]
    told = "\n".join(advised(load(TUBE, [*changes, "fluid.regions.1.phase=air", "fluid.regions.1.density=1"])))
    for words in ("0.7 cells apart", "longer than the run", "2 times longer than wide", "'products' is nowhere"):
        assert words in told
    thin = "\n".join(advised(load(TUBE, ["solid.bodies.tube.shape.inner_radius=0.0335"])))
    assert "fewer than 4 particles" in thin
    assert "thinner than sqrt(2) cells" in thin


def test_bodies_that_touch_and_do_not_hold_together_are_named(tmp_path):
    """A stiffener on its plate, unless it is tied to it or flies towards it."""
    body = """
[solid.bodies.NAME]
spacing = 0.05
material = "steel_4340"
shape = { kind = "box", lower = LOWER, upper = UPPER }
"""
    plate = body.replace("NAME", "plate").replace("LOWER", "[0.1, 0.1]").replace("UPPER", "[0.9, 0.3]")
    web = body.replace("NAME", "web").replace("LOWER", "[0.4, 0.3]").replace("UPPER", "[0.6, 0.7]")
    domain = "[domain]\nlower = [0, 0]\nupper = [1, 1]\ncells = [10, 10]\n[time]\nend = 1e-3\n"
    (tmp_path / "tee.toml").write_text(domain + plate + web)
    found = [
        [text for text in advised(load(tmp_path / "tee.toml", changes)) if "hold together" in text]
        for changes in ((), ('solid.tied=[["plate", "web"]]',), ("solid.bodies.web.velocity=[0.0, -1.0]",))
    ]
    assert [len(texts) for texts in found] == [1, 0, 0]
    assert 'solid.tied = [["plate", "web"]]' in found[0][0]


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("sod", ["fluid.regions.1.shape.point=2"], "nothing moves"),
        ("sod", ["domain.upper=4", "domain.cells=1600"], "no wave comes nearer to the high x end than 3.06 m"),
        ("sod", ["domain.lower=-3", "domain.cells=1600"], "no wave comes nearer to the low x end than 3.06 m"),
        ("water_air", ["fluid.regions.1.shape.point=2 m"], "phase 'air' fills no cell"),
        ("water_air", ["fluid.regions.1.density=1.2"], "let go from 1e+09 to 5.41e+05 Pa"),
        (
            "shock_bubble",
            ["fluid.regions.2.shape={kind='half_space', point=[225, 0], normal=[1, 0]}"],
            "nothing varies along y: 1 dimension(s) without it",
        ),
        ("shock_bubble", ["domain.cells=[4875, 1335]"], "750 cells across"),
        ("steel_tube", ["time.end=1 us"], "no wave comes nearer to the high y end than 0.0"),
    ],
)
def test_excess_is_named(name, changes, words):
    told = advised(load(ROOT / "inputs" / f"{name}.toml", changes))
    assert sum(words in text for text in told) == 1


def test_the_share_of_the_domain_that_waves_reach():
    def share(*changes):
        scene = load(SOD, ["performance.tile_cells=10", *changes])
        return moving_share(scene, Layout(scene))

    reach = 2.19157 * 0.2  # fastest signal times end: all tiles within it compute, half of the time on average
    assert share() == pytest.approx(2 * reach / 2, abs=0.03)
    assert share("time.end=20") == pytest.approx(1.0, abs=0.02)
    assert share("performance.tile_cells=400") == 1.0
    assert share("fluid.regions.1.shape.point=2") == 0.0
    assert share("fluid.regions.1.shape.point=2", "domain.gravity=9.81") == 1.0


BLAST = """
[domain]
lower = [-1, -1, 0]
upper = [1, 1, 2]
cells = [40, 40, 40]
[time]
end = "1 ms"
[fluid.phases]
air = {eos = "ideal_gas", gamma = 1.4}
[[fluid.regions]]
phase = "air"
density = 1.2
pressure = 1e5
[[fluid.regions]]
phase = "air"
density = 1.2
pressure = 1e7
shape = {kind = "ball", center = [0, 0, 0.5], radius = 0.2}
"""


@pytest.mark.parametrize(
    ("changes", "axes"),
    [
        ([], ["x"]),  # a single ball is symmetric about all three; one is enough to tell
        (['domain.z=["wall", "outflow"]'], ["z"]),
        (['domain.z=["wall", "outflow"]', "fluid.regions.0.velocity=[1, 0, 0]"], []),
        (['domain.z=["wall", "outflow"]', 'domain.x=["wall", "outflow"]'], []),
        (
            [
                'domain.x=["symmetry", "outflow"]',
                "domain.lower=[0, -1, 0]",
                "domain.cells=[20, 40, 40]",
                'domain.z=["wall", "outflow"]',
            ],
            [],
        ),
        (['domain.z=["wall", "outflow"]', "domain.gravity=[0, 0, -9.81]"], ["z"]),
        (["fluid.regions.1.shape={kind='box', lower=[-0.1, -0.1, 0], upper=[0.1, 0.1, 1]}"], []),
    ],
)
def test_a_line_of_symmetry_in_three_dimensions_is_named(tmp_path, changes, axes):
    path = tmp_path / "blast.toml"
    path.write_text(BLAST)
    told = [text for text in advised(load(path, changes)) if "symmetric about a line" in text]
    assert [text.split("along ")[1][0] for text in told] == axes
