"""Contact of different sides: bodies, and a body and its mirror image (solid/sides.py).

Each particle sees the other sides' volume, smoothed. Where it sees more than a particle at a surface does at touch, it
bears a pressure, and the gradient of what it sees, which is the normal of the other surface, makes a force of it.
"""

from __future__ import annotations

import math
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.emit import plain
from distfsi.device.interface import Columns, Device
from distfsi.mesh import search
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.particles import Key
from distfsi.mesh.rows import Rows
from distfsi.mesh.search import CellSort
from distfsi.scene.description import Solid
from distfsi.solid.formulas.smoothing import smoothing_kernel, smoothing_slope
from distfsi.solid.kernels import contact as kernels
from distfsi.solid.kernels.contact import UNKNOWN, WIDTH
from distfsi.solid.kernels.records import Neighbours, Particles, SurfaceTables
from distfsi.solid.neighbours import Near
from distfsi.solid.sides import Sides

DRIVERS = (
    *search.DRIVERS,
    kernels.mark_moved,
    kernels.find_sides_of_cells,
    kernels.mark_meeting,
    kernels.find_meeting,
    kernels.press_surfaces,
    kernels.begin_touch,
    kernels.drag_surfaces,
    kernels.push_surfaces,
    kernels.heat_surfaces,
)
SKINS = 0.5, 16.0  # smallest spacings: how far a search looks beyond particles that meet, and how far at most
POINTS = 2000  # of an integral over a layer of particles


class Contact:
    """Forces between particles of different sides that are near each other, which are looked for when particles have
    moved. The forces are the same to the bit whenever that was.

    widening  how far particles see, in the reach of their smoothing
    touching  (n,) what a particle sees of other sides without being pressed, in what a surface sees at touch: a column
              of the solid. More than 1: it has been there since the start
    """

    def __init__(
        self,
        kernels: SimpleNamespace,
        device: Device,
        cells: CellSort,
        communicator: Communicator,
        sides: Sides,
        scene: Solid,
        dimensions: int,
    ):
        spacing = np.array([body.spacing for body in scene.bodies])
        self._kernels, self._device, self._rows = kernels, device, Rows(device, kernels)
        self._cells, self._communicator, self._sides, self._dimensions = cells, communicator, sides, dimensions
        self._tables = SurfaceTables(*map(device.array, surface_tables(spacing, dimensions)))
        self._skins, self.widening = np.array(SKINS) * spacing.min(), WIDTH / scene.smoothing
        self._skin = 0.0  # of the last search
        self._width = 8 * 3 ** (dimensions - 1)
        self._key: Key | None = None  # for whose particles the others were looked for
        self._last: Particles | None = None
        self._chosen: Any = device.empty(0, np.int64)
        self._neighbours: Neighbours | None = None
        self._began, self._rubs = False, scene.friction > 0.0
        self._pushes: tuple[Any, ...] | None = None  # what the forces of the last accelerate() follow from

    def bind(self, columns: Columns) -> None:
        """Add the column."""
        columns["touching"] = np.full(len(columns["id"]), UNKNOWN)

    def accelerate(self, columns: Columns, near: Near, acceleration: Any) -> None:
        """Collective. Add the `acceleration` (own, D) [m/s2] of the contact forces."""
        self._look(near)
        self._pushes = None
        number, touching, own = self._chosen.shape[0], columns.write("touching"), self._device.zeros(near.own)
        pairs = (self._chosen, self._neighbours, near.particles, self._sides.of(near.plan.key).read, self._tables)
        self._device.run(self._kernels.press_surfaces, number, *pairs, *touching, own)
        if not self._began:
            self._device.run(self._kernels.begin_touch, near.own, *touching)
            self._began = True
        if not self._communicator.maximum(np.array([float(number)]))[0]:
            return
        bearing: list[tuple[Any, Any]] = [(own, ((),))]
        if self._rubs:
            traction = self._device.zeros((near.own, self._dimensions))
            self._device.run(self._kernels.drag_surfaces, number, *pairs, own, traction)
            bearing.append((traction, near.vector))
        pressure, *tractions = near.plan.exchange(bearing)
        self._pushes = (*pairs, pressure, *(tractions or [self._device.empty((0, self._dimensions))]))
        self._device.run(self._kernels.push_surfaces, number, *self._pushes, acceleration)

    def heat(self, columns: Columns, near: Near, dt: float, velocity: Any) -> None:
        """Advance the energy by the work of the forces in `dt` [s], with the new `velocity` (count, D) [m/s]."""
        if self._pushes is not None:
            number, given = self._chosen.shape[0], (*self._pushes, velocity, *columns.write("energy"))
            self._device.run(self._kernels.heat_surfaces, number, dt, *given)

    def _look(self, near: Near) -> None:
        """Find who may meet whom, if that may have changed."""
        device, particles, key, count = self._device, near.particles, near.plan.key, near.plan.count
        if key is self._key:
            mark = device.empty(count, np.int8)
            device.run(self._kernels.mark_moved, count, 0.5 * self._skin, particles, self._last, mark)
            if not self._rows.any(mark):
                return
        self._key, self._last, side = key, particles, self._sides.of(key).read
        # As long as nobody is found, look twice as far as the last time.
        narrowest, widest = self._skins
        self._skin = narrowest if self._chosen.shape[0] else float(np.clip(2.0 * self._skin, narrowest, widest))
        number, *cells = self._have_others_around(near, side)
        if number and self._skin > narrowest:
            self._skin = narrowest
            number, *cells = self._have_others_around(near, side)
        # Whom they may see.
        given = (self._skin, self._chosen, particles, key.device, side, *cells)
        while True:
            table, found = device.empty((number, self._width), np.int32), device.empty(number, np.int64)
            self._neighbours = Neighbours(table, found)
            device.run(self._kernels.find_meeting, number, *given, self._neighbours)
            longest = self._rows.largest(found, 0) if number else 0
            if longest <= self._width:
                return
            self._width = int(1.2 * longest)

    def _have_others_around(self, near: Near, side: Any) -> tuple[int, Any, Any, Any, Any]:
        """Choose the particles that have other sides in the search cells around them: how many there are. And the cell
        of each particle, where cells start in the order of particles, this order, the offsets of rows of cells."""
        device, D = self._device, self._dimensions
        size = self.widening * near.support + self._skin
        cell, bins = self._cells.sort(near.position, near.plan.key.device, size)
        rows = [np.dot(step, self._cells.strides[1:D]) for step in product((-1, 0, 1), repeat=D - 1)]
        rows = device.array(np.sort(np.array(rows, dtype=np.int64)))
        cells = bins.start.shape[0] - 1
        side_of_cell, mark = device.empty(cells, np.int64), device.empty(near.own, np.int8)
        device.run(self._kernels.find_sides_of_cells, cells, bins.start, bins.order, side, side_of_cell)
        device.run(self._kernels.mark_meeting, near.own, cell, rows, side_of_cell, side, mark)
        number, self._chosen = self._rows.marked(mark)
        return number, cell, bins.start, bins.order, rows


def surface_tables(spacing: np.ndarray, dimensions: int) -> SurfaceTables:
    """The tables (bodies, bodies) of lattices `spacing` (bodies,) [m] apart, whose layers are parallel to the surface.

    A layer is as it looks on the mean over all places along it. Its distance from a particle at the other surface is
    that of touch: half a spacing of either, and whole ones of its own between layers.
    """
    kernel, slope = (plain(f, {"DIMENSIONS": dimensions}) for f in (smoothing_kernel, smoothing_slope))

    def sums(own: float, other: float) -> tuple[float, float, float]:
        h = WIDTH * max(own, other)
        x = 0.5 * own + other * (np.arange(math.ceil(2.0 * h / other)) + 0.5)
        x = x[x < 2.0 * h]
        r = np.linspace(0.0, 2.0 * h, POINTS)  # along the layer
        distance2 = x[:, None] ** 2 + r**2
        inside = distance2 < 4.0 * h * h
        around = np.full_like(r, 2.0) if dimensions == 2 else 2.0 * math.pi * r
        if dimensions == 1:
            values, slopes = kernel(x**2, h), x * slope(x**2, h)
        else:
            values = np.trapezoid(np.where(inside, kernel(distance2, h), 0.0) * around, r)
            slopes = np.trapezoid(np.where(inside, x[:, None] * slope(distance2, h), 0.0) * around, r)
        fill, steep = other * values.sum(), -other * slopes.sum()
        return fill, own * steep, fill / (steep * 0.5 * (own + other))

    tables = np.array([[sums(own, other) for other in spacing] for own in spacing])
    return SurfaceTables(*np.ascontiguousarray(tables.transpose(2, 0, 1)))
