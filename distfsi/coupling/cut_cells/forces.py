"""What fluid and solid give to each other at the wall: impulse, work, and the mass of fluid that goes along."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels import forces as cut_forces
from distfsi.coupling.cut_cells.kernels.band import BAND
from distfsi.coupling.cut_cells.wall_particles import WallParticles
from distfsi.coupling.kernels import spreading as push
from distfsi.mesh.blocks import GHOSTS
from distfsi.mesh.chosen import ChosenGhosts
from distfsi.mesh.rows import Groups, Rows
from distfsi.solid.protocol import Structure

PARTICLE_DRIVERS = (
    cut_forces.find_momentum,
    cut_forces.find_gains,
    cut_forces.mark_walled,
    cut_forces.see_particles,
    cut_forces.push_together,
    cut_forces.find_pressures,
    cut_forces.find_debts,
    push.find_homes,
    push.gather_kicks,
)
FLUID_DRIVERS = (cut_forces.spread_impulse, cut_forces.pay_debts)


class WallForces:
    """In a step: begin(), the stages add to what is below, impulse_on(), pay(). Cells give to particles with the
    weights by which they see them, so that momentum and energy arrive as they leave.

    velocity (n, D) [m/s] of the wall in the cells of the band
    impulse  (n, D) [N s/m3], work (n,) [J/m3], added (n,) [kg/m3]: what the fluid gives per volume of a cell, and by
             how much less impulse that were per velocity of the wall
    """

    def __init__(
        self,
        wall: WallGeometry,
        particles: WallParticles,
        rows: Rows,
        kernels: tuple[SimpleNamespace, SimpleNamespace],
        near_ghosts: ChosenGhosts,
    ):
        """`kernels`: PARTICLE_DRIVERS and FLUID_DRIVERS as built; `near_ghosts`: of the cells around the wall."""
        blocks, self._team = wall.blocks, wall.team
        grid, array = blocks.grid, wall.team.array
        self._wall, self._particles, self._rows, self._ghosts = wall, particles, rows, near_ghosts
        self._kernels, self._fluid_kernels = kernels
        self._D, self._cell_volume = grid.dimensions, float(np.prod(grid.spacing))
        self._given = array(blocks.allocate(1 + self._D))
        self._parity = array(np.append(1 << np.arange(self._D), 0))
        self._grid = (array(np.array(grid.lower)), wall.spacing)
        homes = [array(np.array(values)) for values in (blocks.block_cells, blocks.curve_index)]
        self._homes = (wall.cells, *homes, blocks.first)
        images = GHOSTS * (np.arange(3) < grid.dimensions)
        self._seen_cells = array(np.column_stack([-images, grid.cells + images]))

    def begin(self, band: Any, groups: Groups, area: Any) -> None:
        """Find the wall's velocity in the cells of the band, which it passes with an `area` (n, D) [1/m]; `groups`: its
        cells by blocks."""
        team, n, D = self._team, band.shape[0], self._D
        self._band, self._groups, self._area = band, groups, area
        self.velocity, self._inertia = team.zeros((n, D)), team.zeros(n)
        self.impulse, self.work, self.added = team.zeros((n, D)), team.zeros(n), team.zeros(n)
        mark = team.empty(n, np.int8)
        self._run(self._kernels.mark_walled, area, mark)
        walled = self._rows.marked(mark)[1]
        self._walled = self._wall.near_order(walled, self._rows.taken(band, walled), self._wall.blocks.shape)
        self._see(self._particles.velocity, self.velocity)

    def impulse_on(self, solid: Structure) -> Any:
        """Collective, after the stages. Impulse (own, D) [N s] on this rank's particles, on the device."""
        team, own, wall = self._team, solid.count, self._wall
        known = (self._cell_volume, self.impulse, self.added, self._inertia, self._given, wall.shape)
        self._run(self._fluid_kernels.spread_impulse, *known)
        self._ghosts.exchange((self._given, self._parity))
        given, self._shared = (team.empty((own, self._D)) for _ in range(2))
        fixed, velocity = solid.columns.read("fixed", "velocity")
        known = (self._particles.own_mass, fixed, solid.before, velocity, self._gather(solid))
        team.run(self._kernels.push_together, own, *known, given, self._shared)
        return given

    def pay(self, solid: Structure, excess: Any, joined: Any, U: Any, swept: Any, *company: Any) -> tuple[Any, Any]:
        """Collective, after solid.apply_impulse(), whose impulse worked at the `excess` (own, D) [m/s] over the
        velocity of the wall: the fluid in U and `swept` pays for it, cells for those that `joined` them. Returns what
        it has given in the step, impulse (local blocks, D) [N s] and work (local blocks,) [J]."""
        team, own, D, kernels = self._team, solid.count, self._D, self._kernels
        vector, gains = tuple((a,) for a in range(D)), team.empty((own, 2 * D + 1))
        team.run(kernels.find_gains, own, solid.carried, excess, self._shared, gains)
        (gains,) = self._particles.plan.exchange([(gains, (*vector, *vector, ()))])
        seen, paid = team.zeros((self._band.shape[0], 2 * D + 1)), team.empty(self._band.shape)
        self._see(gains, seen)
        debt = self._given.reshape(-1)
        self._run(kernels.find_debts, self.added, self.impulse, seen, debt, self._wall.shape)
        self._ghosts.exchange((self._given, self._parity))
        self._run(self._fluid_kernels.pay_debts, joined, paid, debt, U, swept, *company)
        impulse, work, extra = (self._cell_volume * self._groups.sums(a) for a in (self.impulse, self.work, paid))
        return impulse, work[:, 0] + extra[:, 0]

    def pressures(self) -> Any:
        """Mean pressure times the time [Pa s] on the wall in each cell of the band, (n,) on the device."""
        pressure = self._team.empty(self._band.shape[0])
        self._run(self._kernels.find_pressures, self._area, self.impulse, pressure)
        return pressure

    def _see(self, values: Any, mean: Any) -> None:
        """mean (band, k) of what particles have (count, k) around the cells with a wall, where they were in the middle
        of the step: only there is the way that a turning wall went along itself."""
        (count, width), wall, seen = values.shape, self._wall, self._particles
        amounts = self._team.empty((count, 1 + width))
        self._team.run(self._kernels.find_momentum, count, width, seen.mass, values, amounts)
        boxes = -(-self._walled.shape[0] // wall.lanes)
        self._team.run(
            self._kernels.see_particles, boxes, self._band, self._walled, width, mean, self._inertia, wall.seen,
            amounts.reshape(-1), seen.middle, *seen.bins, wall.shape, wall.spacing, wall.origin,
        )  # fmt: skip

    def _gather(self, solid: Structure) -> Any:
        """What the cells give to the mass of each of this rank's particles (own, 1 + D): velocity, and added mass over
        its own."""
        own, wall, team, kernels = solid.count, self._wall, self._team, self._kernels
        gained, home, middle = team.empty((own, 1 + self._D)), team.empty(own, np.int64), self._particles.own_middle
        chosen = wall.coarse_order(middle, *solid.columns.read("id"))
        team.run(kernels.find_homes, own, solid.start, home, *self._grid, *self._homes)
        team.run(
            kernels.gather_kicks, -(-own // wall.lanes), chosen, middle, home, self._particles.image, gained, wall.seen,
            wall.mark.reshape(-1), BAND, self._given, wall.shape, *self._grid, wall.origin, wall.extent,
            self._seen_cells, wall.cells,
        )  # fmt: skip
        return gained

    def _run(self, kernel: Any, *arguments: Any) -> None:
        self._team.run(kernel, self._band.shape[0], self._band, *arguments)
