"""What a scene pays for and does not use, and what looks wrong, as advice."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from distfsi.scene.description import Ball, Body, Box, Composed, Domain, Fluid, HalfSpace, Scene, Shape, Tube
from distfsi.scene.packing import pack
from distfsi.scene.shapes import distance, smallest_extent
from distfsi.scene.signals import COVERED, Layout, end_time, fastest_signal, states, waves
from distfsi.scene.thermodynamics import sound_speed_squared
from distfsi.scene.warnings import warnings

AXES, ENDS = "xyz", ("low", "high")
BEST_SPACING = 0.5  # of a fluid cell
FEWEST_PARTICLES = 4  # through a body's thickness
MAXIMUM_CELLS = 500  # across the smallest thing
RELEASED = 5e-4  # of a liquid's rho c2: to what pressure it is let go, if that is to be right
TOUCHING = 0.55  # spacings from particles to another body: half of one where surfaces touch
UNREACHED = 0.25  # of the domain's length that no wave reaches


def advice(scene: Scene, layout: Layout | None) -> Iterator[str]:
    """One sentence for each thing that may be worth a change; `layout` is that of the scene's fluid, if it has one."""
    yield from _shape_of_cells(scene.domain)
    if scene.output.fields_every > scene.time.end:
        yield "output.fields_every is longer than the run: only the first and the last fields are written"
    mapped = scene.fluid is not None and scene.fluid.map is not None  # then regions do not tell what happens
    if layout and not mapped:
        yield from _absent_phases(layout.fluid, layout)
        yield from _unreached_ends(scene, layout)
        yield from _strong_releases(layout)
    yield from warnings(scene)
    yield from _staircases(scene)
    for body in _bodies(scene):
        for text in _body(body, scene.domain, scene.fluid is not None):
            yield f"body '{body.name}': {text}"
    yield from _touching_bodies(scene)
    yield from _excess_cells(scene)
    if not mapped:
        yield from _excess_dimensions(scene)


def _shape_of_cells(domain: Domain) -> Iterator[str]:
    longest, shortest = max(domain.spacing), min(domain.spacing)
    if longest > 1.5 * shortest:
        yield f"cells are {longest / shortest:.3g} times longer than wide"


# ---- what nothing is in ----------------------------------------------------------------------------------------------


def _absent_phases(fluid: Fluid, layout: Layout) -> Iterator[str]:
    """Phases that no region has, or only such regions as later ones or bodies hide."""
    seen = set(np.unique(layout.region)) - {COVERED}
    present = {fluid.regions[number].state.phase for number in seen}
    present |= {state.phase for sides in fluid.inflow for state in sides if state}
    named = {state.phase for state in states(fluid)}
    for number, phase in enumerate(fluid.phases):
        if number not in named:
            yield f"phase '{phase.name}' is nowhere; without it the run is cheaper"
        elif number not in present:
            yield f"phase '{phase.name}' fills no cell: later regions or bodies hide it, or its region lies outside"


def _unreached_ends(scene: Scene, layout: Layout) -> Iterator[str]:
    """Ends of the domain that even the fastest wave does not come near."""
    domain = scene.domain
    if scene.sources or (scene.fluid and scene.fluid.detonation):
        return  # what moves is not there yet
    if not layout.sources.any():
        yield "nothing moves and no two states meet: the fluid stays as it is"
        return
    reach = fastest_signal(scene, layout) * end_time(scene, layout)
    for axis, (centers, marked) in enumerate(zip(layout.centers, reversed(np.nonzero(layout.sources)), strict=True)):
        low, high = centers[marked.min()], centers[marked.max()]
        length = domain.upper[axis] - domain.lower[axis]
        for side, gap in enumerate((low - domain.lower[axis], domain.upper[axis] - high)):
            rest = gap - reach
            if rest > UNREACHED * length and domain.boundaries[axis][side] != "periodic":
                end = f"the {ENDS[side]} {AXES[axis]} end"
                nearest = f"no wave comes nearer to {end} than {rest:.3g} m before the run is over"
                yield f"{nearest}; a smaller domain will do"


def _strong_releases(layout: Layout) -> Iterator[str]:
    """Liquids that are let go to a pressure which is little beside their own (docs/theory.md)."""
    fluid = layout.fluid
    if fluid.model != "six_equation":
        return
    found = {}
    for contact in layout.contacts:
        state = max(contact.first, contact.second, key=lambda state: state.pressure)
        eos, between = fluid.phases[state.phase].eos, waves(fluid, contact)[1:-1]
        if not between or contact.first.phase == contact.second.phase or eos.cold_curve(state.density)[0] >= 0.0:
            continue
        after, bulk = between[0].pressure, state.density * sound_speed_squared(eos, state.density, state.pressure)
        if after < min(RELEASED * bulk, 0.5 * state.pressure):
            found[state.phase] = state.pressure, after
    for phase, (before, after) in found.items():
        name, better = fluid.phases[phase].name, '`model = "five_equation"` with `reconstruction = "van_leer"`'
        text = (
            f"phase '{name}' is let go from {before:.3g} to {after:.3g} Pa, which six equations put tens of percent off"
        )
        yield f"{text}; {better} at most some"


# ---- bodies ----------------------------------------------------------------------------------------------------------


def thickness(body: Body, domain: Domain) -> float | None:
    """Smallest extent of a body inside the domain [m]; None for a half space and for what is composed."""
    if isinstance(body.shape, Box):
        low, high = np.maximum(body.shape.lower, domain.lower), np.minimum(body.shape.upper, domain.upper)
        return float(np.min(high - low))
    return smallest_extent(body.shape)


def _body(body: Body, domain: Domain, in_fluid: bool) -> Iterator[str]:
    cell, thick = min(domain.spacing), thickness(body, domain)
    if in_fluid and body.spacing > BEST_SPACING * cell * (1.0 + 1e-9):
        yield f"particles are {body.spacing / cell:.3g} cells apart; at most {BEST_SPACING} is better"
    if thick is not None and thick < (FEWEST_PARTICLES - 0.5) * body.spacing:
        yield f"fewer than {FEWEST_PARTICLES} particles through its thickness"
    if in_fluid and thick is not None and thick < math.sqrt(domain.dimensions) * cell:
        yield f"thinner than sqrt({domain.dimensions}) cells: the fluid sees it thicker than it is"


def _touching_bodies(scene: Scene) -> Iterator[str]:
    """Bodies that touch and move as one but do not hold together."""
    first = scene.solid.first_tied if scene.solid else ()
    pairs = itertools.combinations([(b, body) for b, body in enumerate(_bodies(scene)) if not body.motion], 2)
    for (a, one), (b, other) in pairs:
        if one.velocity != other.velocity or first[a] == first[b]:
            continue
        points, _ = pack(one, scene.domain.lower, scene.domain.upper)
        if distance(other.shape, points).min(initial=math.inf) < TOUCHING * one.spacing:
            yield (
                f"bodies '{one.name}' and '{other.name}' touch and do not hold together, they come apart without "
                f'resistance; solid.tied = [["{one.name}", "{other.name}"]] joins them'
            )


def _staircases(scene: Scene) -> Iterator[str]:
    """Each ball in a lattice that others may meet."""
    bodies = _bodies(scene)
    for body in bodies if len(bodies) > 1 and scene.domain.dimensions == 3 else ():
        if isinstance(body.shape, Ball) and not (body.packing or body.motion):
            text = "its lattice makes a staircase of its surface, which turns what bounces off"
            yield f"body '{body.name}': {text}; packing = \"relaxed\" fits it"


# ---- resolution and dimensions ---------------------------------------------------------------------------------------


def _excess_cells(scene: Scene) -> Iterator[str]:
    """Cells or particles much finer than the smallest thing in the scene; one dimension is cheap at any resolution."""
    if scene.domain.dimensions == 1:
        return
    extents = [size for shape in _shapes(scene) if (size := smallest_extent(shape)) is not None]
    if scene.fluid and extents:
        across = min(extents) / max(scene.domain.spacing)
        if across > MAXIMUM_CELLS:
            yield f"even the smallest thing in the scene is {across:.0f} cells across; fewer may do"
    for body in _bodies(scene):
        thick = thickness(body, scene.domain)
        if thick is not None and thick / body.spacing > MAXIMUM_CELLS:
            yield f"body '{body.name}' is {thick / body.spacing:.0f} particles thick; fewer may do"


def _excess_dimensions(scene: Scene) -> Iterator[str]:
    domain = scene.domain
    first = 1 if domain.coordinates.radial else 0
    for axis in range(first, domain.dimensions if domain.dimensions > 1 else 0):
        if _constant_along(scene, axis):
            yield f"nothing varies along {AXES[axis]}: {domain.dimensions - 1} dimension(s) without it give the same"
            return
    if domain.dimensions == 3:
        for axis in range(3):
            if _turns_around(scene, axis):
                yield (
                    f"everything is symmetric about a line along {AXES[axis]}: "
                    "with symmetry planes through it a quarter of the domain gives the same"
                )
                return


def _constant_along(scene: Scene, axis: int) -> bool:
    """Whether no shape, flow, body force or end of the domain tells places along `axis` apart."""
    return (
        all(_spans(shape, scene.domain, axis) for shape in _shapes(scene))
        and not any(velocity[axis] for velocity in _velocities(scene))
        and (scene.fluid is None or not any(scene.fluid.inflow[axis]))
    )


def _spans(shape: Shape, domain: Domain, axis: int) -> bool:
    match shape:
        case HalfSpace(_, normal):
            return normal[axis] == 0.0
        case Box(lower, upper):
            return lower[axis] <= domain.lower[axis] and upper[axis] >= domain.upper[axis]
    return False


def _turns_around(scene: Scene, axis: int) -> bool:
    """Whether all shapes, flows and forces are symmetric about one line along `axis` inside the domain."""
    across = [a for a in range(3) if a != axis]
    shapes, domain = _shapes(scene), scene.domain
    centers = {tuple(s.center[a] for a in across) for s in shapes if isinstance(s, Ball | Tube)}
    flat = [s for s in shapes if isinstance(s, HalfSpace | Box)]
    if any(isinstance(s, Composed) for s in shapes):
        return False
    if len(centers) != 1 or not all(_spans(shape, domain, a) for shape in flat for a in across):
        return False
    (center,) = centers
    inside = all(domain.lower[a] < c < domain.upper[a] for a, c in zip(across, center, strict=True))
    ends = {kind for a in across for kind in domain.boundaries[a]}
    return inside and ends == {"outflow"} and not any(v[a] for v in _velocities(scene) for a in across)


def _velocities(scene: Scene) -> list[tuple[float, ...]]:
    """Velocities of the flow and of bodies, and accelerations."""
    flows = [state.velocity for state in states(scene.fluid)] if scene.fluid else []
    return [*flows, *(body.velocity for body in _bodies(scene)), *(source.acceleration for source in scene.sources)]


def _shapes(scene: Scene) -> list[Shape]:
    regions = [region.shape for region in scene.fluid.regions] if scene.fluid else []
    fixed = [body.fixed for body in _bodies(scene)]
    return [shape for shape in (*regions, *(body.shape for body in _bodies(scene)), *fixed) if shape is not None]


def _bodies(scene: Scene) -> tuple[Body, ...]:
    return scene.solid.bodies if scene.solid else ()
