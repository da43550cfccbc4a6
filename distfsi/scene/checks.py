"""What a schema cannot say: faults between the parts of a scene, all of them at once."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Container, Iterator, Mapping

import numpy as np

from distfsi.gauges import Gauge
from distfsi.laws.law import Source
from distfsi.laws.registry import word_of
from distfsi.scene.build import AXES, SIDES, build_sources, stop_file_in
from distfsi.scene.cloud import Cloud
from distfsi.scene.coordinate_checks import check_coordinates
from distfsi.scene.description import (
    Ball,
    Body,
    Composed,
    Cylinder,
    Domain,
    Fluid,
    FluidState,
    HalfSpace,
    Shape,
    Solid,
    Tube,
)
from distfsi.scene.detonation_checks import check_reactions
from distfsi.scene.faults import Fault, Path, one_of
from distfsi.scene.interpenetration import overlap
from distfsi.scene.law_tables import GaugeInput
from distfsi.scene.load_checks import check_loads
from distfsi.scene.packing import pack, uses_rings
from distfsi.scene.rigid_checks import check_bars, check_rigid, check_ties
from distfsi.scene.schema import (
    CouplingInput,
    DomainInput,
    FluidInput,
    OutputInput,
    PerformanceInput,
    Sections,
)
from distfsi.scene.shapes import bounding_box
from distfsi.scene.thermodynamics import sound_speed_squared

COARSEST_SPACING = 0.75  # of a fluid cell: wider gaps between particles would let the fluid through
FILE_NAME = re.compile(r"[\w-]+")
LONGEST_NAME = 255  # bytes of a file's name
LONGEST_PATH = 2000  # of the output directory's
LARGEST_TRACES = 0.5  # of a cell that a pure region may leave to absent phases
MAXIMUM_CELLS, MAXIMUM_PARTICLES = 1e11, 1e8
TOUCHING = 1e-3  # of the smaller spacing: bodies that overlap by less touch


def check(
    sections: Sections, present: Container[str], domain: Domain | None, fluid: Fluid | None, solid: Solid | None
) -> Iterator[Fault]:
    """Faults between parts that are valid in themselves; None stands for a part that is absent or invalid.

    `present`: names of the sections of the input, the invalid ones among them.
    """
    if fluid is not None and sections.fluid is not None:
        yield from check_fluid(sections.fluid, fluid)
    if domain is None or sections.domain is None:
        return
    yield from check_performance(sections.performance, domain.dimensions)
    faults = list(check_domain(sections.domain, domain))
    faults += check_coordinates(sections, domain, fluid, solid)
    yield from faults
    if faults:
        return  # nothing can be placed in a domain that is wrong itself
    if fluid is not None and sections.fluid is not None:
        yield from check_inflow(sections.fluid, domain)
        if (level := fluid.hydrostatic_level) is not None:
            yield from check_rest(level, fluid, domain, build_sources(sections.domain.gravity, sections.sources))
    yield from check_output(sections.output, present, domain)
    yield from check_directory(sections.output.directory or "")
    yield from check_gauges(sections.gauges, present, domain, solid)
    if solid is not None:
        yield from check_rigid(sections, solid, domain, "fluid" in present)
        yield from check_bars(solid, domain)
        yield from check_loads(sections, domain, solid, "fluid" in present)
        ties = list(check_ties(solid))
        yield from ties or check_solid(solid, domain, sections.fluid is not None)
        if fluid is not None and len(fluid.phases) > 2:
            yield Fault(("fluid", "phases"), "beside a solid one or two phases are known, not yet more")
        elif fluid is not None:
            yield from check_coupling(sections.coupling, solid, domain, fluid)


def check_domain(given: DomainInput, domain: Domain) -> Iterator[Fault]:
    """Corners, absent axes, periodic pairs."""
    for axis in range(len(AXES)):
        path = ("domain", AXES[axis])
        if axis >= domain.dimensions:
            if AXES[axis] in given.model_fields_set:
                yield Fault(path, f"the domain has {domain.dimensions} dimension(s), so no {AXES[axis]} ends")
            continue
        if domain.lower[axis] >= domain.upper[axis]:
            yield Fault(("domain", "upper"), f"must be greater than lower along {AXES[axis]}")
        if domain.boundaries[axis].count("periodic") == 1:
            yield Fault(path, "one end is periodic; expected both or none")
    if (count := math.prod(domain.cells)) > MAXIMUM_CELLS:
        yield Fault(("domain", "cells"), f"{count:.1e} cells; at most {MAXIMUM_CELLS:.0e}")


def check_fluid(given: FluidInput, fluid: Fluid) -> Iterator[Fault]:
    """Regions and the states in them; a method that has its phases."""
    if fluid.sharpening and len(fluid.phases) < 2:
        yield Fault(("fluid", "sharpening"), "needs an interface, so two phases")
    if len(fluid.phases) > 2:
        yield from check_many_phases(fluid)
    if not fluid.regions:
        yield Fault(("fluid", "regions"), "is empty; expected an initial state")
    for n, (source, region) in enumerate(zip(given.regions, fluid.regions, strict=True)):
        path = ("fluid", "regions", n)
        if n == 0 and region.shape is not None:
            yield Fault((*path, "shape"), "the first region covers the whole domain; expected no shape")
        if n > 0 and region.shape is None:
            yield Fault(path, "covers everything before it; only the first region has no shape")
        yield from _check_state(path, source.energy is not None, region.state, fluid)
    for axis, sides in enumerate(fluid.inflow):
        for side, state in enumerate(sides):
            if state is not None:
                name = f"{AXES[axis]}_{SIDES[side]}"
                by_energy = getattr(given.inflow, name).energy is not None
                yield from _check_state(("fluid", "inflow", name), by_energy, state, fluid)
                yield from _check_history(("fluid", "inflow", name, "history"), state)
    yield from check_reactions(given, fluid)


def check_many_phases(fluid: Fluid) -> Iterator[Fault]:
    """What three and more phases can do, and how they are named in files."""
    others = len(fluid.phases) - 1
    if others * fluid.minimum_volume_fraction >= LARGEST_TRACES:
        text = f"leaves traces of {others} absent phases too much; expected below {LARGEST_TRACES / others:.3g}"
        yield Fault(("fluid", "minimum_volume_fraction"), text)
    for name in ("detonation", "afterburn", "map"):
        if getattr(fluid, name) is not None:
            yield Fault(("fluid", name), "is known of one or two phases only, not yet of more")
    for phase in fluid.phases:
        if not FILE_NAME.fullmatch(phase.name):
            yield Fault(("fluid", "phases", phase.name), "names a field; expected letters, digits, '_' and '-' only")


def _check_history(path: Path, state: FluidState) -> Iterator[Fault]:
    if state.history is not None and state.pressure + state.history.lowest <= 0.0:
        yield Fault(path, f"falls by {-state.history.lowest:.3g} Pa, more than the pressure; expected a positive one")


def check_rest(level: float, fluid: Fluid, domain: Domain, sources: tuple[Source, ...]) -> Iterator[Fault]:
    """A fluid is at rest under a force that acts along one axis and does not change."""
    path = ("fluid", "hydrostatic_level")
    forces = [sum(source.acceleration[axis] for source in sources) for axis in range(domain.dimensions)]
    axes = [axis for axis, force in enumerate(forces) if force != 0.0]
    if len(axes) != 1 or not all(source.steady for source in sources):
        yield Fault(path, "needs gravity, steady and along one axis")
        return
    (axis,) = axes
    if not domain.lower[axis] <= level <= domain.upper[axis]:
        yield Fault(path, f"lies outside the domain along {AXES[axis]}")
    if any(kind in ("periodic", "inflow") for kind in domain.boundaries[axis]):
        yield Fault(
            path, f"nothing is at rest between '{' and '.join(domain.boundaries[axis])}' ends along {AXES[axis]}"
        )
    if any(fluid.regions[0].state.velocity):
        yield Fault(path, "the first region moves")


def _check_state(path: Path, by_energy: bool, state: FluidState, fluid: Fluid) -> Iterator[Fault]:
    """A mixture needs two phases within their bounds, a state a real sound speed."""
    if state.volume_fraction is not None:
        limit = fluid.minimum_volume_fraction
        if len(fluid.phases) != 2:
            yield Fault((*path, "volume_fraction"), "needs two phases, and no more")
        elif not limit <= state.volume_fraction <= 1.0 - limit:
            yield Fault((*path, "volume_fraction"), f"expected {limit:g} to 1 - {limit:g} (`minimum_volume_fraction`)")
    phase = fluid.phases[state.phase]
    if state.density >= phase.eos.maximum_density:
        text = f"too high: '{phase.name}' has states below {phase.eos.maximum_density:.6g} kg/m3 only"
        yield Fault((*path, "density"), text)
        return
    cold_pressure, cold_energy = phase.eos.cold_curve(state.density)
    if fluid.detonation is not None and fluid.detonation.phase == state.phase:
        cold_pressure = 0.0  # what is unburnt has no energy yet, and is no gas
    if state.pressure > cold_pressure and sound_speed_squared(phase.eos, state.density, state.pressure) > 0.0:
        return
    key, bound = ("energy", f"{cold_energy:.6g} J/kg") if by_energy else ("pressure", f"{cold_pressure:.6g} Pa")
    yield Fault((*path, key), f"too low: at this density '{phase.name}' has a sound speed only above {bound}")


def check_inflow(given: FluidInput, domain: Domain) -> Iterator[Fault]:
    """Each inflow end has its state and each state its end."""
    for axis, side in itertools.product(range(len(AXES)), range(2)):
        name = f"{AXES[axis]}_{SIDES[side]}"
        path = ("fluid", "inflow", name)
        kind = domain.boundaries[axis][side] if axis < domain.dimensions else None
        state = getattr(given.inflow, name)
        if kind == "inflow" and state is None:
            yield Fault(path, f"is missing: the {SIDES[side]} {AXES[axis]} end of the domain is 'inflow'")
        if kind != "inflow" and state is not None:
            what = f"is '{kind}'; expected 'inflow'" if kind else "does not exist"
            yield Fault(path, f"has a state, but the {SIDES[side]} {AXES[axis]} end of the domain {what}")


def check_solid(solid: Solid, domain: Domain, in_fluid: bool) -> Iterator[Fault]:
    """Bodies lie in the domain, can be packed and do not overlap; a method that has its form; ends that know them."""
    if solid.artificial_stress > 0.0 and "updated_lagrangian" not in map(solid.form_of, solid.bodies):
        yield Fault(("solid", "artificial_stress"), 'bonds cannot clump; it needs form = "updated_lagrangian"')
    for axis, ends in enumerate(domain.boundaries):
        if "periodic" in ends and (in_fluid or any(body.motion for body in solid.bodies)):
            which = "bodies in a fluid" if in_fluid else "rigid parts"
            yield Fault(("domain", AXES[axis]), f"periodic; a scene with {which} needs ends of another kind")
    packed: list[tuple[Body, np.ndarray]] = []
    for body in solid.bodies:
        path = body.path
        faults = list(_check_body(path, body, domain))
        if faults:
            yield from faults
            continue
        yield from _check_extent((*path, "shape"), body, domain)
        if (count := _number_of_particles(body, domain)) > MAXIMUM_PARTICLES:
            text = f"{body.spacing:.6g} m makes about {count:.1e} particles; at most {MAXIMUM_PARTICLES:.0e}"
            yield Fault((*path, "spacing"), text)
            continue
        positions, _ = pack(body, domain.lower, domain.upper)
        if len(positions) == 0:
            yield Fault((*path, "shape"), "no particle of it lies inside the domain")
        else:
            packed.append((body, positions))
    for first, second in itertools.combinations(packed, 2):
        (a, points_of_a), (b, points_of_b) = first, second
        points, spacings = np.concatenate([points_of_a, points_of_b]), (a.spacing, b.spacing)
        if (thickness := overlap(a.shape, b.shape, points, max(spacings))) > TOUCHING * min(spacings):
            yield Fault((*b.path, "shape"), f"overlaps body '{a.name}' by {thickness:.6g} m")


def _check_body(path: Path, body: Body, domain: Domain) -> Iterator[Fault]:
    """What a body asks for goes together."""
    shape, turned = body.shape, body.lattice_angle != 0.0
    is_round = isinstance(shape, Ball | Tube | Cylinder) and domain.dimensions > 1
    if body.packing == "rings" and not is_round:
        yield Fault((*path, "packing"), "'rings' need a tube, ball or cylinder, in 2D or 3D")
    if turned and (isinstance(shape, Composed) or body.packing == "relaxed"):
        yield Fault((*path, "lattice_angle"), "needs a simple shape with a lattice; kind = 'rotate' turns any other")
    elif turned and (uses_rings(body) or isinstance(shape, HalfSpace) or domain.dimensions == 1):
        yield Fault((*path, "lattice_angle"), "needs packing = 'lattice', another shape than a half space, 2D or 3D")
    elif turned and _cut_off_axis(shape, domain):
        yield Fault((*path, "lattice_angle"), "a turned lattice has no symmetry planes; expected a whole body")
    if body.packing == "relaxed" and isinstance(shape, HalfSpace):
        yield Fault((*path, "packing"), "a half space has no relaxed packing; expected 'lattice'")
    if body.radial_velocity and not isinstance(shape, Ball | Tube | Cylinder):
        yield Fault((*path, "radial_velocity"), "needs a ball, tube or cylinder")
    if body.fixed_velocity and body.fixed is None:
        yield Fault((*path, "fixed_velocity"), "needs a `fixed` shape")
    if (pair := _lone_partner(body)) is not None:
        yield Fault((*path, "strength"), "'{}' and the eos '{}' need each other".format(*pair))


def _lone_partner(body: Body) -> tuple[str, str] | None:
    """Words of a strength and an EOS that need each other, if the body has but one of them."""
    strength, eos = word_of(type(body.strength)), word_of(type(body.eos))
    pairs = ((body.eos.partner or strength, eos), (strength, body.strength.partner or eos))
    return next((pair for pair in pairs if pair != (strength, eos)), None)


def _cut_off_axis(shape: Shape, domain: Domain) -> bool:
    """Whether the domain cuts a shape along another axis than the one its lattice turns about."""
    lower, upper = bounding_box(shape)
    turning = int(np.argmax(np.abs(np.subtract(shape.end, shape.start)))) if isinstance(shape, Cylinder) else 2
    sides = zip(lower, upper, domain.lower, domain.upper, strict=True)
    return any(axis != turning and (a < low or b > high) for axis, (a, b, low, high) in enumerate(sides))


def _number_of_particles(body: Body, domain: Domain) -> float:
    """About how many particles it takes to pack a body."""
    match body.shape:
        case Tube(_, inner, outer):
            extents = [outer - inner, math.pi * (outer + inner)]
        case Ball(_, radius):
            extents = [2.0 * radius] * domain.dimensions
        case Cylinder(start, end, outer, inner):
            extents = [math.dist(start, end), outer - inner, math.pi * (outer + inner)]
        case Cloud() as cloud:
            return float(len(cloud.positions))
        case shape:
            lower, upper = bounding_box(shape)
            extents = list(np.minimum(upper, domain.upper) - np.maximum(lower, domain.lower))
    return math.prod(max(float(extent), 0.0) / body.spacing for extent in extents)


def _check_extent(path: Path, body: Body, domain: Domain) -> Iterator[Fault]:
    """Only a symmetry plane may cut a body; a half space means to be cut."""
    if isinstance(body.shape, HalfSpace):
        return
    lower, upper = bounding_box(body.shape)
    for axis, ends in enumerate(domain.boundaries):
        slack = 1e-6 * body.spacing
        beyond = (lower[axis] < domain.lower[axis] - slack, upper[axis] > domain.upper[axis] + slack)
        for side in range(2):
            if beyond[side] and math.isfinite((lower, upper)[side][axis]) and ends[side] != "symmetry":
                where = f"the {SIDES[side]} {AXES[axis]} end of the domain"
                yield Fault(path, f"reaches beyond {where}, which is '{ends[side]}'; only 'symmetry' may cut a body")


def check_coupling(given: CouplingInput, solid: Solid, domain: Domain, fluid: Fluid) -> Iterator[Fault]:
    """Bodies in a fluid are tight, and faces look no farther than to the next cells."""
    if given.drop_below is not None and given.scheme == "immersed_boundary":
        yield Fault(("coupling", "drop_below"), "needs scheme 'cut_cells'")
    if fluid.reconstruction == "weno5":
        yield Fault(("fluid", "reconstruction"), "'weno5' looks past the cells beside a solid; expected another")
    coarsest = COARSEST_SPACING * min(domain.spacing)
    for body in solid.bodies:
        if body.spacing > coarsest:
            path = (*body.path, "spacing")
            text = f"{body.spacing:.6g} m is too coarse for the fluid cells; expected at most {coarsest:.6g} m"
            yield Fault(path, f"{text}, {COARSEST_SPACING} of the smallest cell; half a cell is better")


def check_output(given: OutputInput, present: Container[str], domain: Domain) -> Iterator[Fault]:
    """Fields of the cells need cells; the stop file lies in the output directory."""
    stop_file = stop_file_in(given.directory or "", given.stop_file)
    if stop_file in ("", ".", "..") or {"/", "\0"} & set(stop_file) or len(stop_file.encode()) > LONGEST_NAME:
        text = f"{given.stop_file[:LONGEST_NAME]!r}; expected the name of a file, which lies in the output directory"
        yield Fault(("output", "stop_file"), text)
    for key in ("peaks", "schlieren"):
        if getattr(given, key) and "fluid" not in present:
            yield Fault(("output", key), "needs a fluid")
    if given.schlieren and domain.dimensions == 1:
        yield Fault(("output", "schlieren"), "needs two or three dimensions")


def check_directory(given: str) -> Iterator[Fault]:
    """Its name is one that file systems take."""
    if len(given.encode()) > LONGEST_PATH or any(len(part.encode()) > LONGEST_NAME for part in given.split("/")):
        yield Fault(("output", "directory"), f"'{given[:40]}...' is too long for the name of a directory")


def check_gauges(
    given: Mapping[str, GaugeInput], present: Container[str], domain: Domain, solid: Solid | None
) -> Iterator[Fault]:
    """Gauges have something to measure, inside the domain."""
    bodies = [body.name for body in solid.bodies] if solid else []
    for name, table in given.items():
        path, gauge = ("gauges", name), table.build()
        if not FILE_NAME.fullmatch(name):
            yield Fault(path, "is no name for a file; expected letters, digits, - and _")
        if gauge.needs not in present:
            yield Fault((*path, "kind"), f"'{table.kind}' needs a {gauge.needs}")
        elif gauge.needs == "fluid" or solid is not None:
            for key, text in list(gauge.faults(domain.dimensions, bodies)) or _misplaced(gauge, domain):
                yield Fault((*path, key), text + (one_of(bodies, getattr(gauge, key)) if key == "body" else ""))


def _misplaced(gauge: Gauge, domain: Domain) -> Iterator[tuple[str, str]]:
    for key, position in gauge.positions().items():
        if not all(domain.lower[axis] <= x <= domain.upper[axis] for axis, x in position.items()):
            yield key, "lies outside the domain"
    for key, (axis, side) in gauge.walls().items():
        if (kind := domain.boundaries[axis][side]) != "wall":
            yield key, f"is an end of kind '{kind}'; expected a wall"


def check_performance(given: PerformanceInput, dimensions: int) -> Iterator[Fault]:
    """One block and tile size per dimension, tiles within blocks."""
    for key in ("block_cells", "tile_cells"):
        sizes = getattr(given, key)
        if sizes is not None and len(sizes) != dimensions:
            yield Fault(("performance", key), f"has {len(sizes)} entries, needs {dimensions}")
    block, tile = given.block_cells or (), given.tile_cells or ()
    if any(t > b for t, b in zip(tile, block, strict=False)):
        yield Fault(("performance", "tile_cells"), "a tile is larger than a block")
