"""Packing of bodies with particles: lattices, fitted to the shape, and rings. Volumes add up to the shape's own."""

from __future__ import annotations

import itertools
import math

import numpy as np

from distfsi.scene.cloud import Cloud
from distfsi.scene.composed import Intersection
from distfsi.scene.description import Ball, Body, Box, Composed, Cylinder, HalfSpace, Tube
from distfsi.scene.fitting import fits_by_itself, fitted
from distfsi.scene.shapes import bounding_box, contains, cylinder_coordinates, is_its_bounding_box, volume


def pack(body: Body, lower: tuple[float, ...], upper: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Particles of `body` inside the domain [lower, upper]: positions (n, D) [m], volumes (n,) [m^D].

    A Box is cut to the domain and filled exactly; a Ball gets a lattice about its center, a HalfSpace one that fills
    the domain, a Tube (2D) and a Cylinder rings, unless the body asks for the other; in 3D rings of a Ball or Tube lie
    in shells. Lattice and rings leave planes through the center between particles. What is composed: scene/fitting.py.
    """
    shape = body.shape
    if isinstance(shape, Composed) and not isinstance(shape, Cloud) and is_its_bounding_box(shape):
        shape = Box(*bounding_box(shape))
    elif isinstance(shape, Composed) or body.packing == "relaxed":
        return _composed(body, lower, upper)
    low_end, high_end = np.asarray(lower), np.asarray(upper)
    match shape:
        case Box(low, high) if body.lattice_angle == 0.0:
            positions, each = _fill(np.maximum(low, low_end), np.minimum(high, high_end), body.spacing)
            return positions, np.full(len(positions), each)
        case HalfSpace():
            return _half_space(shape, low_end, high_end, body.spacing)
    positions, volumes = _in_rings(body) if uses_rings(body) else _in_lattice(body)
    inside = np.all((positions > low_end) & (positions < high_end), axis=1)
    return positions[inside], volumes[inside]


def _composed(body: Body, lower: tuple[float, ...], upper: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Particles of a composed shape. Of one that the domain cuts, a lattice that knows only its surface ends there; any
    other is cut between particles, and its volume is that of the part."""
    whole, low, high = body.shape, *bounding_box(body.shape)
    if all(a >= b for a, b in zip((*low, *upper), (*lower, *high), strict=True)):
        return fitted(whole, body.spacing, body.packing)
    part = Intersection((whole, Box(lower, upper)))
    if not fits_by_itself(whole):
        return fitted(part, body.spacing, body.packing)
    positions, volumes = fitted(whole, body.spacing, body.packing)
    inside = np.all((positions > np.asarray(lower)) & (positions < np.asarray(upper)), axis=1)
    return positions[inside], volumes[inside] * (part.volume() / max(volumes[inside].sum(), 1e-300))


def uses_rings(body: Body) -> bool:
    """Whether a body is packed with rings: what it asks for or, by default, tubes in 2D and cylinders are."""
    suits = isinstance(body.shape, Cylinder) or (isinstance(body.shape, Tube) and len(body.shape.center) == 2)
    return suits if body.packing is None else body.packing == "rings"


def initial_velocity(body: Body, positions: np.ndarray) -> np.ndarray:
    """Velocities (n, D) [m/s] at the start of the particles at `positions` (n, D) that are not fixed."""
    velocity = np.broadcast_to(np.asarray(body.velocity, dtype=float), positions.shape)
    if body.radial_velocity == 0.0:
        return velocity
    match body.shape:
        case Ball(center, radius):
            return velocity + body.radial_velocity / radius * (positions - np.asarray(center))
        case Tube(center, inner):
            outward = positions - np.asarray(center)
            power = len(center)
        case Cylinder(start, end, radius, inner):
            along, _ = cylinder_coordinates(body.shape, positions)
            axis = (np.asarray(end) - np.asarray(start)) / math.dist(start, end)
            outward = positions - np.asarray(start) - along[:, None] * axis
            power = 2
            if inner == 0.0:
                return velocity + body.radial_velocity / radius * outward
    r = np.sqrt((outward**2).sum(axis=1, keepdims=True))
    return velocity + body.radial_velocity * inner ** (power - 1) * outward / r**power


# ---- lattices --------------------------------------------------------------------------------------------------------


def _fill(lower: np.ndarray, upper: np.ndarray, spacing: float) -> tuple[np.ndarray, float]:
    """Lattice that fills a box, a whole number of particles along each axis; and the volume of each particle."""
    extent = upper - lower
    if np.any(extent <= 0.0):
        return np.empty((0, len(extent))), 0.0
    counts = np.maximum(np.rint(extent / spacing), 1).astype(int)
    axes = [a + (np.arange(n) + 0.5) * (e / n) for a, e, n in zip(lower, extent, counts, strict=True)]
    grids = np.meshgrid(*reversed(axes), indexing="ij")
    return np.stack([g.ravel() for g in reversed(grids)], axis=1), math.prod(extent / counts)


def _in_lattice(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Particles of a cubic lattice that lie in the shape; a turned one turns about z, in a cylinder about its axis."""
    shape, spacing = body.shape, body.spacing
    assert not isinstance(shape, HalfSpace)
    if isinstance(shape, Cylinder):
        points, _ = _layers(shape, _square(2, shape.radius, spacing, body.lattice_angle), spacing)
    else:
        low, high = (np.asarray(corner) for corner in bounding_box(shape))
        points = 0.5 * (low + high) + _square(len(low), 0.5 * math.dist(low, high), spacing, body.lattice_angle)
    positions = points[contains(shape, points)]
    return positions, np.full(len(positions), volume(shape) / max(len(positions), 1))


def _square(dimensions: int, reach: float, spacing: float, angle: float) -> np.ndarray:
    """Points (n, D) of a lattice about the origin as far as `reach` [m], turned by `angle` [rad] in the x-y plane."""
    half = math.ceil(reach / spacing) * spacing
    points, _ = _fill(np.full(dimensions, -half), np.full(dimensions, half), spacing)
    if angle:
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        points[:, :2] = points[:, :2] @ turn
    return points


def _layers(shape: Cylinder, section: np.ndarray, spacing: float) -> tuple[np.ndarray, float]:
    """Points (n, 3): a `section` (k, 2) about the axis, repeated along the cylinder, and the height of a layer [m]."""
    length = math.dist(shape.start, shape.end)
    layers = max(1, round(length / spacing))
    heights = (np.arange(layers) + 0.5) * (length / layers)
    local = np.hstack([np.tile(section, (layers, 1)), np.repeat(heights, len(section))[:, None]])
    return np.asarray(shape.start) + local @ _frame(shape), length / layers


def _frame(shape: Cylinder) -> np.ndarray:
    """(3, 3) unit vectors: two across a cylinder, one along it. Of an axis-parallel cylinder all are axis-parallel."""
    axis = (np.asarray(shape.end) - np.asarray(shape.start)) / math.dist(shape.start, shape.end)
    first = np.cross(np.roll(np.eye(3)[np.argmax(np.abs(axis))], -1), axis)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first), axis])


def _half_space(
    shape: HalfSpace, lower: np.ndarray, upper: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    low, high = bounding_box(shape)
    lattice, _ = _fill(np.maximum(low, lower), np.minimum(high, upper), spacing)
    positions = lattice[contains(shape, lattice)]
    return positions, np.full(len(positions), _clipped_volume(shape, lower, upper) / max(len(positions), 1))


def _clipped_volume(shape: HalfSpace, lower: np.ndarray, upper: np.ndarray) -> float:
    """Volume of a box cut by a plane: alternating sum over the box's corners of the simplices they cut off."""
    normal, extent = np.asarray(shape.normal, dtype=float), upper - lower
    level = normal @ (np.asarray(shape.point) - lower) - np.minimum(normal * extent, 0.0).sum()
    slopes = np.abs(normal * extent)  # the box as a unit cube, every slope positive
    slopes = slopes[slopes > 1e-9 * slopes.max()]
    corners = itertools.product((0, 1), repeat=len(slopes))
    terms = [(-1) ** sum(c) * max(level - slopes @ np.asarray(c), 0.0) ** len(slopes) for c in corners]
    return math.prod(extent) * math.fsum(terms) / (math.factorial(len(slopes)) * math.prod(slopes))


# ---- rings -----------------------------------------------------------------------------------------------------------


def _in_rings(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Particles in rings that follow the surface: of a tube or ball, in layers of a cylinder."""
    match body.shape:
        case Tube(center, inner, outer):
            positions, volumes = _round_layers(len(center), inner, outer, body.spacing)
            return positions + np.asarray(center), volumes
        case Ball(center, radius):
            positions, volumes = _round_layers(len(center), 0.0, radius, body.spacing)
            return positions + np.asarray(center), volumes
        case Cylinder(_, _, outer, inner):
            section, areas = _rings(inner, outer, body.spacing)
            positions, height = _layers(body.shape, section, body.spacing)
            return positions, np.tile(areas * height, len(positions) // len(section))
        case shape:
            raise TypeError(f"no rings fill a {type(shape).__name__}")


def _round_layers(dimensions: int, inner: float, outer: float, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Layers about the origin between two radii [m]: rings in 2D, shells in 3D."""
    return (_rings if dimensions == 2 else _shells)(inner, outer, spacing)


def _shells(inner: float, outer: float, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Shells of equal thickness about the origin, of rings about z, each with a multiple of four particles: positions
    (n, 3) [m] and volumes (n,) [m3]. The three planes through the origin lie between particles."""
    edges = np.linspace(inner, outer, max(1, round((outer - inner) / spacing)) + 1)
    positions, volumes = [], []
    for low, high in itertools.pairwise(edges):
        radius = 0.5 * (low + high)
        slices = np.linspace(0.0, math.pi, 2 * max(1, round(0.5 * math.pi * radius / spacing)) + 1)
        for first, last in itertools.pairwise(slices):
            middle = 0.5 * (first + last)
            count = 4 * max(1, round(0.5 * math.pi * radius * math.sin(middle) / spacing))
            angle = (np.arange(count) + 0.5) * (2.0 * math.pi / count)
            across = np.stack([np.cos(angle), np.sin(angle)], axis=1) * math.sin(middle)
            positions.append(radius * np.column_stack([across, np.full(count, math.cos(middle))]))
            part = 2.0 * math.pi / 3.0 * (high**3 - low**3) * (math.cos(first) - math.cos(last))
            volumes.append(np.full(count, part / count))
    return np.concatenate(positions), np.concatenate(volumes)


def _rings(inner: float, outer: float, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Rings of equal thickness about the origin, each with a multiple of four particles about `spacing` apart:
    positions (n, 2) [m] and areas (n,) [m2]."""
    edges = np.linspace(inner, outer, max(1, round((outer - inner) / spacing)) + 1)
    positions, volumes = [], []
    for low, high in itertools.pairwise(edges):
        radius = 0.5 * (low + high)
        count = 4 * max(1, round(0.5 * math.pi * radius / spacing))
        angle = (np.arange(count) + 0.5) * (2.0 * math.pi / count)
        positions.append(np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius)
        volumes.append(np.full(count, math.pi * (high**2 - low**2) / count))
    return np.concatenate(positions), np.concatenate(volumes)
