"""What a run will cost and what it could do without, told before it starts: `distfsi check`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from distfsi.gauges import per_extent
from distfsi.laws.registry import word_of
from distfsi.output.progress import format_duration
from distfsi.output.scales import format_bytes
from distfsi.resources.estimate import Resources
from distfsi.scene.advice import advice, thickness
from distfsi.scene.bar_lines import lines_of
from distfsi.scene.bars import Bars
from distfsi.scene.description import Body, Scene
from distfsi.scene.placed_charges import Charge, charges, distances, gap_between


def report(scene: Scene, ranks: int = 1, threads: int = 1, bench: Mapping[str, Any] | None = None) -> str:
    """Sizes, memory, output, steps and time of `scene` on so many ranks, and advice, as text.

    `bench`: what `bench.kept_bench` gives, for the time.
    """
    domain, resources = scene.domain, Resources(scene, ranks)
    size = " x ".join(f"{b - a:.6g}" for a, b in zip(domain.lower, domain.upper, strict=True))
    lines = [
        scene.title,
        _line("domain", f"{size} m, {' x '.join(map(str, domain.cells))} cells of {_metres(domain.spacing)}"),
        _line("blocks", _blocks(resources)),
    ]
    if domain.coordinates.radial:
        lines.append(_line("symmetry", f"{word_of(type(domain.coordinates))}; totals of {domain.coordinates.whole}"))
    if scene.fluid:
        *first, last = (phase.name for phase in scene.fluid.phases)
        names = f"{', '.join(first)} and {last}" if first else last
        lines.append(_line("fluid", f"{names}; {resources.cells:,} cells"))
    for body in scene.solid.bodies if scene.solid else ():
        lines.append(_line("body", _body(body, len(resources.positions[body.name]), scene)))
        if body.bars:
            lines.append(_line("bars", _bars(body, body.bars, scene)))
    lines += [_line(name, text) for name, text in charge_lines(scene)]
    lines += [
        _line("memory", _memory(resources)),
        _line("output", _output(resources)),
        _line("steps", _steps(resources)),
        _line("time", _time(resources, threads, bench)),
    ]
    lines += [_line("note", text) for text in scene.notes]
    given = list(advice(scene, resources.layout))
    if not given:
        lines.append(_line("verdict", "well posed: nothing is known that makes results wrong, or costs without use"))
    return "\n".join(lines + [_line("advice", text) for text in given])


def charge_lines(scene: Scene) -> Iterator[tuple[str, str]]:
    """Of each charge, in words, what it is and how far bodies and gauges are from it; before each the kind of line."""
    for charge in charges(scene):
        yield "charge", _charge(charge, scene)
        yield from (("distance", text) for text in _distances(charge, scene))


def _line(name: str, text: str) -> str:
    return f"  {name:<11}{text}"


def _steps(resources: Resources) -> str:
    text = f"about {resources.steps:,}, if no wave becomes faster than the first ones"
    solid = resources.scene.solid
    velocities = {body.velocity for body in solid.bodies} if solid else set()
    return text + (" and bodies do not meet: what they compress makes steps shorter" if len(velocities) > 1 else "")


def _blocks(resources: Resources) -> str:
    blocks = resources.blocks[0]
    shape = " x ".join(map(str, blocks.block_cells[: resources.dimensions]))
    text = f"{blocks.count} of {shape} cells"
    if resources.ranks == 1:
        return text
    counts = [b.local_count for b in resources.blocks]
    text += f"; {min(counts)} to {max(counts)} on each of {resources.ranks} ranks"
    idle = counts.count(0)
    return text + (f"; {idle} have none: smaller blocks or fewer ranks" if idle else "")


def _body(body: Body, particles: int, scene: Scene) -> str:
    text = f"{body.name}: {particles:,} particles {_metres((body.spacing,))} apart"
    thick = thickness(body, scene.domain)
    if thick is None:
        return text
    text += f", {thick:.4g} m thick: {thick / body.spacing:.3g} particles"
    return text + (f", {thick / min(scene.domain.spacing):.3g} cells" if scene.fluid else "")


def _bars(body: Body, bars: Bars, scene: Scene) -> str:
    lines = lines_of(body, bars, scene.domain)
    length = sum(line.share * math.dist(line.nodes[0], line.nodes[-1]) for line in lines)
    elements = sum(len(line.nodes) - 1 for line in lines)
    return f"{body.name}: {len(lines)} of {1e3 * bars.diameter:.4g} mm, {length:.4g} m of them in {elements:,} elements"


def _charge(charge: Charge, scene: Scene) -> str:
    kg = per_extent("kg", scene.domain.dimensions + scene.domain.coordinates.turns)
    text = f"{charge.name}: {charge.meant:.4g} {kg}, {charge.placed:.4g} {kg} as placed"
    text += f" (one of {charge.copies} parts)" if charge.copies > 1 else ""
    text += f", {charge.cells:.3g} cells per radius; the energy of {charge.tnt:.4g} {kg} of TNT"
    near = [body.name for body in scene.solid.bodies if _touches(charge, body, scene)] if scene.solid else []
    return text + "".join(f"; touches body '{name}'" for name in near)


def _touches(charge: Charge, body: Body, scene: Scene) -> bool:
    return gap_between(charge, body, scene.domain) < 0.5 * min(scene.domain.spacing)


def _distances(charge: Charge, scene: Scene) -> Iterator[str]:
    extents = scene.domain.dimensions + scene.domain.coordinates.turns
    for name, length in distances(scene, charge):
        scaled = f", Z = {charge.scaled(length):.3g} m/kg^(1/3)" if extents == 3 else ""
        yield f"{name}: {length:.4g} m from the center of charge '{charge.name}'{scaled}"


def _memory(resources: Resources) -> str:
    arrays = format_bytes(resources.arrays())
    return f"about {format_bytes(resources.memory())} per rank, {arrays} of it for cells and particles; none of a GPU"


def _output(resources: Resources) -> str:
    times, each = resources.output_times(), resources.output_bytes()
    total = f"{format_bytes(times * each)} in all, in {resources.scene.output.directory}"
    return f"{times} field outputs of about {format_bytes(each)}, {total}"


def _time(resources: Resources, threads: int, bench: Mapping[str, Any] | None) -> str:
    if bench is None:
        return "unknown: `distfsi bench` measures this machine once for all"
    seconds = resources.seconds(threads, bench)
    machine = f"{resources.ranks} rank(s) of {threads} thread(s), by the bench of this machine"
    return f"about {format_duration(max(seconds, 1.0))} on {machine}; compiling, the first time, comes on top"


def _metres(lengths: tuple[float, ...]) -> str:
    distinct = lengths if len({f"{h:.6g}" for h in lengths}) > 1 else lengths[:1]
    return " x ".join(f"{h:.6g}" for h in distinct) + " m"
