"""Reading an input: TOML, overrides, validation, cross checks. All faults are told at once."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path as File
from typing import Any

from pydantic import ValidationError

from distfsi.errors import InputError
from distfsi.scene import build, charges, checks, materials
from distfsi.scene.composed import meshes_in
from distfsi.scene.coordinate_checks import check_map_is_there
from distfsi.scene.description import Origin, Scene, Shape
from distfsi.scene.diagnosis import diagnose
from distfsi.scene.faults import Fault, Locations, Path
from distfsi.scene.first_contact import with_fronts
from distfsi.scene.former import replace_former_words
from distfsi.scene.overrides import TABLES, apply
from distfsi.scene.schema import Input, Sections, context_of
from distfsi.scene.stages import path_in_stage, stage_inputs

LARGEST_FILE = 64_000_000  # bytes of an input
FAULT_LIMIT = 100  # that are told at once
LONGEST_NAME = 100  # letters of a phase, a body, a gauge, a source


def load(path: str | File, overrides: Sequence[str] = ()) -> Scene:
    """The scene that the TOML file at `path` describes, with `overrides` ("key.path=value") laid over it.

    Raises InputError with one line per fault: file, key, line, what was given, what was expected.
    """
    file = File(path)
    return _scene(file, *_read(file), overrides)


def scene_again(origin: Origin) -> Scene:
    """A scene from where it came from, even if the file is there no more. Raises InputError."""
    file = File(origin.file)
    return _scene(file, origin.text, _tables(file, origin.text), origin.settings)


def _scene(file: File, text: str, data: dict[str, Any], overrides: Sequence[str]) -> Scene:
    """The scene of a file with this `text`, which holds `data`."""
    overridden, faults = apply(data, overrides)
    notes = replace_former_words(data)
    uncharged, charged = charges.add_charges(data)
    inputs = stage_inputs(data, file.stem)
    unnamed, incomplete = materials.fill(data)
    scene, found = _checked(data, file)
    stages: list[Scene] = []
    for number, given in enumerate(inputs):
        _, unknown = materials.fill(given)  # whose faults are those of the scene
        stage, more = _checked(given, file)
        more = [fault for fault in more if not _inside(fault.path, unknown)]
        found += [Fault(path_in_stage(number, fault.path), fault.text) for fault in more]
        stages += [stage] if stage else []
    if scene is not None and not inputs:  # they will have run
        found += check_map_is_there(scene)
    if scene is not None and len(stages) == len(inputs):
        stages, unmet = with_fronts(stages, scene)
        found += unmet
    faults += uncharged + unnamed + [fault for fault in found if not _inside(fault.path, incomplete)]
    locations = Locations(file.name, text, overridden)
    if faults or scene is None:
        raise InputError(locations.tell(faults))
    noted = tuple(locations.tell([*notes, *charged, *_open_surfaces(scene)]))
    origin = Origin(str(file.absolute()), text, tuple(overrides))
    return replace(scene, notes=noted, stages=tuple(stages), origin=origin)


def _checked(data: dict[str, Any], file: File) -> tuple[Scene | None, list[Fault]]:
    """The scene of `data`, without its stages, and all faults."""
    sections, invalid = validate(data, str(file.parent))
    scene, crossed = _assemble(sections, data, file.stem)
    return scene, invalid + crossed


@cache
def schema() -> dict[str, Any]:
    """JSON schema of the input, for editors."""
    return Input.model_json_schema()


def _open_surfaces(scene: Scene) -> Iterator[Fault]:
    """What to tell of surfaces that are not watertight."""
    shapes: list[tuple[Path, Shape | None]] = []
    for n, region in enumerate(scene.fluid.regions if scene.fluid else ()):
        shapes.append((("fluid", "regions", n, "shape"), region.shape))
    for body in scene.solid.bodies if scene.solid else ():
        shapes += [((*body.path, key), getattr(body, key)) for key in ("shape", "fixed")]
    for path, shape in shapes:
        for mesh in meshes_in(shape):
            if count := mesh.surface.open_edges:
                text = f"'{mesh.file}' is not watertight: {count} edges do not have a triangle on each side"
                yield Fault(path, f"{text}; what it winds around by more than a half is inside")


def _read(file: File) -> tuple[str, dict[str, Any]]:
    """Text and tables of a file. A mark of the byte order at its beginning, as some editors leave it, is no text."""
    try:
        with file.open("rb") as opened:
            content = opened.read(LARGEST_FILE + 1)
    except OSError as error:
        raise InputError([f"{file}: cannot be read: {error.strerror}"]) from error
    except ValueError as error:  # NUL in the name
        raise InputError([f"{str(file)!r}: is no name of a file"]) from error
    if len(content) > LARGEST_FILE:
        raise InputError([f"{file}: is larger than {LARGEST_FILE / 1e6:.0f} MB"])
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise InputError([f"{file}: is no UTF-8 text"]) from error
    return text, _tables(file, text)


def _tables(file: File, text: str) -> dict[str, Any]:
    """Tables of the text of a file."""
    try:
        return tomllib.loads(text)
    except ValueError as error:  # of tomllib, or of a number of thousands of digits
        cause = error if isinstance(error, tomllib.TOMLDecodeError) else "a number has too many digits"
        raise InputError([f"{file}: is no TOML: {cause}"]) from error
    except RecursionError as error:
        raise InputError([f"{file}: is no TOML: brackets in too many brackets"]) from error


def _inside(path: Path, tables: Sequence[Path]) -> bool:
    return any(path[: len(table)] == table for table in tables)


def validate(data: dict[str, Any], folder: str) -> tuple[Sections, list[Fault]]:
    """The sections of `data` that are valid in themselves, and the faults of the others, but not more than FAULT_LIMIT
    of them. Names of files that `data` holds count from `folder`."""
    if unreadable := list(find_unreadable(data)):
        return Sections(), unreadable[:FAULT_LIMIT]
    context = context_of(data, folder)
    try:
        return Input.model_validate(data, context=context), []
    except ValidationError as error:
        errors = error.errors(include_url=False)
    sound = {key: value for key, value in data.items() if key not in {error["loc"][0] for error in errors}}
    faults = diagnose(errors[:FAULT_LIMIT], data, schema())
    if len(errors) > FAULT_LIMIT:
        faults.append(Fault((), f"and {len(errors) - FAULT_LIMIT} more faults"))
    return Sections.model_validate(sound, context=context), faults


def find_unreadable(data: Any, path: Path = ()) -> Iterator[Fault]:
    """Faults of texts and names that no file can hold."""
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in entries:
        name = str(key)
        if "\0" in name:
            yield Fault(path, f"{name[:LONGEST_NAME]!r}; a name has no character NUL")
        elif path in TABLES and len(name) > LONGEST_NAME:
            yield Fault(path, f"'{name[:20]}...' has {len(name)} letters; a name has at most {LONGEST_NAME}")
        elif isinstance(value, str) and "\0" in value:
            yield Fault((*path, key), f"{value[:LONGEST_NAME]!r}; a text has no character NUL")
        else:
            yield from find_unreadable(value, (*path, key))


def _assemble(sections: Sections, data: dict[str, Any], stem: str) -> tuple[Scene | None, list[Fault]]:
    """The scene, or the faults between its parts; parts that are invalid in themselves are left out of the checks."""
    domain = build.build_domain(sections.domain) if sections.domain else None
    dimensions = domain.dimensions if domain else 1
    fluid = build.build_fluid(sections.fluid, dimensions) if sections.fluid else None
    pressure = max((region.state.pressure for region in fluid.regions), default=0.0) if fluid else 0.0
    solid = build.build_solid(sections.solid, dimensions, pressure) if sections.solid else None
    faults = list(checks.check(sections, data.keys(), domain, fluid, solid))
    if not {"fluid", "solid"} & data.keys():
        faults.append(Fault((), "has no material; expected [fluid], [solid] or both"))
    if faults or domain is None or not isinstance(sections, Input):
        return None, faults
    scene = Scene(
        title=sections.title or stem,
        domain=domain,
        time=build.build_time(sections.time),
        sources=build.build_sources(sections.domain.gravity, sections.sources),
        loads=tuple(load.build() for load in sections.loads.values()),
        fluid=fluid,
        solid=solid,
        output=build.build_output(sections.output, stem, fluid),
        performance=build.build_performance(sections.performance, dimensions),
        coupling=build.build_coupling(sections.coupling),
        gauges={name: gauge.build() for name, gauge in sections.gauges.items()},
    )
    return scene, faults
