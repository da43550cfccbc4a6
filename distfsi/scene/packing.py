"""Packing of bodies with particles: lattices, fitted to the shape, and rings. Volumes add up to the shape's own."""

from __future__ import annotations

import itertools
import math

import numpy as np

from distfsi.scene.description import Ball, Body, Box, HalfSpace, Tube
from distfsi.scene.shapes import bounding_box, contains, volume


def pack(body: Body, lower: tuple[float, ...], upper: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Particles of `body` inside the domain [lower, upper]: positions (n, D) [m], volumes (n,) [m^D].

    A Box is cut to the domain and filled exactly; a Ball gets a lattice about its center, a HalfSpace one that fills
    the domain, a Tube (2D) rings. Lattice and rings leave planes through the center between particles.
    """
    lower, upper = np.asarray(lower), np.asarray(upper)
    match body.shape:
        case Box(low, high):
            positions, each = _fill(np.maximum(low, lower), np.minimum(high, upper), body.spacing)
            return positions, np.full(len(positions), each)
        case HalfSpace():
            return _half_space(body.shape, lower, upper, body.spacing)
        case Ball():
            positions, volumes = _ball(body.shape, body.spacing)
        case Tube():
            positions, volumes = _rings(body.shape, body.spacing)
    inside = np.all((positions > lower) & (positions < upper), axis=1)
    return positions[inside], volumes[inside]


def _fill(lower: np.ndarray, upper: np.ndarray, spacing: float) -> tuple[np.ndarray, float]:
    """Lattice that fills a box, a whole number of particles along each axis; and the volume of each particle."""
    extent = upper - lower
    if np.any(extent <= 0.0):
        return np.empty((0, len(extent))), 0.0
    counts = np.maximum(np.rint(extent / spacing), 1).astype(int)
    axes = [a + (np.arange(n) + 0.5) * (e / n) for a, e, n in zip(lower, extent, counts, strict=True)]
    grids = np.meshgrid(*reversed(axes), indexing="ij")
    return np.stack([g.ravel() for g in reversed(grids)], axis=1), math.prod(extent / counts)


def _ball(shape: Ball, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    half = math.ceil(shape.radius / spacing) * spacing
    center = np.asarray(shape.center)
    lattice, _ = _fill(center - half, center + half, spacing)
    positions = lattice[contains(shape, lattice)]
    return positions, np.full(len(positions), volume(shape) / max(len(positions), 1))


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


def _rings(shape: Tube, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Rings of equal thickness, each with a multiple of four particles about `spacing` apart."""
    thickness = shape.outer_radius - shape.inner_radius
    edges = np.linspace(shape.inner_radius, shape.outer_radius, max(1, round(thickness / spacing)) + 1)
    positions, volumes = [], []
    for inner, outer in itertools.pairwise(edges):
        radius = 0.5 * (inner + outer)
        count = 4 * max(1, round(0.5 * math.pi * radius / spacing))
        angle = (np.arange(count) + 0.5) * (2.0 * math.pi / count)
        positions.append(np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius + np.asarray(shape.center))
        volumes.append(np.full(count, math.pi * (outer**2 - inner**2) / count))
    return np.concatenate(positions), np.concatenate(volumes)
