"""How far the wave of a stage may go before it meets something that has not the stage's symmetry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from distfsi.narrowing import present
from distfsi.scene.description import Scene
from distfsi.scene.faults import Fault
from distfsi.scene.shapes import distance

MARGIN = 2.0  # cells of the next run that the front stays away
NOTHING = ("axis", "outflow")  # kinds of ends that a wave does not meet
THROUGH = 1e-9  # of a domain: an end so near goes through the centre


def first_contact(scene: Scene) -> float:
    """Distance [m] from the centre of the scene's map to what is nearest to it, less two cells: a body, a region after
    the first, an end of the domain that holds the wave and does not go through the centre; infinite without any."""
    domain, fluid = scene.domain, present(scene.fluid)
    center = np.array(present(fluid.map).center)
    shapes = [region.shape for region in fluid.regions[1:]]
    shapes += [body.shape for body in scene.solid.bodies] if scene.solid else []
    found = [float(distance(shape, center[None])[0]) for shape in shapes if shape is not None]
    size = math.dist(domain.lower, domain.upper)
    for axis, at in enumerate(center):
        for end, kind in zip((domain.lower[axis], domain.upper[axis]), domain.boundaries[axis], strict=True):
            if kind not in NOTHING and abs(end - at) > THROUGH * size:
                found.append(abs(end - at))
    return min(found, default=math.inf) - MARGIN * max(domain.spacing)


def with_fronts(stages: Sequence[Scene], scene: Scene) -> tuple[list[Scene], list[Fault]]:
    """The stages of a scene, where they end at the first contact with the distance of it; and faults."""
    found, faults = [], []
    for number, stage in enumerate(stages):
        front = stage.time.front
        if front == "contact":
            front, upper = first_contact([*stages, scene][number + 1]), stage.domain.upper[0]
            if not 0.0 < front < upper:
                where = f"the first contact is {front:.4g} m from the centre" if front < math.inf else "nothing is met"
                text = f"{where}; expected it in the stage, 0 to {upper:g} m, or a distance"
                faults.append(Fault(("stages", number, "time", "front"), text))
        found.append(replace(stage, time=replace(stage.time, front=front)))
    if scene.time.front == "contact":
        faults.append(Fault(("time", "front"), "'contact' is for a stage; expected a distance"))
    return found, faults
