"""Loops over the particles of a wall: their masses and volumes, where they are in the middle of a step, and how far
they are stretched."""

from math import sqrt
from typing import Any, NamedTuple

from distfsi.coupling.cut_cells.kernels.lone import LONE, WALL
from distfsi.device.markers import driver, helper
from distfsi.formulas.geometry import side_of_cube
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS


class Domain(NamedTuple):
    """The corners (D,) [m] of the domain."""

    lower: Any
    upper: Any


@helper
def part_inside(position, i, volume, domain: Domain):
    """Part of the cube of a `volume` around a particle that is in the domain."""
    side = side_of_cube(max(volume, 1e-300))
    part = 1.0
    for d in static_range(DIMENSIONS):
        depth = min(position[i, d] - domain.lower[d], domain.upper[d] - position[i, d])
        part = part * min(max(0.5 + depth / side, 0.0), 1.0)
    return part


@driver
def keep_mass(begin, end, start, lone, mass, density, domain: Domain, kept):
    """kept[i] = mass of a particle of a wall, 0 if it was outside the domain at the `start`."""
    for i in range(begin, end):
        inside = part_inside(start, i, mass[i] / density[i], domain) > 0.0
        kept[i] = mass[i] if inside and lone[i] != LONE else 0.0


@driver
def find_volumes(begin, end, lone, mass, density, volume):
    """volume[i] (n, 1) of a particle of a wall, 0 of lone ones."""
    for i in range(begin, end):
        volume[i, 0] = mass[i] / density[i] if lone[i] == WALL else 0.0


@driver
def keep_inside(begin, end, position, size, domain: Domain, volume):
    """volume (n, 2) = what of a volume `size` (n, 1) is in the domain, and all of it."""
    for i in range(begin, end):
        volume[i, 0] = size[i, 0] * part_inside(position, i, size[i, 0], domain)
        volume[i, 1] = size[i, 0]


@driver
def find_middle(begin, end, start, position, middle, way):
    """middle[i] (D,) of a particle's way in a step, and how far along an axis it goes, way[i]."""
    for i in range(begin, end):
        way[i] = 0.0
        for d in static_range(DIMENSIONS):
            middle[i, d] = 0.5 * (start[i, d] + position[i, d])
            way[i] = max(way[i], abs(position[i, d] - start[i, d]))


@driver
def mark_stretched(begin, end, cell, farthest, volume, bond_count, deformation, mark):
    """mark[i] = 1 where a particle that bonds hold may be longer than `farthest`, in units of half a `cell` or of its
    reference size, if that is more; else 0."""
    for i in range(begin, end):
        side, squares = side_of_cube(volume[i]), 0.0
        for k in range(DIMENSIONS * DIMENSIONS):
            squares += deformation[i, k] * deformation[i, k]
        stretched = side * sqrt(squares) > farthest * max(0.5 * cell, side)
        mark[i] = 1 if stretched and bond_count[i] > 0 else 0
