"""What a reader of a report looks for first: blast at gauges beside the curves, deflections, fragments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from distfsi.air_blast import FREE_AIR, SURFACE, AirBlast, air_blast
from distfsi.narrowing import present
from distfsi.results import Results
from distfsi.scene.description import Scene
from distfsi.scene.packing import pack
from distfsi.scene.placed_charges import charges

ARRIVED = 0.05  # of the highest overpressure
NEAR = 1.5  # cells: a gauge, or a charge, that is no farther from an end of the domain is at it
HEAD_ON = 0.2  # to the side, over the distance of the wall: up to here the curves for a reflected wave hold
AIR_DENSITY, AIR_PRESSURE = (1.0, 1.4), (9e4, 1.1e5)  # of what the curves call air [kg/m3, Pa]
SMALLEST = 8  # particles of a fragment that is counted; fewer are debris


# ---- blast -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Blast:
    """At a gauge: highest overpressure [Pa], when the wave arrives [s], highest impulse [Pa s]; beside them what the
    curves give for the same charge, and `kind`: which of them, or why none."""

    gauge: str
    location: str
    peak: float
    arrival: float
    impulse: float
    kind: str
    curves: AirBlast | None

    @property
    def expected(self) -> tuple[float, float, float] | None:
        """Peak, arrival and impulse of the curves."""
        if self.curves is None:
            return None
        name = self.kind.partition(",")[0]
        peak, impulse = (float(getattr(self.curves, f"{name}_{what}")) for what in ("pressure", "impulse"))
        return peak, self.curves.arrival, impulse


@dataclass(frozen=True)
class Burst:
    """One charge in air: center (D,) [m], mass [kg] of TNT with its energy, and whether it stands on hard ground."""

    center: np.ndarray
    tnt: float
    on_ground: bool


def blasts(results: Results) -> Iterator[Blast]:
    """The blast at all gauges at points of the fluid that a wave has reached."""
    scene, locations = results.scene, results.journal.get("gauges", {})
    burst = burst_of(scene)
    for name, table in results.gauges.items():
        if "overpressure" not in table or "x" in table or not len(table["time"]):
            continue
        over, impulse = np.nan_to_num(table["overpressure"]), np.nan_to_num(table["impulse"])
        peak = float(over.max())
        if peak <= 0.0:
            continue
        arrival = float(table["time"][int(np.argmax(over >= ARRIVED * peak))])
        position = scene.gauges[name].positions().get("position") if name in scene.gauges else None
        kind, curves = _curves(scene, burst, position)
        yield Blast(name, locations.get(name, ""), peak, arrival, float(impulse.max()), kind, curves)


def burst_of(scene: Scene) -> Burst | None:
    """The only charge of a scene or its stages, if it is whole and in air at sea level; in the coordinates of the
    scene."""
    every = [(stage, charge) for stage in (*scene.stages, scene) for charge in charges(stage)]
    if len(every) != 1 or scene.fluid is None:
        return None
    (stage, charge), air = every[0], scene.fluid.regions[0].state
    whole = stage.domain.dimensions + stage.domain.coordinates.turns == 3
    is_air = AIR_DENSITY[0] < air.density < AIR_DENSITY[1] and AIR_PRESSURE[0] < air.pressure < AIR_PRESSURE[1]
    if not whole or not is_air:
        return None
    center = np.asarray(charge.center if stage is scene else present(scene.fluid.map).center, dtype=float)
    if scene.domain.coordinates.radial:
        center[0] = 0.0
    on_ground = any(kind == "wall" for kind, _ in _ends_at(scene, center))
    # A sphere that is mapped onto hard ground stands for the hemisphere above it.
    share = 0.5 if on_ground and stage is not scene else 1.0
    return Burst(center, share * charge.tnt, on_ground)


def _curves(scene: Scene, burst: Burst | None, position: Any) -> tuple[str, AirBlast | None]:
    """Which curves tell of a gauge at a position, and what they give; or why none do."""
    if burst is None or position is None or len(position) != len(burst.center):
        return "no curves: not one charge in air", None
    at = np.array(list(position.values()))
    own = {end for _, end in _ends_at(scene, burst.center)}
    facing = [
        axis for kind, (axis, side) in _ends_at(scene, at) if kind in ("wall", "symmetry") and (axis, side) not in own
    ]
    way = at - burst.center
    kind = "incident"
    if facing:
        straight = abs(way[facing[0]])
        if len(facing) > 1 or np.linalg.norm(np.delete(way, facing[0])) > HEAD_ON * straight:
            return "no curves: at a wall, but not head on", None
        kind = "reflected"
    if scene.solid:
        return "no curves: bodies stand in the way", None
    try:
        found = air_blast(burst.tnt, float(np.linalg.norm(way)), SURFACE if burst.on_ground else FREE_AIR)
    except ValueError:
        return "no curves: out of their range", None
    return f"{kind}, {'hemisphere on the ground' if burst.on_ground else 'sphere in free air'}", found


def _ends_at(scene: Scene, point: np.ndarray) -> list[tuple[str, tuple[int, int]]]:
    """Kinds of the ends of the domain that a point is at, each with axis and side."""
    domain, found = scene.domain, []
    for axis, (kinds, h) in enumerate(zip(domain.boundaries, domain.spacing, strict=True)):
        for side, (kind, end) in enumerate(zip(kinds, (domain.lower[axis], domain.upper[axis]), strict=True)):
            if abs(point[axis] - end) <= NEAR * h:
                found.append((str(kind), (axis, side)))
    return found


# ---- bodies ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Motion:
    """Of a body between the first and the last files: the largest displacement of a particle [m], where that was at
    first (3,) [m], and the highest speed at the end [m/s]."""

    body: str
    displacement: float
    position: np.ndarray
    speed: float


def motions(results: Results) -> Iterator[Motion]:
    """How far each body has gone or been bent."""
    solid = results.scene.solid
    if solid is None or not len(results.times("particles")):
        return
    first, last = results.particles(0.0), results.particles()
    start, end = (np.argsort(each["id"]) for each in (first, last))
    if not np.array_equal(first["id"][start], last["id"][end]):
        start, end = _common(first["id"], last["id"])
    moved = np.linalg.norm(last["position"][end] - first["position"][start], axis=1)
    speed, body = np.linalg.norm(last["velocity"][end], axis=1), last["body"][end]
    for number, each in enumerate(solid.bodies):
        own = np.flatnonzero(body == number)
        if len(own):
            farthest = own[int(np.argmax(moved[own]))]
            position = first["position"][start][farthest]
            yield Motion(each.name, float(moved[farthest]), position, float(speed[own].max()))


def _common(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    _, start, end = np.intersect1d(first, last, return_indices=True)
    return start, end


@dataclass(frozen=True)
class Fragments:
    """Pieces of at least SMALLEST particles, the heaviest first: mass [kg, per metre in two dimensions], speed [m/s],
    size [m] (the longest edge of the box about it), each (n,); the share of the mass that is debris."""

    mass: np.ndarray
    speed: np.ndarray
    size: np.ndarray
    debris: float


def fragments(results: Results) -> Fragments | None:
    """What intact bonds hold together at the end; None where nothing has come off."""
    scene = results.scene
    if scene.solid is None or not len(results.times("particles")):
        return None
    last = results.particles()
    if "piece" not in last:
        return None
    each = np.array([_mass_of_particle(scene, number) for number in range(len(scene.solid.bodies))])[last["body"]]
    labels, piece, count = np.unique(last["piece"], return_inverse=True, return_counts=True)
    if len(labels) <= len(scene.solid.bodies):
        return None
    mass = np.bincount(piece, each)
    velocity = np.stack([np.bincount(piece, each * v) for v in last["velocity"].T], axis=1) / mass[:, None]
    low, high = np.full((len(labels), 3), np.inf), np.full((len(labels), 3), -np.inf)
    np.minimum.at(low, piece, last["position"])
    np.maximum.at(high, piece, last["position"])
    spacing = max(body.spacing for body in scene.solid.bodies)
    chosen = np.flatnonzero(count >= SMALLEST)
    chosen = chosen[np.argsort(-mass[chosen])]
    size = (high - low).max(axis=1) + spacing
    speed = np.linalg.norm(velocity, axis=1)
    return Fragments(mass[chosen], speed[chosen], size[chosen], float(1.0 - mass[chosen].sum() / mass.sum()))


def _mass_of_particle(scene: Scene, number: int) -> float:
    """Mean [kg]: density times the volume that the packing gives to a particle."""
    body = present(scene.solid).bodies[number]
    _, volumes = pack(body, scene.domain.lower, scene.domain.upper)
    return body.density * float(np.mean(volumes))
