"""The charges of a scene: how much of each is placed in the cells, how finely, how far away things are from it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from distfsi.laws.fluid.jwl import Jwl
from distfsi.narrowing import present
from distfsi.scene.description import Body, Domain, HalfSpace, Region, Scene, Shape
from distfsi.scene.fractions import Filled, cell_fractions, corrected
from distfsi.scene.shapes import bounding_box, distance, smallest_extent, volume_within
from distfsi.scene.thermodynamics import energy

TNT = 4.184e6  # J/kg of the TNT that explosives are compared with
CELL_LIMIT = 2_000_000  # around a charge: of more it is taken for granted that they hold what is meant
ENOUGH = 8  # cells per radius
POINTS = 12  # per axis, at which the distance between a charge and a body is looked for

# What a coarse charge costs: cells per radius; the part of the peak overpressure that is missing; the part by which the
# impulse is off, too high near the charge (docs/measurements.md).
LOSSES = ((1, 0.57, 0.52), (2, 0.48, 0.34), (3, 0.38, 0.25), (5, 0.25, 0.11), (8, 0.16, 0.07), (12, 0.10, 0.04))


@dataclass(frozen=True)
class Charge:
    """An explosive's region.

    number   of the region; name: of its phase
    meant    mass [kg], per metre in fewer than three dimensions, of the shape inside the domain
    placed   mass of what the cells hold, without what later regions and bodies hide
    energy   [J/kg]
    copies   how many there are of what lies in the domain, with all images in symmetry planes
    cells    per radius: half its smallest extent
    shape
    """

    number: int
    name: str
    meant: float
    placed: float
    energy: float
    copies: int
    cells: float
    shape: Shape

    @property
    def tnt(self) -> float:
        """Mass of TNT [kg] with the energy of the whole charge."""
        return self.copies * self.meant * self.energy / TNT

    @property
    def center(self) -> np.ndarray:
        """(D,) [m]"""
        return 0.5 * np.sum(bounding_box(self.shape), axis=0)

    def scaled(self, length: float) -> float:
        """Z [m/kg^(1/3)] of a distance [m] in three dimensions."""
        return length / self.tnt ** (1.0 / 3.0)


def charges(scene: Scene) -> list[Charge]:
    """Those that have a size, in the order of the regions."""
    fluid, domain = scene.fluid, scene.domain
    found = []
    for number, region in enumerate(fluid.regions if fluid else ()):
        phase = present(fluid).phases[region.state.phase]
        extent = None if region.shape is None else smallest_extent(region.shape)
        if not isinstance(phase.eos, Jwl) or region.shape is None or extent is None:
            continue
        state = region.state
        share = 1.0 if state.volume_fraction is None else state.volume_fraction
        placed, meant = (share * state.density * volume for volume in _volumes(scene, number, region.shape))
        detonation = present(fluid).detonation
        burns = detonation is not None and detonation.phase == state.phase
        e = present(detonation).burn.energy if burns else energy(phase.eos, state.density, state.pressure)
        cells = 0.5 * extent / max(domain.spacing)
        found.append(Charge(number, phase.name, meant, placed, e, _copies(region.shape, domain), cells, region.shape))
    return found


def losses(cells: float) -> tuple[float, float]:
    """Part of the peak overpressure that is missing, and by which the impulse is off, with so many cells per radius:
    between those that were measured."""
    known = np.array(LOSSES)
    at = np.log(np.clip(cells, known[0, 0], known[-1, 0]))
    peak, impulse = (float(np.interp(at, np.log(known[:, 0]), column)) for column in known[:, 1:].T)
    return peak, impulse


def _volumes(scene: Scene, number: int, shape: Shape) -> tuple[float, float]:
    """Volume that the cells hold of a region's shape, and that of the shape inside the domain."""
    domain, coordinates = scene.domain, scene.domain.coordinates
    exact = None if coordinates.radial else volume_within(shape, domain.lower, domain.upper)
    centers = _cells_around(shape, domain)
    cell = _cell_volumes(centers[0], domain)
    count = math.prod(map(len, centers))
    if count == 0:
        return 0.0, exact or 0.0
    if count > CELL_LIMIT and exact is not None:
        return exact, exact
    part = cell_fractions(shape, centers, domain.spacing, coordinates)
    if exact is not None:
        part = corrected(part, Filled.by(part), exact / math.prod(domain.spacing))
    meant = float((cell * part).sum()) if exact is None else exact
    later = present(scene.fluid).regions[number + 1 :]
    hiding: list[Shape] = [region.shape for region in later if region.shape is not None]
    hiding += [body.shape for body in scene.solid.bodies] if scene.solid else []
    for other in hiding:
        part = part * (1.0 - cell_fractions(other, centers, domain.spacing, coordinates))
    return float((cell * part).sum()), meant


def _cell_volumes(x: np.ndarray, domain: Domain) -> np.ndarray:
    """Of the cells about centers x (n,) along the first axis (n,)."""
    h, *others = domain.spacing
    return domain.coordinates.volume(x - 0.5 * h, x + 0.5 * h) * math.prod(others)


def _cells_around(shape: Shape, domain: Domain) -> tuple[np.ndarray, ...]:
    """Centers along each axis of the cells that a shape may touch."""
    found = []
    for axis, (low, high) in enumerate(zip(*bounding_box(shape), strict=True)):
        start, h, n = domain.lower[axis], domain.spacing[axis], domain.cells[axis]
        first, last = (min(max((x - start) / h, 0.0), n) for x in (low, high))
        found.append(start + (np.arange(math.floor(first), min(math.floor(last) + 1, n)) + 0.5) * h)
    return tuple(found)


def _copies(shape: Shape, domain: Domain) -> int:
    """How often a shape stands there with its images in the symmetry planes that cut it."""
    copies = 1
    for axis, (low, high) in enumerate(zip(*bounding_box(shape), strict=True)):
        ends = zip(domain.boundaries[axis], (domain.lower[axis], domain.upper[axis]), strict=True)
        copies *= 2 ** sum(kind == "symmetry" and low < at < high for kind, at in ends)
    return copies


# ---- what is near ----------------------------------------------------------------------------------------------------


def gap_between(charge: Charge, body: Body, domain: Domain) -> float:
    """Distance [m] between a charge and a body inside the domain, about; negative where they overlap."""
    low, high = (np.clip(corner, domain.lower, domain.upper) for corner in bounding_box(charge.shape))
    axes = [np.linspace(a, b, POINTS * 4) for a, b in zip(low, high, strict=True)]
    points = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=1)
    inside = points[distance(charge.shape, points) <= 1e-9 * float(np.max(high - low))]
    return float(distance(body.shape, inside).min()) if len(inside) else math.inf


def distances(scene: Scene, charge: Charge) -> Iterator[tuple[str, float]]:
    """Names of bodies and of gauges at points, and how far their nearest point is from the charge's center [m]."""
    for body in scene.solid.bodies if scene.solid else ():
        if not isinstance(body.shape, HalfSpace):
            yield f"body '{body.name}'", max(float(distance(body.shape, charge.center[None])[0]), 0.0)
    for name, gauge in scene.gauges.items():
        for key, position in gauge.positions().items():
            if key == "position" and len(position) == scene.domain.dimensions:
                yield f"gauge '{name}'", math.dist(tuple(position.values()), charge.center)


def region_of(scene: Scene, charge: Charge) -> Region:
    """The region that a charge is."""
    return present(scene.fluid).regions[charge.number]
