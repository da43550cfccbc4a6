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
from distfsi.scene.description import Scene, Shape
from distfsi.scene.diagnosis import diagnose
from distfsi.scene.faults import Fault, Locations, Path
from distfsi.scene.former import replace_former_words
from distfsi.scene.overrides import apply
from distfsi.scene.schema import Input, Sections, context_of


def load(path: str | File, overrides: Sequence[str] = ()) -> Scene:
    """The scene that the TOML file at `path` describes, with `overrides` ("key.path=value") laid over it.

    Raises InputError with one line per fault: file, key, line, what was given, what was expected.
    """
    file = File(path)
    text, data = _read(file)
    overridden, faults = apply(data, overrides)
    notes = replace_former_words(data)
    uncharged, charged = charges.add_charges(data)
    unnamed, incomplete = materials.fill(data)
    sections, invalid = validate(data, str(file.parent))
    scene, crossed = _assemble(sections, data, file.stem)
    faults += uncharged + unnamed + [fault for fault in invalid + crossed if not _inside(fault.path, incomplete)]
    locations = Locations(file.name, text, overridden)
    if faults or scene is None:
        raise InputError(locations.tell(faults))
    return replace(scene, notes=tuple(locations.tell([*notes, *charged, *_open_surfaces(scene)])))


@cache
def schema() -> dict[str, Any]:
    """JSON schema of the input, for editors."""
    return Input.model_json_schema()


def _open_surfaces(scene: Scene) -> Iterator[Fault]:
    """What to tell of surfaces that are not watertight."""
    shapes: list[tuple[Path, Shape | None]] = []
    for n, region in enumerate(scene.fluid.regions if scene.fluid else ()):
        shapes.append((("fluid", "regions", n, "shape"), region.shape))
    kind = "obstacles" if scene.solid and scene.solid.obstacles else "bodies"
    for body in scene.solid.bodies if scene.solid else ():
        shapes += [(("solid", kind, body.name, key), getattr(body, key)) for key in ("shape", "fixed")]
    for path, shape in shapes:
        for mesh in meshes_in(shape):
            if count := mesh.surface.open_edges:
                text = f"'{mesh.file}' is not watertight: {count} edges do not have a triangle on each side"
                yield Fault(path, f"{text}; what it winds around by more than a half is inside")


def _read(file: File) -> tuple[str, dict[str, Any]]:
    try:
        text = file.read_text(encoding="utf-8")
        return text, tomllib.loads(text)
    except OSError as error:
        raise InputError([f"{file}: cannot be read: {error.strerror}"]) from error
    except UnicodeDecodeError as error:
        raise InputError([f"{file}: is no UTF-8 text"]) from error
    except tomllib.TOMLDecodeError as error:
        raise InputError([f"{file}: is no TOML: {error}"]) from error


def _inside(path: Path, tables: Sequence[Path]) -> bool:
    return any(path[: len(table)] == table for table in tables)


def validate(data: dict[str, Any], folder: str) -> tuple[Sections, list[Fault]]:
    """The sections of `data` that are valid in themselves, and the faults of the others. Names of files that `data`
    holds count from `folder`."""
    context = context_of(data, folder)
    try:
        return Input.model_validate(data, context=context), []
    except ValidationError as error:
        errors = error.errors()
    sound = {key: value for key, value in data.items() if key not in {error["loc"][0] for error in errors}}
    return Sections.model_validate(sound, context=context), diagnose(errors, data, schema())


def _assemble(sections: Sections, data: dict[str, Any], stem: str) -> tuple[Scene | None, list[Fault]]:
    """The scene, or the faults between its parts; parts that are invalid in themselves are left out of the checks."""
    domain = build.build_domain(sections.domain) if sections.domain else None
    dimensions = domain.dimensions if domain else 1
    fluid = build.build_fluid(sections.fluid, dimensions) if sections.fluid else None
    solid = build.build_solid(sections.solid, dimensions) if sections.solid else None
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
        fluid=fluid,
        solid=solid,
        output=build.build_output(sections.output, stem, fluid),
        performance=build.build_performance(sections.performance, dimensions),
        coupling=build.build_coupling(sections.coupling),
        gauges={name: gauge.build() for name, gauge in sections.gauges.items()},
    )
    return scene, faults
