"""Lone particles: too few together to be a wall, they are points that the gas moves."""

from __future__ import annotations

from math import prod
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels import dust as kernels
from distfsi.device.interface import Columns
from distfsi.mesh.rows import Rows
from distfsi.mesh.search import SearchCells

FEWEST = (0, 0, 8, 16)  # in so many dimensions, within the reach of the wall's kernel
PARTICLE_DRIVERS = (kernels.find_dust, kernels.mark_dust)
FLUID_DRIVERS = (kernels.feel_gas, kernels.drag, kernels.pay_drag)


class Dust:
    """A column "dust" of the particles tells which they are (coupling/cut_cells/kernels/dust.py): once lone, always
    lone.

    As a wall they would be thickened balls, of many times their volume. They give their cells back to the fluid, and
    only exchange momentum and energy with the gas of the cell in which a step has begun. Particles are lone when they
    are debris and fewer than FEWEST together: a quarter of what fills the kernel, as where two straight edges meet. In
    one dimension a particle is a plate, and remains a wall.
    """

    def __init__(
        self,
        columns: Columns,
        rows: Rows,
        kernels: tuple[SimpleNamespace, SimpleNamespace],
        wall: WallGeometry,
        *grid: Any,
    ):
        """`kernels`: PARTICLE_DRIVERS and FLUID_DRIVERS as built; `grid`: as the arguments of feel_gas() have it from
        `shape` on, on the device."""
        self._rows, self._device, self._wall, self._grid = rows, rows.device, wall, grid
        self._kernels, self._fluid_kernels = kernels
        self._fewest = FEWEST[wall.blocks.grid.dimensions]
        columns["dust"] = np.full(len(columns["id"]), 0)

    def find(self, c: Columns, position: Any, bins: SearchCells) -> None:
        """Which particles are lone; `position` (count, D) [m] of own particles first, then ghosts and images. Without
        bonds nothing tells debris from the edges of thin bodies: none is."""
        if "bond_count" in c and self._fewest:
            known = (*c.write("dust"), *c.read("fixed", "bond_count"), self._wall.radius, self._fewest)
            self._device.run(self._kernels.find_dust, len(c["id"]), *known, position, *bins)

    def rows(self, c: Columns) -> Any:
        """The lone ones (n,) among this rank's particles, in the order of their ids."""
        (dust,) = c.read("dust")
        mark = self._device.empty(dust.shape[0], np.int8)
        self._device.run(self._kernels.mark_dust, dust.shape[0], dust, mark)
        count, rows = self._rows.marked(mark)
        if count == 0:
            return rows
        found = self._device.download(rows)
        return self._device.array(found[np.argsort(c["id"][found])])

    def drag(
        self, c: Columns, rows: Any, start: Any, dt: float, impulse: Any, gas: tuple[Any, Any], pressing: Any, kind: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """The `rows` of `impulse` (own, D) [N s] = that of the gas in `dt` [s]; the fluid pays. `start` (own, D) [m]:
        where particles were when the step began; `gas`: states and volumes; `pressing`: the input of the last stage,
        ghosts included; `kind` of cells. Returns the local blocks (n,) where fluid was met, and what it pays there
        (n, D + 1) [N s, J]."""
        device, wall, k, n = self._device, self._wall, self._fluid_kernels, rows.shape[0]
        cell_volume = float(np.prod(wall.blocks.grid.spacing))
        velocity, mass, density, id = c.read("velocity", "mass", "density", "id")
        place, at, follows = self._rows.taken(start, rows), device.empty(n, np.int64), device.empty((n, 2))
        pressed, paid = device.empty(place.shape), device.empty((n, start.shape[1] + 1))
        bins = wall.sort(place, self._rows.taken(id, rows))
        where, moves = (rows, place, at), (follows, pressed)
        around = (pressing, kind, *wall.faces, wall.steps)
        device.run(k.feel_gas, n, *where, *moves, velocity, mass, density, *gas, *around, dt, *self._grid)
        around = (cell_volume, impulse, wall.shape, wall.spacing, *bins)
        device.run(k.drag, n, *where, *moves, velocity, *gas, *around)
        device.run(
            k.pay_drag, n, *where, velocity, mass, impulse, paid, *gas, cell_volume, wall.shape, wall.spacing, *bins
        )
        cell, paid = device.download(at), device.download(paid)
        return cell[cell >= 0] // prod(wall.blocks.shape), paid[cell >= 0]
