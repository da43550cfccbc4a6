"""Lone particles: too few together to be a wall, they are points that the gas moves."""

from __future__ import annotations

from math import prod
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels import lone as kernels
from distfsi.coupling.cut_cells.kernels.lone import LonePoints
from distfsi.coupling.cut_cells.kernels.records import States, Walls
from distfsi.coupling.particles import SolidParticles
from distfsi.mesh.kernels.search import Bins
from distfsi.mesh.rows import Rows

FEWEST = (0, 0, 8, 16)  # in so many dimensions, within the reach of the wall's kernel
PARTICLE_DRIVERS = (kernels.find_lone, kernels.mark_lone)
FLUID_DRIVERS = (kernels.feel_gas, kernels.drag, kernels.pay_drag)


class LoneParticles:
    """A column "lone" of the particles tells which they are (coupling/cut_cells/kernels/lone.py): once lone, always
    lone.

    As a wall they would be inflated, to many times their volume. They give their cells back to the fluid, and only
    exchange momentum and energy with the gas of the cell in which a step has begun. Particles are lone when they are
    debris and fewer than FEWEST together: a quarter of what fills the kernel, as where two straight edges meet. In one
    dimension a particle is a plate, and remains a wall.
    """

    def __init__(
        self,
        particles: SolidParticles,
        rows: Rows,
        wall: WallGeometry,
        particle_kernels: SimpleNamespace,
        fluid_kernels: SimpleNamespace,
    ):
        """`particle_kernels`, `fluid_kernels`: PARTICLE_DRIVERS and FLUID_DRIVERS as built."""
        self._particles, self._rows, self._device, self._wall = particles, rows, rows.device, wall
        self._kernels, self._fluid_kernels = particle_kernels, fluid_kernels
        self._grid, self._table = wall.grid, wall.blocks.table_on(wall.device)
        self._fewest = FEWEST[wall.blocks.grid.dimensions]
        particles.attach("lone", np.full(particles.count, 0), shown=True)

    def find(self, position: Any, bins: Bins) -> None:
        """Which particles are lone; `position` (count, D) [m] of own particles first, then ghosts and images. Without
        bonds nothing tells debris from the edges of thin bodies: none is."""
        p, bonds = self._particles, self._particles.bonds
        if bonds and self._fewest:
            known = (p.write("lone"), p.fixed, bonds.count, self._wall.radius, self._fewest, position, bins)
            self._device.run(self._kernels.find_lone, p.count, *known)

    def rows(self) -> Any:
        """The lone ones (n,) among this rank's particles, in the order of their ids."""
        mark = self._device.empty(self._particles.count, np.int8)
        self._device.run(self._kernels.mark_lone, mark.shape[0], self._particles.read("lone"), mark)
        count, rows = self._rows.marked(mark)
        if count == 0:
            return rows
        found = self._device.download(rows)
        return self._device.array(found[np.argsort(self._particles.id[found])])

    def drag(
        self, rows: Any, impulse: Any, states: States, pressing: Any, walls: Walls, dt: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The `rows` of `impulse` (own, D) [N s] = that of the gas in a step of `dt` [s]; the fluid pays. `pressing`:
        the input of the last stage, ghosts included. Returns the local blocks (n,) where fluid was met, and what it
        pays there (n, D + 1) [N s, J]."""
        device, p, k, n = self._device, self._particles, self._fluid_kernels, rows.shape[0]
        # the gas around them
        position = self._rows.taken(p.start, rows)
        D = position.shape[1]
        lone = LonePoints(rows, position, device.empty(n, np.int64), device.empty((n, 2)), device.empty((n, D)))
        gas = (states, pressing, walls, dt, self._grid, self._table)
        device.run(k.feel_gas, n, lone, p.velocity, p.mass, p.density, *gas)
        # those of a cell share what it gives
        bins = self._wall.sort(position, self._rows.taken(p.id_on_device, rows))
        device.run(k.drag, n, lone, bins, p.velocity, states, impulse, self._grid)
        paid = device.empty((n, D + 1))
        device.run(k.pay_drag, n, lone, bins, p.velocity, p.mass, impulse, paid, states, self._grid)
        cell, paid = device.download(lone.cell), device.download(paid)
        return cell[cell >= 0] // prod(self._wall.blocks.shape), paid[cell >= 0]
