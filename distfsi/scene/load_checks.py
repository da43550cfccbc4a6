"""Faults of loads: where the curves do not hold, and what they are not for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from distfsi.scene.description import Domain, Solid
from distfsi.scene.faults import Fault, Path
from distfsi.scene.loads import facets_of_bodies, wave_at
from distfsi.scene.schema import Sections

SAMPLES = 30  # of the distances of a body


def check_loads(sections: Sections, domain: Domain, solid: Solid | None, has_fluid: bool) -> Iterator[Fault]:
    """Loads are for deformable bodies in two and three dimensions, without a fluid, within the range of the curves."""
    for name, given in sections.loads.items():
        path: Path = ("loads", name)
        if has_fluid:
            yield Fault(path, "presses on bodies where no fluid is computed, but there is [fluid]; give it a charge")
        elif domain.dimensions == 1 or domain.coordinates.radial:
            yield Fault(path, "is for two or three dimensions without symmetry about an axis or a point")
        elif solid is not None and solid.obstacles:
            yield Fault(path, "presses on what it can move, but there are only obstacles")
        elif solid is not None and any(body.bars for body in solid.bodies):
            yield Fault(path, "is not yet for bodies with bars in them")
        elif solid is not None:
            load = given.build()
            try:
                for facets in facets_of_bodies(solid, domain):
                    distance = np.linalg.norm(facets.center - np.array(load.center), axis=1)
                    if len(distance):
                        for r in np.linspace(distance.min(), distance.max(), SAMPLES):
                            wave_at(load, float(r))
            except ValueError as error:
                yield Fault(path, str(error))
