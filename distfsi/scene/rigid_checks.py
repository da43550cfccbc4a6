"""What a schema cannot say of rigid parts, of bars and of bodies that hold together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from distfsi.narrowing import present
from distfsi.scene.bar_lines import lines_of
from distfsi.scene.bar_tables import AXES
from distfsi.scene.description import Domain, HalfSpace, Solid
from distfsi.scene.faults import Fault, one_of
from distfsi.scene.motion import Motion
from distfsi.scene.schema import Sections
from distfsi.scene.shapes import contains


def check_rigid(sections: Sections, solid: Solid, domain: Domain, in_fluid: bool) -> Iterator[Fault]:
    """There is something; what turns can; and there is something that obstacles are in the way of."""
    given = present(sections.solid)
    if not solid.bodies:
        text = "is missing; expected [solid.bodies.NAME], [solid.rigid.NAME] or [solid.obstacles.NAME]"
        yield Fault(("solid", "bodies"), text)
    rigid = [body for body in solid.bodies if body.motion]
    if not rigid:
        return
    if solid.obstacles and not in_fluid:
        yield Fault(("solid", "obstacles"), "are what a fluid or bodies meet; expected one of them")
    if sections.coupling.scheme == "immersed_boundary" and in_fluid:
        kind = rigid[0].path[1]
        text = f"'immersed_boundary' knows no {'obstacles' if kind == 'obstacles' else 'rigid bodies'}"
        yield Fault(("coupling", "scheme"), f"{text}; expected 'cut_cells'")
    alone = not given.bodies and not in_fluid
    meets = len(solid.bodies) > 1 or any("wall" in ends for ends in domain.boundaries)
    for body in rigid:
        path, motion = body.path, body.motion
        if isinstance(motion, Motion):
            if any(motion.angles) and bool(motion.axis) != (domain.dimensions == 3):
                text = "an axis is needed to turn in 3D" if domain.dimensions == 3 else "only in 3D there is an axis"
                yield Fault((*path, "motion"), text)
            continue
        if isinstance(body.shape, HalfSpace):
            yield Fault((*path, "shape"), "a half space has no end, so no mass; expected another shape")
        if alone and meets and given.rigid[body.name].modulus is None:
            text = "is missing: what it meets tells no stiffness, for nothing deforms and there is no fluid"
            yield Fault((*path, "modulus"), text)
        for n, support in enumerate(getattr(motion, "supports", ())):
            if not any(support.stiffness + support.damping) or min(support.stiffness + support.damping) < 0.0:
                text = "expected a stiffness or a damping, none of them negative"
                yield Fault((*path, "supports", n), text)
        if any(moment <= 0.0 for moment in getattr(motion, "inertia", ())):
            yield Fault((*path, "inertia"), "must be positive")


def check_bars(solid: Solid, domain: Domain) -> Iterator[Fault]:
    """Bars lie along axes that there are, and in their bodies."""
    for body in solid.bodies:
        path = (*body.path, "bars")
        if body.bars is None:
            continue
        if domain.dimensions == 1:
            yield Fault(path, "need two or three dimensions")
        elif missing := [AXES[axis] for axis in body.bars.directions if axis >= domain.dimensions]:
            yield Fault((*path, "directions"), f"there is no {missing[0]} axis")
        elif len(body.bars.directions) == 3:
            yield Fault((*path, "directions"), "expected one axis or two: bars lie below a face of the third")
        elif isinstance(body.shape, HalfSpace):
            yield Fault(path, "a half space has no faces below which they lie")
        else:
            ends = [np.vstack([line.nodes[0], line.nodes[-1]]) for line in lines_of(body, body.bars, domain)]
            if not ends or not contains(body.shape, np.concatenate(ends)).any():
                yield Fault((*path, "cover"), f"no bar fits into the body with a cover of {body.bars.cover:.6g} m")


def check_ties(solid: Solid) -> Iterator[Fault]:
    """Ties name bodies that are there, of one form."""
    bodies = {body.name: body for body in solid.bodies}
    for n, names in enumerate(solid.tied):
        path = ("solid", "tied", n)
        if unknown := [name for name in names if name not in bodies]:
            yield Fault(path, f"'{unknown[0]}' is no body" + one_of(bodies, unknown[0]))
        elif rigid := [name for name in names if bodies[name].motion]:
            yield Fault(path, f"'{rigid[0]}' is rigid: ties are bonds, and it has none")
        elif len(set(names)) < 2:
            yield Fault(path, "expected two bodies or more")
        elif len({solid.form_of(bodies[name]) for name in names}) > 1:
            yield Fault(path, "tied bodies need one form")
