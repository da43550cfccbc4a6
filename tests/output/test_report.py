"""The report of a run: what its numbers are, and that the page is whole."""

from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from distfsi.air_blast import SURFACE, air_blast
from distfsi.commands.line import main
from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.report.report import write_report
from distfsi.report.results import blasts, burst_of, fragments, motions
from distfsi.scene import load
from launch import ROOT

SPHERE = ROOT / "inputs/airblast_sphere.toml"


class Page(HTMLParser):
    """Tags, ids, targets of links, pictures and text of a page; a tag that is not closed is a fault."""

    VOID = ("meta", "link", "img", "br")

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.links, self.images, self.sources, self.words = [], [], [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.ids += [given["id"]] if "id" in given else []
        self.links += [given["href"]] if tag == "a" else []
        self.images += [given] if tag == "img" else []
        self.sources += [given[key] for key in ("src", "href") if key in given and tag != "a"]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += [data.strip()] if data.strip() and self.open[-1] != "style" else []


@pytest.fixture(scope="module")
def tube(tmp_path_factory):
    """Directory of Sod's tube with a gauge, and a title that is no HTML."""
    directory = tmp_path_factory.mktemp("tube")
    changes = ["domain.cells=50", 'title="A <tube> & more"', "gauges.end={kind='point', position=0.7}"]
    changes.append("output.peaks={ambient_pressure=0.1, arrival_overpressure=0.1}")
    run(load(ROOT / "inputs/sod.toml", [f'output.directory="{directory}"', *changes]), Communicator(), threads=1)
    return directory


def test_a_report_is_one_whole_page_without_network(tube, capsys):
    main(["report", str(tube)])
    assert capsys.readouterr().out == f"{tube}/report.html\n"
    text = (tube / "report.html").read_text()
    page = Page(text)
    assert page.images and all(image["src"].startswith("data:image/png;base64,") for image in page.images)
    assert all(len(image["alt"]) > 10 for image in page.images)
    assert all(source.startswith("data:") for source in page.sources) and "<script" not in text
    assert len(set(page.ids)) == len(page.ids)
    assert page.links and {link.removeprefix("#") for link in page.links} <= set(page.ids)
    assert page.words[0] == "A <tube> & more"
    headings = ("Key results", "Scene as posed", "Fields", "Gauges", "Course of the run", "Warnings", "Cost")
    assert [page.words.index(heading) for heading in (*headings, "How to repeat")] == sorted(
        page.words.index(heading) for heading in (*headings, "How to repeat")
    )
    assert {"end", "x = 0.7 m", "None."} <= set(page.words)
    assert any("--set 'domain.cells=50'" in words for words in page.words)
    write_report(tube)  # it replaces a report, and nothing else


def test_only_a_report_is_replaced(tube, tmp_path):
    mine = tmp_path / "mine.html"
    mine.write_text("<p>mine</p>")
    with pytest.raises(InputError, match="is there and no report"):
        write_report(tube, mine)
    assert mine.read_text() == "<p>mine</p>"
    with pytest.raises(InputError, match=r"no run has left its run\.json there"):
        write_report(tmp_path)


# ---- numbers ---------------------------------------------------------------------------------------------------------


def wave(peak, arrival, impulse):
    """A gauge's table: nothing, then a wave."""
    time = np.array([0.0, arrival, 2.0 * arrival])
    return {"time": time, "overpressure": np.array([0.0, peak, 0.0]), "impulse": np.array([0.0, 0.5, 1.0]) * impulse}


def test_the_blast_stands_beside_the_curves():
    scene = load(SPHERE)
    tnt = burst_of(scene).tnt
    assert tnt == pytest.approx(1.026, rel=1e-3)  # energies of the two sources differ
    expected = air_blast(tnt, 1.0)
    table = wave(1.1 * expected.incident_pressure, expected.arrival, expected.incident_impulse)
    results = SimpleNamespace(scene=scene, journal={"gauges": {"at_1_m": "r = 1 m"}}, gauges={"at_1_m": table})
    (found,) = blasts(results)
    assert (found.gauge, found.location, found.kind) == ("at_1_m", "r = 1 m", "incident, sphere in free air")
    assert found.expected == (expected.incident_pressure, expected.arrival, expected.incident_impulse)
    assert (found.peak, found.arrival) == (1.1 * expected.incident_pressure, expected.arrival)
    assert found.impulse == expected.incident_impulse


GROUND = """
[domain]
lower = [0, 0, 0]
upper = ["3 m", "1.5 m", "1.5 m"]
cells = [30, 15, 15]
x = ["symmetry", "wall"]
y = ["symmetry", "outflow"]
z = ["wall", "outflow"]
[time]
end = "5 ms"
[fluid.phases]
air = { material = "air" }
[[fluid.regions]]
phase = "air"
[[charges]]
material = "TNT"
mass = "1 kg"
shape = "hemisphere"
axis = [0, 0, 1]
center = [0, 0, 0]
[gauges]
foot = { kind = "point", position = [2.95, 0, 0] }
side = { kind = "point", position = [2.95, 1, 0] }
free = { kind = "point", position = [1.5, 0, 0.02] }
"""


def test_a_wall_that_is_met_head_on_has_the_reflected_curves(tmp_path):
    """On the ground the curves are those of a hemisphere; aside at the wall there are none."""
    path = tmp_path / "ground.toml"
    path.write_text(GROUND)
    scene = load(path)
    burst = burst_of(scene)
    assert burst.on_ground
    gauges = {name: wave(1e5, 1e-3, 100.0) for name in scene.gauges}
    found = {each.gauge: each for each in blasts(SimpleNamespace(scene=scene, journal={}, gauges=gauges))}
    assert found["foot"].kind == "reflected, hemisphere on the ground"
    assert found["foot"].expected[0] == air_blast(burst.tnt, 2.95, SURFACE).reflected_pressure
    assert found["free"].kind == "incident, hemisphere on the ground"
    assert (found["side"].kind, found["side"].expected) == ("no curves: at a wall, but not head on", None)


class Files:
    """Results of a bar of copper whose first 12 of 480 particles have come off, 2 of them alone."""

    def __init__(self):
        self.scene = load(ROOT / "inputs/taylor_bar.toml")
        x = np.stack([np.arange(480.0) * 1e-4, np.zeros(480), np.zeros(480)], axis=1)
        piece = np.full(480, 12)
        piece[:10], piece[10], piece[11] = 0, 10, 11
        velocity = np.zeros((480, 3))
        velocity[:12, 1] = 50.0
        fixed = {"id": np.arange(480), "body": np.zeros(480, dtype=int), "piece": piece, "velocity": velocity}
        self.files = [fixed | {"position": x}, fixed | {"position": x + [[0.0, 2e-3, 0.0]] * (piece < 12)[:, None]}]

    def times(self, kind):
        return np.array([0.0, 1.0])

    def particles(self, time=None):
        return self.files[-1 if time is None else 0]


def test_fragments_and_deflections_of_known_ones():
    results = Files()
    (body,) = motions(results)
    assert (body.body, body.displacement, body.speed) == ("bar", pytest.approx(2e-3), 50.0)
    found = fragments(results)
    volume = 0.25 * np.pi * 3.2e-3**2 * 32.4e-3  # of a quarter
    assert found.mass == pytest.approx(np.array([468, 10]) / 480 * 8930.0 * volume, rel=1e-6)
    assert found.speed == pytest.approx([0.0, 50.0])
    assert found.size == pytest.approx([46.7e-3 + 0.8e-3, 0.9e-3 + 0.8e-3])
    assert found.debris == pytest.approx(2 / 480)
