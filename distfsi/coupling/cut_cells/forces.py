"""The loads of the fluid on the wall: impulse, work, and the mass of fluid that goes along."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels import forces as kernels
from distfsi.coupling.cut_cells.kernels.band import BAND
from distfsi.coupling.cut_cells.kernels.records import Band, States, WallLoads
from distfsi.coupling.cut_cells.merging import CellMerging
from distfsi.coupling.cut_cells.values import CutGeometry, WallMotion
from distfsi.coupling.kernels import spreading
from distfsi.coupling.kernels.interpolation import Cloud
from distfsi.coupling.kernels.spreading import Receivers
from distfsi.coupling.particles import SolidParticles
from distfsi.mesh.rows import Rows

PARTICLE_DRIVERS = (
    kernels.find_momentum,
    kernels.find_gains,
    kernels.mark_walled,
    kernels.interpolate,
    kernels.push_together,
    kernels.find_pressures,
    kernels.find_corrections,
    spreading.find_homes,
    spreading.spread,
)
FLUID_DRIVERS = (kernels.find_transfer, kernels.correct_energy)


class WallForces:
    """Cells see the particles, and give to them with the same weights, so that momentum and energy arrive as they
    leave. In a step: begin(), the stages add to what it returns, impulse_on(), correct()."""

    def __init__(
        self,
        particles: SolidParticles,
        wall: WallGeometry,
        merging: CellMerging,
        rows: Rows,
        particle_kernels: SimpleNamespace,
        fluid_kernels: SimpleNamespace,
    ):
        """`particle_kernels`, `fluid_kernels`: PARTICLE_DRIVERS and FLUID_DRIVERS as built."""
        blocks, self._device, self._grid = wall.blocks, wall.device, wall.grid
        self._particles, self._wall, self._merging, self._rows = particles, wall, merging, rows
        self._kernels, self._fluid_kernels = particle_kernels, fluid_kernels
        grid, array = blocks.grid, wall.device.array
        self._D, self._cell_volume = grid.dimensions, float(np.prod(grid.spacing))
        self._table = blocks.table_on(wall.device)
        self._transfer = array(blocks.allocate(1 + self._D))
        self._parity = array(np.append(1 << np.arange(self._D), 0))
        self._motion: WallMotion | None = None  # for which the order of particles and their homes are
        self._order = self._homes = wall.device.empty(0, np.int64)
        images = np.array(grid.ghosts)
        self._seen_cells = array(np.column_stack([-images, grid.cells + images]))

    def begin(self, band: Band, motion: WallMotion) -> tuple[WallLoads, Any]:
        """The loads on the wall in a step, none at first, and with which velocity the wall moves in the cells of the
        band; which of these it passes through, by their indices in the band."""
        device, n, D = self._device, band.cells.shape[0], self._D
        sums = (device.zeros((n, D)), device.zeros(n), device.zeros((n, D)), device.zeros(n), device.zeros(n))
        loads, mark = WallLoads(*sums), device.empty(n, np.int8)
        device.run(self._kernels.mark_walled, n, band.area, mark)
        walled = self._rows.marked(mark)[1]
        walled = self._wall.near_order(walled, self._rows.taken(band.cells, walled), self._wall.blocks.shape)
        self._interpolate(band.cells, walled, motion, motion.velocity, loads.velocity, loads.inertia)
        return loads, walled

    def impulse_on(self, geometry: CutGeometry) -> tuple[Any, Any]:
        """Collective, after the stages. Impulse (own, D) [N s] on this rank's particles; and the velocity (own, D)
        [m/s] per added mass of fluid that goes along with light ones."""
        device, p, band, motion = self._device, self._particles, geometry.band, geometry.motion
        known = (band.cells, geometry.loads, self._transfer, self._grid)
        device.run(self._fluid_kernels.find_transfer, band.cells.shape[0], *known)
        self._merging.ghosts.exchange((self._transfer, self._parity))
        impulse, shared = (device.empty((p.count, self._D)) for _ in ("impulse", "shared"))
        gained = self._spread(motion)
        moving = (motion.own_mass, p.fixed, p.before, p.velocity, gained)
        device.run(self._kernels.push_together, p.count, *moving, impulse, shared)
        return p.share_push(motion.own_mass, gained, impulse, shared)

    def correct(
        self, geometry: CutGeometry, excess: Any, shared: Any, states: States | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Collective, after solid.apply_impulse(): the energy correction. The fluid pays for the velocity at which
        impulses worked over that of the wall, `excess` (own, D) [m/s]; `shared` as of impulse_on(); states None: not,
        the wall stands. Returns what it has given in the step, impulse (local blocks, D) [N s] and work (local blocks,)
        [J]."""
        if states is None:
            return self.given(geometry)
        device, own, D, k = self._device, self._particles.count, self._D, self._kernels
        band, loads, n = geometry.band, geometry.loads, geometry.band.cells.shape[0]
        # what cells see of the gains
        vector, gains = tuple((a,) for a in range(D)), device.empty((own, 2 * D + 1))
        device.run(k.find_gains, own, self._particles.carried, excess, shared, gains)
        (gains,) = geometry.motion.passage.plan.exchange([(gains, (*vector, *vector, ()))])
        seen, paid = device.zeros((n, 2 * D + 1)), device.empty(n)
        self._interpolate(band.cells, geometry.walled, geometry.motion, gains, seen, loads.inertia)
        # merge targets pay
        correction = self._transfer.reshape(-1)
        device.run(k.find_corrections, n, band.cells, loads, seen, correction, self._grid)
        self._merging.ghosts.exchange((self._transfer, self._parity))
        known = (geometry.merging, correction, paid, states, self._grid)
        device.run(self._fluid_kernels.correct_energy, n, band.cells, *known)
        impulse, work = self.given(geometry)
        return impulse, work + self._cell_volume * geometry.lists.blocks.sums(paid)[:, 0]

    def given(self, geometry: CutGeometry) -> tuple[np.ndarray, np.ndarray]:
        """What the fluid has given to the wall in the stages: impulse (local blocks, D) [N s], work (local blocks,)
        [J]."""
        sums, loads = geometry.lists.blocks.sums, geometry.loads
        return self._cell_volume * sums(loads.impulse), self._cell_volume * sums(loads.work)[:, 0]

    def pressures(self, geometry: CutGeometry) -> Any:
        """Mean pressure times the time [Pa s] on the wall in each cell of the band, (n,) on the device."""
        n = geometry.band.cells.shape[0]
        pressure = self._device.empty(n)
        self._device.run(self._kernels.find_pressures, n, geometry.band.area, geometry.loads.impulse, pressure)
        return pressure

    def _interpolate(self, band: Any, walled: Any, motion: WallMotion, values: Any, mean: Any, inertia: Any) -> None:
        """mean (band, k) of what particles have (count, k) around the cells with a wall, where they were in the middle
        of the step: only there is the way that a turning wall went along itself."""
        (count, width), wall = values.shape, self._wall
        amounts = self._device.empty((count, 1 + width))
        self._device.run(self._kernels.find_momentum, count, width, motion.mass, values, amounts)
        particles = Cloud(motion.passage.middle, amounts, motion.passage.bins)
        boxes, known = -(-walled.shape[0] // wall.lanes), (width, mean, inertia, wall.seen, particles, self._grid)
        self._device.run(self._kernels.interpolate, boxes, band, walled, *known)

    def _spread(self, motion: WallMotion) -> Any:
        """What the cells give to the mass of each of this rank's particles (own, 1 + D): velocity, and added mass over
        its own."""
        own, wall, device, k = self._particles.count, self._wall, self._device, self._kernels
        middle = motion.passage.own_middle
        gained = device.empty((own, 1 + self._D))
        if motion is not self._motion:  # that of a wall that stands remains
            self._motion, self._homes = motion, device.empty(own, np.int64)
            self._order = wall.coarse_order(middle, self._particles.id_on_device)
            device.run(k.find_homes, own, self._particles.start, self._homes, self._grid, self._table)
        chosen, home = self._order, self._homes
        given = (wall.seen, self._merging.mark, BAND, self._transfer, self._seen_cells)
        receivers = Receivers(middle, home, motion.image)
        device.run(k.spread, -(-own // wall.lanes), chosen, receivers, *given, gained, self._grid)
        return gained
