"""`distfsi new`: scenes that are well posed, by what is known of blasts."""

import sys

import numpy as np
import pytest

from distfsi.air_blast import FREE_AIR, SURFACE, air_blast
from distfsi.commands import new
from distfsi.commands.line import main
from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.report.results import blasts, burst_of
from distfsi.resources.new_scene import Blast
from distfsi.resources.report import report
from distfsi.results import Results
from distfsi.scene import load
from distfsi.scene.placed_charges import charges
from distfsi.scene.warnings import warnings

BLASTS = [
    Blast(tnt, distance, wall) for tnt, distance in ((5.0, 3.0), (0.1, 2.0), (500.0, 20.0)) for wall in (True, False)
]


@pytest.fixture
def written(tmp_path):
    """Writes the text of a blast into a file, and loads it."""

    def load_text(blast):
        path = tmp_path / "blast.toml"
        path.write_text(blast.text())
        return load(path)

    return load_text


@pytest.mark.parametrize("blast", BLASTS, ids=str)
def test_check_finds_nothing_to_say(written, blast):
    """Charge, mass, ends and times are those of the blast, whatever its size; the report knows its curves."""
    scene = written(blast)
    for each in (*scene.stages, scene):
        assert list(warnings(each)) == []
        assert "verdict    well posed" in report(each)
    first = (*scene.stages, scene)[0]
    (charge,) = charges(first)
    assert charge.cells >= 20.0 - 1e-6
    assert charge.placed == pytest.approx(blast.tnt * (2.0 if blast.wall else 1.0), rel=1e-3)
    burst, curves = burst_of(scene), air_blast(blast.tnt, blast.distance, SURFACE if blast.wall else FREE_AIR)
    assert burst.on_ground is blast.wall
    assert burst.tnt == pytest.approx(1.026 * blast.tnt, rel=2e-3)
    assert scene.time.end > curves.arrival + 1.2 * curves.duration
    if blast.wall:
        (stage,) = scene.stages
        assert stage.time.end < curves.arrival
        assert stage.domain.upper[0] >= scene.domain.upper[0] == blast.distance
        assert np.ptp(scene.domain.spacing) < 1e-9
        assert f"{1e-3 * curves.reflected_pressure:.4g} kPa reflected" in blast.text()


def test_the_command_writes_a_new_file_and_no_other(tmp_path, capsys):
    path = tmp_path / "wall.toml"
    words = ["new", "--tnt", "11 lb", "--range", "10 ft", "--wall", "-o", str(path)]
    main(words)
    assert capsys.readouterr().out.startswith(f"{path}\n  distfsi check {path}")
    assert load(path).title == "4.98952 kg of TNT on the ground, 3.048 m before a wall"
    for wrong, fault in (
        (words, "wall.toml: is there already"),
        (["new", "--tnt", "5 kg"], "--range: is missing"),
        (["new", "--tnt", "5 kg", "--range", "3 m", "--cells", "9"], "--cells: is of a scene with --wall"),
        (["new", "--tnt", "5 kg", "--range", "1 km", "-o", f"{tmp_path}/x"], "--range 1000 m: scaled distance 584.8"),
        (["new", "--tnt", "5 kg", "--range", "10 cm", "-o", f"{tmp_path}/x"], "--range 0.1 m: "),
    ):
        with pytest.raises(InputError, match=fault):
            main(wrong)
    assert [each.name for each in tmp_path.iterdir()] == ["wall.toml"]


def test_on_a_terminal_it_asks(tmp_path, monkeypatch, capsys):
    """Wrong answers are asked again, no answer means what stands in brackets, and flags are not asked for."""
    answers = iter(["five", "5 kg", "", "perhaps", "yes", "20", str(tmp_path / "asked.toml")])
    questions = []
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr("builtins.input", lambda question: (questions.append(question), next(answers))[1])
    main(["new"])
    scene = load(tmp_path / "asked.toml")
    assert (scene.title, scene.domain.cells[0]) == ("5 kg of TNT on the ground, 3 m before a wall", 20)
    assert [question.split(" [")[0] for question in questions] == [
        *["Mass of TNT"] * 2,
        "Distance from the charge",
        *["A wall there, and the charge on the ground (yes or no)"] * 2,
        "Cells between charge and wall",
        "File to write",
    ]
    assert next(answers, None) is None and new.OUTPUT.name == "blast.toml"


@pytest.mark.full
def test_the_foot_of_the_wall_gets_the_impulse_of_the_curves(written, tmp_path, monkeypatch):
    """Coarse cells have the impulse of UFC 3-340-02 within 15 %, and of the peak what finer ones approach."""
    monkeypatch.chdir(tmp_path)
    run(written(Blast(5.0, 3.0, wall=True, cells=30)), Communicator())
    (found,) = blasts(Results("out/blast"))
    peak, arrival, impulse = found.expected
    assert found.kind == "reflected, hemisphere on the ground"
    assert found.impulse == pytest.approx(impulse, rel=0.15)
    assert found.arrival == pytest.approx(arrival, rel=0.15)
    assert 0.4 * peak < found.peak < peak
