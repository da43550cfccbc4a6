"""Broken inputs: every fault is listed, nothing is left behind, and no traceback is shown."""

import contextlib
import math
import re
import subprocess
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from distfsi.commands.line import main
from distfsi.errors import InputError
from distfsi.resources.report import report
from distfsi.scene import load
from launch import ROOT

INPUTS = {path.stem: path.read_text() for path in sorted((ROOT / "inputs").glob("*.toml"))}
SOD, TUBE, BUBBLE, PLATES = (INPUTS[name] for name in ("sod", "steel_tube", "shock_bubble", "plate_impact"))
THREE = INPUTS["three_materials"]
THIRD = "[fluid.phases.third]\neos = 'ideal_gas'\ngamma = 1.4\n"


def changed(text, *changes):
    """`text` with lines replaced: each change is (start of a line, what stands there instead)."""
    for start, instead in changes:
        text, count = re.subn(rf"^{re.escape(start)}.*$", lambda _: instead, text, count=1, flags=re.MULTILINE)  # noqa: B023
        assert count == 1, start
    return text


# Each broken input and what its faults say, one text per fault.
BROKEN = [
    ("", ["domain: is missing", "time: is missing", "has no material"]),
    ("[domain", ["is no TOML"]),
    ("title = 'a'\ntitle = 'b'", ["is no TOML"]),
    (changed(SOD, ("[domain]", "[domian]")), ["did you mean 'domain'?"]),
    (changed(SOD, ("lower", "")), ["domain.lower (line 12): is missing; expected low corner [m]"]),
    (changed(SOD, ("lower", 'lower = "1 s"')), ["has units s, needs m"]),
    (changed(SOD, ("lower", "lower = 2")), ["domain.upper (line 14): must be greater than lower along x"]),
    (changed(SOD, ("upper", "upper = nan")), ["is not finite"]),
    (changed(SOD, ("upper", "upper = true")), ["is no number"]),
    (changed(SOD, ("cells", "cells = 0")), ["must be >= 1"]),
    (changed(SOD, ("cells", "cells = 1.5")), ["it should be a valid integer"]),
    (changed(SOD, ("cells", 'cells = "many"')), ["it should be a valid integer"]),
    (changed(SOD, ("cells", "cells = [4, 4, 4, 4]")), ["domain.cells", "lower", "upper", "point", "normal"]),
    (changed(SOD, ("cells", "cells = [10, 10]")), ["domain.lower", "domain.upper", "point", "normal"]),
    (changed(SOD, ("cells", "cells = 1_000_000_000_000")), ["1.0e+12 cells; at most 1e+11"]),
    (changed(SOD, ("cells", "cells = 400\nx = ['wal', 'wall']")), ["did you mean 'wall'?"]),
    (changed(SOD, ("cells", "cells = 400\nx = ['periodic', 'wall']")), ["one end is periodic"]),
    (changed(SOD, ("cells", "cells = 400\nx = ['inflow', 'wall']")), ["fluid.inflow.x_low: is missing"]),
    (changed(SOD, ("cells", "cells = 400\nz = ['wall', 'wall']")), ["so no z ends"]),
    (changed(SOD, ("end", "end = 0")), ["must be > 0"]),
    (changed(SOD, ("end", "end = -1e-6")), ["must be > 0"]),
    (changed(SOD, ("end", 'end = "20 µs 3"')), ["time.end"]),
    (changed(SOD, ("end", "end = 1\ncfl = 1.5")), ["must be <= 1"]),
    (changed(SOD, ("end", "end = 1\nmaximum_steps = 0")), ["must be >= 1"]),
    (changed(SOD, ("[time]", "[tiem]")), ["did you mean 'time'?"]),
    (changed(SOD, ("eos", 'eos = "ideal"')), ["did you mean 'ideal_gas'?"]),
    (changed(SOD, ("eos", "")), ["expected one of"]),
    (changed(SOD, ("gamma", "gamma = 1")), ["must be > 1"]),
    (changed(SOD, ("gamma", "gama = 1.4")), ["did you mean 'gamma'?"]),
    (changed(SOD, ("phase", 'phase = "gsa"')), ["did you mean 'gas'?"]),
    (changed(SOD, ("[fluid.phases", "[fluid]\nsharpening = true\n[fluid.phases.gas]")), ["needs an interface"]),
    (changed(SOD, ("density", "density = 0")), ["must be > 0"]),
    (changed(SOD, ("density", "density = 1\nvolume_fraction = 0.5")), ["volume_fraction (line 27): needs two phases"]),
    (changed(BUBBLE, ("density", "density = 1\nvolume_fraction = 1e-9")), ["expected 1e-06 to 1 - 1e-06"]),
    (changed(SOD, ("density", 'density = "1 kg"')), ["has units kg, needs kg/m3"]),
    (changed(SOD, ("pressure", "")), ["give either pressure or energy"]),
    (changed(SOD, ("pressure", "pressure = 1\nenergy = 1")), ["not both"]),
    (changed(SOD, ("pressure", "pressure = -1")), ["too low: at this density 'gas' has a sound speed only above 0 Pa"]),
    (changed(SOD, ("pressure", "pressure = 1\nshape = {kind = 'box', lower = 0, upper = 1}")), ["expected no shape"]),
    (changed(SOD, ("shape", "")), ["only the first region has no shape"]),
    (changed(SOD, ("shape", "shape = {kind = 'box', lower = 1, upper = 0}")), ["lower must lie below upper"]),
    (changed(SOD, ("shape", "shape = {kind = 'ball', center = 0, radius = -1}")), ["must be > 0"]),
    (
        changed(SOD, ("shape", "shape = {kind = 'half_space', point = 0, normal = 0}")),
        ["0 is no direction"],
    ),
    (changed(SOD, ("shape", "shape = 3")), ["expected a table"]),
    (SOD + "[fluid.phases.second]\n[fluid.phases.third]\n", ["second.eos", "third.eos"]),
    (SOD + "".join(f"[fluid.phases.{a}]\neos = 'ideal_gas'\ngamma = 1.4\n" for a in "abcde"), ["fluid.phases"]),
    (
        changed(THREE, ("[fluid]", "[fluid]\nminimum_volume_fraction = 0.3\nmap.run = 'run'")),
        ["traces of 2 absent phases too much", "is known of one or two phases only"],
    ),
    (changed(THREE, ("density", "density = 1630\nvolume_fraction = 0.5")), ["needs two phases, and no more"]),
    (THREE.replace("phases.air]", "phases.'a/b']").replace('"air"', '"a/b"'), ["names a field"]),
    (TUBE + THIRD, ["beside a solid one or two phases"]),
    (SOD + "[output]\nfields_every = -1\nhistory_every = 0\n", ["must be >= 0", "must be >= 1"]),
    (SOD + "[performance]\nblock_cells = [2]\ntile_cells = [0]\n", ["must be >= 4", "must be >= 1"]),
    (SOD + "[performance]\nblock_cells = 8\ntile_cells = [4, 4]\n", ["has 2 entries, needs 1"]),
    (SOD + "[gauges.a]\nkind = 'pint'\n", ["did you mean 'point'?"]),
    (SOD + "[solid.bodies.a]\n", ["shape", "spacing", "density", "eos", "strength"]),
    (changed(BUBBLE, ("[fluid.inflow.x_high]", "[fluid.inflow.y_low]")), ["fluid.inflow.x_high", "fluid.inflow.y_low"]),
    (changed(BUBBLE, ("velocity", "velocity = [1]")), ["has 1 entries, needs 2"]),
    (
        changed(TUBE, ("[fluid.phases.products]", "[fluid]\nreconstruction = 'weno5'\n[fluid.phases.products]")),
        ["'weno5' looks past the cells beside a solid"],
    ),
    (changed(TUBE, ("rho0", "")), ["fluid.phases.products.rho0"]),
    (changed(TUBE, ("R1", 'R1 = "4 m"')), ["has units m, needs a pure number"]),
    (changed(TUBE, ("energy", 'energy = "1 MJ/kg"')), ["has a sound speed only above"]),
    (changed(TUBE, ("spacing", 'spacing = "2 mm"')), ["is too coarse for the fluid cells"]),
    (changed(TUBE, ("spacing", 'spacing = "1 nm"')), ["particles; at most 1e+08"]),
    (changed(TUBE, ("x =", 'x = ["wall", "outflow"]')), ["only 'symmetry' may cut a body"]),
    (changed(TUBE, ("kind =", 'kind = "jonson_cook"')), ["did you mean 'johnson_cook'?"]),
    (changed(TUBE, ("n = ", "n = 0")), ["must be > 0"]),
    (changed(TUBE, ("melt_temperature", "melt_temperature = 100")), ["must be above room_temperature"]),
    (changed(TUBE, ("melt_temperature", 'melt_temperature = "20 degC"')), ["temperatures are given in K"]),
    (changed(TUBE, ('density = "7830', "density = 0")), ["must be > 0"]),
    (changed(PLATES, ("[solid.bodies.right]", "[solid.bodies.left]")), ["is no TOML"]),
    (
        changed(PLATES, ("[solid.bodies.left]", "[solid]\nartificial_stress = 0.3\n[solid.bodies.left]")),
        ["solid.artificial_stress (line 23): bonds cannot clump; it needs form"],
    ),
    (changed(PLATES, ("shape", 'shape = {kind = "box", lower = "-10 mm", upper = "1 mm"}')), ["overlaps body 'left'"]),
    (
        changed(PLATES, ("shape", 'shape = {kind = "box", lower = "1 m", upper = "2 m"}')),
        ["reaches beyond", "no particle"],
    ),
]


@pytest.mark.parametrize(("text", "faults"), BROKEN, ids=[" + ".join(faults)[:60] for _, faults in BROKEN])
def test_a_broken_input_is_refused_with_all_its_faults(tmp_path, monkeypatch, capsys, text, faults):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.toml").write_text(text)
    for command in (["broken.toml"], ["check", "broken.toml"]):
        with pytest.raises((SystemExit, InputError)) as ended:
            main(command)
        if isinstance(ended.value, InputError):  # told by the interpreter's entry, see the next test
            told = ended.value.faults
            assert ended.value.exit_code == 2
        else:
            told = capsys.readouterr().err.splitlines()
            assert ended.value.code == 2
        assert len(told) == len(faults), told
        assert all(line.startswith("broken.toml: ") for line in told)
        for words in faults:
            assert any(words in line for line in told), (words, told)
    assert [path.name for path in tmp_path.iterdir()] == ["broken.toml"]


def test_there_are_fifty():
    assert len(BROKEN) >= 50


@pytest.mark.parametrize("command", [[], ["run"], ["check"]])
@pytest.mark.parametrize(("text", "count"), [(BROKEN[0][0], 3), (changed(SOD, ("gamma", "gama = 1.4")), 1)])
def test_the_command_line_refuses_it(tmp_path, command, text, count):
    (tmp_path / "broken.toml").write_text(text)
    words = [sys.executable, "-m", "distfsi", *command, "broken.toml"]
    ended = subprocess.run(
        words, cwd=tmp_path, env={"PYTHONPATH": str(ROOT), "PATH": ""}, capture_output=True, text=True, timeout=120
    )
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert len(ended.stderr.splitlines()) == count
    assert "Traceback" not in ended.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["broken.toml"]


@pytest.mark.parametrize(
    "words", [["no_such_file"], ["check"], ["run", "x.toml", "--threads", "two"], ["check", "x.toml", "--ranks", "0"]]
)
def test_a_wrong_command_line_is_refused(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((SystemExit, InputError)) as ended:
        main(words)
    assert getattr(ended.value, "code", None) == 2 or ended.value.exit_code == 2
    assert list(tmp_path.iterdir()) == []


# ---- any mutation ----------------------------------------------------------------------------------------------------

NUMBERS = (
    st.integers(-3, 10**13) | st.floats() | st.sampled_from([0, -0.0, 1e300, -1e300, 1e-300, 5e-324, 10**30, 10**400])
)
TEXTS = st.sampled_from(
    ["", "wall", "1 mm", "-3 GPa", "1e999 m", "9" * 400, "none", "box", "µ", "1 m/", "[", "x" * 300, "JWL"]
)
SCALARS = NUMBERS | TEXTS | st.booleans()
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from("abx"), inner, max_size=2),
    max_leaves=4,
)


def toml(value):
    """A value as TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {toml(item)}' for key, item in value.items())}}}"
    return repr(value) if isinstance(value, int | float) else f"'{value}'"


@st.composite
def mutations(draw):
    """A shipped input with one to three lines removed, doubled, moved or given another value."""
    lines = draw(st.sampled_from(sorted(INPUTS.values()))).splitlines()
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.sampled_from([n for n, line in enumerate(lines) if line and not line.startswith("#")]))
        key, equals, _ = lines[at].partition(" = ")
        kind = draw(st.sampled_from(["value"] * 4 + ["remove", "double", "move"]))
        if kind == "value" and equals:
            lines[at] = f"{key} = {toml(draw(VALUES))}"
        elif kind == "double":
            lines.insert(at, lines[at])
        else:
            line = lines.pop(at)
            if kind == "move":
                lines.insert(draw(st.integers(0, len(lines))), line)
    return "\n".join(lines)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutations())
def test_any_mutation_gets_a_report_or_is_refused(tmp_path, text):
    path = tmp_path / "mutated.toml"
    path.write_text(text)
    try:
        scene = load(path)
    except InputError as error:
        faults = error.faults or ["refused without a word"]
        assert all(line.startswith(("mutated.toml: ", f"{path}: ")) for line in faults)  # noqa: PT017
    else:
        if math.prod(scene.domain.cells) < 1e6:
            assert report(scene).startswith(scene.title)


RAW = (
    *("domain.symmetry", "domain.cells", "time", "output", "stages", "stages.0", "charges", "charges.0.material"),
    *("charges.0.mass", "fluid", "fluid.regions", "fluid.phases", "fluid.phases.air", "fluid.phases.air.material"),
    *("fluid.detonation", "fluid.detonation.detonators", "fluid.map", "fluid.afterburn"),
)


@pytest.mark.parametrize("key", RAW)
def test_what_is_read_before_tables_are_checked_may_be_anything(tmp_path, key):
    """Charges, stages and materials change an input before its tables are known to be sound."""
    text = (ROOT / "inputs/airblast_sphere.toml").read_text()
    staged = text + "\n[[stages]]\ntime = { end = 1e-6 }\n"
    for number, scene in enumerate((text, staged)):
        path = tmp_path / f"{number}.toml"
        path.write_text(scene)
        for value in ("[]", "3", '"x"', "{}", "[1]", "true", "[[]]", "[{}]"):
            with contextlib.suppress(InputError):  # and no other error
                load(path, [f"{key}={value}"])
