"""The report of a run: `distfsi report`. Key results come first; all is read from the files of the run."""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.errors import InputError
from distfsi.gauges import per_extent
from distfsi.output.files import write_text
from distfsi.output.progress import format_duration, format_time
from distfsi.output.scales import largest, scaled
from distfsi.output.sheets import Picture, draw_fragments, sheets
from distfsi.output.timeline import verdict
from distfsi.report.html import GENERATOR, figure, folded, page, paragraph, table
from distfsi.report.results import Blast, Fragments, blasts, burst_of, fragments, motions
from distfsi.resources.report import charge_lines
from distfsi.resources.scene_picture import draw_scene
from distfsi.results import Results
from distfsi.scene.description import Scene
from distfsi.scene.materials import find
from distfsi.scene.warnings import warnings

NAME = "report.html"
HEAVIEST = 10  # fragments in the table
CURVES = (
    "Curves of Kingery and Bulmash (UFC 3-340-02): measured blasts scatter about them by some 10 %. They hold what TNT "
    "burns with air, which a run has only with [fluid.afterburn]."
)


def write_report(directory: Path, path: Path | None = None) -> Path:
    """Write the report of the run in a directory into the file `path`, by default report.html there; returns it.

    Raises InputError when no run has left anything in the directory, or where something else than a report is in the
    way.
    """
    results = Results(directory)
    path = path or directory / NAME
    if path.exists() and GENERATOR not in path.read_text(errors="replace")[:1000]:
        raise InputError([f"{path}: is there and no report; move it away or name another file with --output"])
    write_text(path, _report(results))
    return path


def _report(results: Results) -> str:
    notes = results.journal
    scene, fault = _scene_of(results)
    pictures = list(sheets(results.directory))

    def shown(*kinds: str) -> str:
        return "".join(figure(each.png, each.text) for each in pictures if each.kind in kinds)

    sections: list[tuple[str, str]] = [
        ("Key results", "".join(_key_results(results, scene, pictures)) or paragraph("No gauges and no bodies.")),
        ("Scene as posed", "".join(_posed(scene)) if scene else paragraph(fault)),
        ("Fields", shown("fields", "peaks") or paragraph("The run has written no fields.")),
        ("Gauges", shown("blast", "gauge")),
        ("Course of the run", "".join(_course(results)) + shown("history")),
        ("Warnings", "".join(_warnings(scene, notes))),
        ("Cost", "".join(_cost(notes))),
        ("How to repeat", "".join(_repeat(notes))),
    ]
    return page(notes.get("title") or results.directory.name, _head(notes), [part for part in sections if part[1]])


def _scene_of(results: Results) -> tuple[Scene | None, str]:
    try:
        return results.scene, ""
    except InputError as error:
        return None, f"The scene is not known: {error}"


def _head(notes: Mapping[str, Any]) -> list[str]:
    took = f" after {format_duration(notes['seconds'])}" if "seconds" in notes else ""
    where = f"{notes['ranks']} rank(s) of {notes['threads per rank']} thread(s)"
    return [f"{notes['status']}{took}; started {notes['started']}, distfsi {notes['distfsi']}, {where}"]


def quantity(value: float, unit: str) -> str:
    """A value in the unit that suits it: "1.25 MPa"."""
    size, shown = scaled(unit, abs(value))
    return f"{value / size:.3g} {shown}"


# ---- key results -----------------------------------------------------------------------------------------------------


def _key_results(results: Results, scene: Scene | None, pictures: list[Picture]) -> Iterator[str]:
    if scene is None:
        return
    found = sorted(blasts(results), key=lambda each: each.arrival)
    if found:
        yield from _blasts(found, scene)
    moved = list(motions(results))
    if moved:
        rows = [
            (each.body, quantity(each.displacement, "m"), _point(each.position), f"{each.speed:.4g} m/s")
            for each in moved
        ]
        yield paragraph("Bodies: the particle that has moved farthest, and the highest speed at the end.")
        yield table(("body", "displacement", "of the particle at", "speed"), rows)
    pieces = fragments(results)
    if pieces is not None and len(pieces.mass) > 0:
        yield from _fragments(pieces, per_extent("kg", scene.domain.dimensions).removeprefix("kg"))


def _blasts(found: list[Blast], scene: Scene) -> Iterator[str]:
    curves = any(each.expected for each in found)
    burst = burst_of(scene)
    if burst is not None:
        yield paragraph(f"Blast of a charge with the energy of {burst.tnt:.3g} kg of TNT.")
    heads = ["gauge", "position", "peak overpressure", "arrival", "impulse"]
    rows = []
    for each in found:
        values = ((each.peak, "Pa"), (each.arrival, "s"), (each.impulse, "Pa s"))
        row = [each.gauge, each.location, *(quantity(value, unit) for value, unit in values)]
        if curves:
            expected = each.expected
            row.append(each.kind)
            row += [_beside(*pair) for pair in zip(values, expected, strict=True)] if expected else ["", "", ""]
        rows.append(row)
    if curves:
        heads += ["curves", "peak", "arrival", "impulse"]
    yield table(heads, rows, words=(1, 5))
    if curves:
        yield paragraph(CURVES, "note")


def _beside(value: tuple[float, str], expected: float) -> str:
    """What the curves give, and by how much the run is off."""
    return f"{quantity(expected, value[1])} ({100.0 * (value[0] / expected - 1.0):+.0f} %)"


def _fragments(pieces: Fragments, per: str) -> Iterator[str]:
    count, debris = len(pieces.mass), 100.0 * pieces.debris
    yield paragraph(f"{count} fragments; {debris:.1f} % of the mass is debris of less than 8 particles. The heaviest:")
    chosen = zip(pieces.mass[:HEAVIEST], pieces.speed, pieces.size, strict=False)
    rows = [
        (str(n), f"{mass:.3g} kg{per}", f"{speed:.4g} m/s", quantity(size, "m"))
        for n, (mass, speed, size) in enumerate(chosen, 1)
    ]
    yield table(("fragment", "mass", "speed", "size"), rows)
    picture = draw_fragments(pieces.mass, pieces.speed, pieces.size, per)
    yield figure(picture.png, picture.text)


def _point(position: Any) -> str:
    size, unit = scaled("m", largest([position]))
    return f"({', '.join(f'{x / size:.3g}' for x in position)}) {unit}"


# ---- the scene -------------------------------------------------------------------------------------------------------


def _posed(scene: Scene) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        for path in draw_scene(scene, Path(folder) / "scene.png"):
            yield figure(path.read_bytes(), f"The scene before the run: {scene.title}")
    domain = scene.domain
    cells = " x ".join(map(str, domain.cells))
    lengths = " x ".join(quantity(b - a, "m") for a, b in zip(domain.lower, domain.upper, strict=True))
    yield paragraph(f"{lengths}, {cells} cells; until {format_time(scene.time.end)}.")
    rows = list(_materials(scene))
    if rows:
        yield table(("part", "material", "source"), rows, words=(1, 2))
    lines = [line for each in (*scene.stages, scene) for line in charge_lines(each)]
    if lines:
        yield table(("charge", ""), [(name, text) for name, text in lines], words=(1,))


def _materials(scene: Scene) -> Iterator[tuple[str, str, str]]:
    """Phases and bodies with the names of their materials, and where the constants of these are from."""
    data = tomllib.loads(scene.origin.text) if scene.origin else {}
    fluid, solid = data.get("fluid", {}), data.get("solid", {})
    named = [(f"charge {n}", each) for n, each in enumerate(data.get("charges", ()), 1)]
    for kind, tables in (("phase", fluid.get("phases", {})), ("body", solid.get("bodies", {}))):
        named += [(f"{kind} {name}", each) for name, each in tables.items()]
    for part, given in named:
        material = find(given["material"]) if isinstance(given, dict) and "material" in given else None
        if material is None:
            eos = given.get("eos") if isinstance(given, dict) else None
            yield part, str(eos.get("kind") if isinstance(eos, dict) else eos or ""), "constants of the input"
        else:
            sources = dict.fromkeys(each.about.get("source", "") for each in material.parts.values())
            yield part, f"{material.name}: {material.description}", "; ".join(filter(None, sources))


# ---- the run ---------------------------------------------------------------------------------------------------------


def _course(results: Results) -> Iterator[str]:
    history = results.history
    if not len(history["step"]):
        return
    yield paragraph(f"{verdict(history)}.")
    drifts = [
        (name.removeprefix("drift "), np.asarray(values))
        for name, values in history.items()
        if name.startswith("drift ")
    ]
    rows = [(name.replace("_", " "), f"{values[-1]:.1e}", f"{largest([values]):.1e}") for name, values in drifts]
    yield table(("conserved total", "relative drift at the end", "largest"), rows)


def _warnings(scene: Scene | None, notes: Mapping[str, Any]) -> Iterator[str]:
    texts = [*(warnings(scene) if scene else ()), *(scene.notes if scene else ())]
    if notes["status"] != "done":
        texts.insert(0, f"The run is {notes['status']}: {notes.get('message', 'results may be incomplete')}")
    yield from (paragraph(text, "warning") for text in texts)
    if not texts:
        yield paragraph("None.")


def _cost(notes: Mapping[str, Any]) -> Iterator[str]:
    parts = notes.get("seconds by part", {})
    total = sum(parts.values())
    if not total:
        return
    rows = sorted(parts.items(), key=lambda part: -part[1])
    shares = [(part, f"{seconds:.3g} s", f"{100.0 * seconds / total:.0f} %") for part, seconds in rows]
    yield table(("part of a step", "mean over the ranks", "share"), shares)
    other = max(notes.get("seconds", total) - total, 0.0)
    yield paragraph(f"Beside them {other:.3g} s: start, compiling, end.", "note")


def _repeat(notes: Mapping[str, Any]) -> Iterator[str]:
    given = notes.get("input")
    if not given:
        yield paragraph("The scene was made in Python: its input is not known.")
        return
    settings = "".join(f" --set '{setting}'" for setting in given["settings"])
    ranks = f"mpiexec -n {notes['ranks']} " if notes["ranks"] > 1 else ""
    name = Path(given["file"]).name
    yield paragraph(f"distfsi {notes['distfsi']} gives the same bits on any number of ranks and threads by")
    yield f"<pre>{ranks}distfsi {name}{escape(settings)}</pre>"
    yield folded(f"The input, {name}", given["text"])
