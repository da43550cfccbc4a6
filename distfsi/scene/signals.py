"""How fast a scene moves: which states meet at the start, the fastest signals, the number of steps to its end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_edt

from distfsi.narrowing import present
from distfsi.scene.description import Body, Domain, Fluid, FluidState, Scene, Shape
from distfsi.scene.fractions import cell_fractions
from distfsi.scene.shapes import contains, distance
from distfsi.scene.thermodynamics import solid_sound
from distfsi.scene.waves import Side, Wave, meet

SAMPLES = {1: 4096, 2: 512, 3: 96}  # points along an axis at which a scene is looked at, at most
COVERED = -1


@dataclass(frozen=True)
class Contact:
    """Two states that meet along `axis`; `first` lies at the lower coordinate."""

    axis: int
    first: FluidState
    second: FluidState


class Layout:
    """The fluid of a scene at its start, seen at the centers of a grid of points as fine as the cells or SAMPLES allow.

    centers, spacing  of the points, along x, y, z [m]
    region            (n_z, n_y, n_x), used axes only: number of the region at each point, COVERED in and next to bodies
    """

    def __init__(self, scene: Scene):
        domain = scene.domain
        self.domain, self.fluid = domain, present(scene.fluid)
        counts = [min(n, SAMPLES[domain.dimensions]) for n in domain.cells]
        ends = zip(domain.lower, domain.upper, counts, strict=True)
        self.centers = [a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in ends]
        self.spacing = [(b - a) / n for a, b, n in zip(domain.lower, domain.upper, counts, strict=True)]
        grids = np.meshgrid(*reversed(self.centers), indexing="ij")
        points = np.stack([grid.ravel() for grid in reversed(grids)], axis=1)
        region = np.zeros(len(points), dtype=np.int64)
        for number, part in enumerate(self.fluid.regions):
            if part.shape is not None:
                region[self._inside(part.shape, points)] = number
        reach = 0.5 * math.hypot(*self.spacing)
        for body in scene.solid.bodies if scene.solid else ():
            region[distance(body.shape, points) < reach] = COVERED
        self.region = region.reshape(grids[0].shape)

    def _inside(self, shape: Shape, points: np.ndarray) -> np.ndarray:
        """Which of `points` (n, D) lie in a shape; of one that lies between them, that about which it fills most."""
        inside = contains(shape, points)
        if not inside.any():
            filled = cell_fractions(shape, tuple(self.centers), tuple(self.spacing)).ravel()
            inside[np.argmax(filled)] = filled.any()
        return inside

    @cached_property
    def contacts(self) -> list[Contact]:
        """All pairs of different states that meet, at the domain's inflows too."""
        return [*self._between_regions(), *self._at_inflows()]

    def _between_regions(self) -> Iterator[Contact]:
        for axis in range(self.domain.dimensions):
            lower, upper = self.neighbours(axis)
            meeting = (lower != upper) & (lower != COVERED) & (upper != COVERED)
            for first, second in np.unique(np.stack([lower[meeting], upper[meeting]]), axis=1).T.tolist():
                yield Contact(axis, self.fluid.regions[first].state, self.fluid.regions[second].state)

    def _at_inflows(self) -> Iterator[Contact]:
        for axis, sides in enumerate(self.fluid.inflow):
            for side, state in enumerate(sides):
                if state is None:
                    continue
                edge = np.asarray(self.region.take(-side, axis=self.region.ndim - 1 - axis))
                for number in np.unique(edge[edge != COVERED]).tolist():
                    inner = self.fluid.regions[number].state
                    yield Contact(axis, inner, state) if side else Contact(axis, state, inner)

    @cached_property
    def sources(self) -> np.ndarray:
        """Which points send out waves at the start: bodies, edges between states of other pressure or velocity, ends of
        the domain that a flow meets."""
        sources = self.region == COVERED
        contents = [(r.state.pressure, r.state.velocity) for r in self.fluid.regions]
        kinds = np.array([contents.index(content) for content in contents] + [COVERED])[self.region]
        for axis in range(self.domain.dimensions):
            along = kinds.ndim - 1 - axis
            edges = np.diff(kinds, axis=along) != 0
            for end in (0, edges.shape[along]):
                sources |= np.insert(edges, end, False, axis=along)
            moving = any(r.state.velocity[axis] for r in self.fluid.regions)
            for side in (0, 1):
                if moving or self.fluid.inflow[axis][side]:
                    sources[(slice(None),) * along + (-side,)] = True
        return sources

    def neighbours(self, axis: int) -> tuple[np.ndarray, np.ndarray]:
        """Regions of all points but the last along `axis`, and of the next points."""
        along = self.region.ndim - 1 - axis
        return np.delete(self.region, -1, axis=along), np.delete(self.region, 0, axis=along)


def states(fluid: Fluid) -> list[FluidState]:
    """All states that the fluid starts from or that come in."""
    return [region.state for region in fluid.regions] + [s for sides in fluid.inflow for s in sides if s]


def waves(fluid: Fluid, contact: Contact) -> list[Wave]:
    """The states on both sides of a contact and those that form between them, with velocities along its axis."""
    sides = []
    for state, sign in ((contact.first, 1.0), (contact.second, -1.0)):
        eos = fluid.phases[state.phase].eos
        sides.append(Side(eos, state.density, state.pressure, sign * state.velocity[contact.axis]))
    return meet(*sides)


def _sound(fluid: Fluid, state: FluidState) -> float:
    return Side(fluid.phases[state.phase].eos, state.density, state.pressure, 0.0).sound


def fastest_signal(scene: Scene, layout: Layout) -> float:
    """Largest |u| + c [m/s] in the fluid and in the bodies until waves reflect."""
    speeds = [abs(wave.velocity) + wave.sound for c in layout.contacts for wave in waves(layout.fluid, c)]
    for state in states(layout.fluid):
        speeds.append(math.hypot(*state.velocity) + _sound(layout.fluid, state))
    for body in scene.solid.bodies if scene.solid else ():
        speeds.append(math.hypot(*body.velocity) + solid_sound(body))
    return max(speeds)


def moving_share(scene: Scene, layout: Layout) -> float:
    """Share of the fluid's tiles that compute, as the mean over the time of the run: a tile of one state rests until
    the first wave comes."""
    if scene.sources:
        return 1.0
    speeds = [abs(wave.velocity) + wave.sound for c in layout.contacts for wave in waves(layout.fluid, c)]
    speed = max(speeds) if speeds else max(_sound(layout.fluid, state) for state in states(layout.fluid))
    if not layout.sources.any():
        return 0.0
    arrival = distance_transform_edt(~layout.sources, sampling=layout.spacing[::-1]) / speed
    points_along: tuple[int, ...] = layout.region.shape[::-1]
    sizes = zip(scene.performance.tile_cells, scene.domain.cells, points_along, strict=True)
    for axis, (tile, cells, points) in enumerate(sizes):
        edges = np.unique(np.arange(0, cells, tile) * points // cells)
        along = layout.region.ndim - 1 - axis
        first = np.minimum.reduceat(arrival, edges, axis=along)
        arrival = np.repeat(first, np.diff([*edges, points]), axis=along)
    return float(np.mean(np.clip(1.0 - arrival / end_time(scene, layout), 0.0, 1.0)))


def steps(scene: Scene, layout: Layout | None) -> int:
    """Number of time steps, if nothing later is faster than the waves that the start sends out."""
    count = math.ceil(scene.time.end * _step_rate(scene, layout))
    limit = scene.time.maximum_steps
    return count if limit is None else min(count, limit)


def end_time(scene: Scene, layout: Layout | None) -> float:
    """When the run ends [s], by its end time or its number of steps."""
    limit = scene.time.maximum_steps
    return scene.time.end if limit is None else min(scene.time.end, limit / _step_rate(scene, layout))


def sub_steps(scene: Scene, layout: Layout | None) -> float:
    """How many steps the solid makes in one of the run, as a mean."""
    return max(_solid_rate(scene) / _step_rate(scene, layout), 1.0)


def _step_rate(scene: Scene, layout: Layout | None) -> float:
    """1/dt [1/s]."""
    rate = fluid_rate(scene, layout) / scene.time.cfl if layout else 0.0
    parts = scene.coupling.sub_steps if layout and scene.coupling.scheme != "immersed_boundary" else 1
    return max(rate, _solid_rate(scene) / parts)


def _solid_rate(scene: Scene) -> float:
    """1/dt [1/s] of the body that needs the shortest steps; 0 without one."""
    if scene.solid is None or scene.solid.obstacles:
        return 0.0
    bodies = scene.solid.bodies
    meets = len(bodies) > 1 or any("wall" in ends for ends in scene.domain.boundaries)
    return max((solid_rate(scene, body) for body in bodies if meets or not body.motion), default=0.0)


def fluid_rate(scene: Scene, layout: Layout) -> float:
    """max sum_d (|u_d| + c)/h_d [1/s] over the states of the start and those that form where they meet."""
    fluid, domain = layout.fluid, scene.domain
    rates: list[float] = []
    for state in states(fluid):
        sound = _sound(fluid, state)
        rates.append(sum((abs(u) + sound) / h for u, h in zip(state.velocity, domain.spacing, strict=True)))
    for contact in layout.contacts:
        for wave in waves(fluid, contact):
            rates.append(abs(wave.velocity) / domain.spacing[contact.axis] + wave.sound * _inverse_sum(domain))
    return max(rates)


def _inverse_sum(domain: Domain) -> float:
    return sum(1.0 / h for h in domain.spacing)


def solid_rate(scene: Scene, body: Body) -> float:
    """1/dt [1/s] of a body's particles (Monaghan's condition, safety 0.3), compressed by the fastest impact.

    With bonds only a shock is viscous, not all there is.
    """
    solid, c = present(scene.solid), solid_sound(body)
    alpha = solid.viscosity_alpha if solid.form_of(body) == "updated_lagrangian" else 0.0
    closing = (math.dist(body.velocity, other.velocity) for other in solid.bodies)
    faster, volume = body.eos.behind_shock(0.5 * max(closing))
    c += faster
    h = solid.smoothing * body.spacing * max(volume, 0.1) ** (1.0 / scene.domain.dimensions)
    return c * (1.0 + 0.6 * alpha) / (0.3 * h)
