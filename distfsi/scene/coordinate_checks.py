"""Faults of scenes in radial coordinates: what does not go with a distance r from an axis or a point."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path as File

from distfsi.coordinates import Coordinates
from distfsi.laws.registry import laws_of, word_of
from distfsi.scene.description import Domain, Fluid, Scene, Solid
from distfsi.scene.faults import Fault
from distfsi.scene.schema import Sections

FEWEST_CELLS = 2  # along r: ghost cells are mirrored ones


def check_coordinates(sections: Sections, domain: Domain, fluid: Fluid | None, solid: Solid | None) -> Iterator[Fault]:
    """The coordinate system fits the domain, and all else fits it."""
    dimensions, coordinates = domain.dimensions, domain.coordinates
    path, word = ("domain", "symmetry"), word_of(type(coordinates))
    if dimensions not in coordinates.dimensions:
        fitting = [f"'{word_of(kind)}'" for kind in laws_of(Coordinates) if dimensions in kind.dimensions]
        text = f"'{word}' does not go with {dimensions} dimension(s); expected {' or '.join(fitting)}"
        yield Fault(path, text)
        return
    yield from _check_axis(domain)
    if sections.time is not None and sections.time.front is not None:
        yield from _check_front(sections.time.front, domain, fluid)
    if fluid is not None and fluid.map is not None and coordinates.radial and fluid.map.center[0] != 0.0:
        yield Fault(("fluid", "map", "center"), "lies beside the axis of this scene; expected r = 0")
    if not coordinates.radial:
        return
    if solid is not None:
        yield Fault(path, f"'{word}' is for fluids alone, not yet for solids")
    if fluid is not None and fluid.reconstruction == "weno5":
        yield Fault(
            ("fluid", "reconstruction"), f"'weno5' is for equal cells, those of '{word}' grow; expected another"
        )
    for key, acceleration in _accelerations(sections):
        if acceleration[0] != 0.0:
            yield Fault(key, f"acts along r, which is not '{word}'")


def _check_axis(domain: Domain) -> Iterator[Fault]:
    """The first axis begins at r = 0, where its end is the axis, or beyond it."""
    path, radial = ("domain", "x"), domain.coordinates.radial
    for axis, ends in enumerate(domain.boundaries):
        for side, kind in enumerate(ends):
            at_axis = radial and (axis, side) == (0, 0) and domain.lower[0] == 0.0
            if kind == "axis" and not at_axis:
                text = "an end is 'axis'; that is the low end along x where it is r = 0, in radial coordinates"
                yield Fault(("domain", "xyz"[axis]), text)
            elif at_axis and kind != "axis":
                yield Fault(path, f"the low end lies at r = 0, but is '{kind}'; expected 'axis'")
    if not radial:
        return
    if "periodic" in domain.boundaries[0]:
        yield Fault(path, "periodic along r; expected ends of another kind")
    if domain.lower[0] < 0.0:
        yield Fault(("domain", "lower"), f"{domain.lower[0]:g} m along r; expected at least 0")
    if domain.cells[0] < FEWEST_CELLS:
        yield Fault(("domain", "cells"), f"expected at least {FEWEST_CELLS} along r")


def _check_front(front: float | str, domain: Domain, fluid: Fluid | None) -> Iterator[Fault]:
    """A wave comes to one distance in one radial dimension, inside the domain."""
    path = ("time", "front")
    if fluid is None or not domain.coordinates.radial or domain.dimensions != 1:
        yield Fault(path, "is for a fluid in 'spherical' or 'cylindrical' coordinates")
    elif isinstance(front, float) and not domain.lower[0] < front < domain.upper[0]:
        yield Fault(path, f"{front:g} m lies outside the domain")


def check_map_is_there(scene: Scene) -> Iterator[Fault]:
    """The run that a scene goes on from has left something."""
    if scene.fluid is None or scene.fluid.map is None:
        return
    path = File(scene.fluid.map.run)
    if not path.is_file() and not any(path.glob("restart-[0-9]*.h5")):
        text = f"{path} is no restart file and has none; a finished run in radial coordinates leaves one"
        yield Fault(("fluid", "map", "run"), text)


def _accelerations(sections: Sections) -> Iterator[tuple[tuple[str, ...], tuple[float, ...]]]:
    """Keys and values of all that accelerates."""
    if sections.domain is not None and sections.domain.gravity is not None:
        yield ("domain", "gravity"), sections.domain.gravity
    for name, source in sections.sources.items():
        yield ("sources", name, "acceleration"), source.build().acceleration
