"""Fluid and solid together: cells that the wall cuts, with the volume that their fluid has swept (docs/theory.md)."""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.coupling.cut_cells import dust, sides, wall_particles
from distfsi.coupling.cut_cells import forces as wall_forces
from distfsi.coupling.cut_cells.dust import Dust
from distfsi.coupling.cut_cells.forces import WallForces
from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels import fluxes as cut_fluxes
from distfsi.coupling.cut_cells.kernels import redistribution as kernels
from distfsi.coupling.cut_cells.kernels.band import FAR
from distfsi.coupling.cut_cells.sides import Sides
from distfsi.coupling.cut_cells.wall_particles import WallParticles
from distfsi.coupling.kernels.cells import COVERED, FLUID
from distfsi.device.interface import Device, DualArray
from distfsi.fluid.fluid import Fluid, Stage
from distfsi.fluid.initial import InitialState
from distfsi.mesh.blocks import Blocks, Snapshot
from distfsi.mesh.chosen import ChosenGhosts
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.kernels import rows as row_kernels
from distfsi.mesh.kernels.particles import EXCHANGE
from distfsi.mesh.kernels.regions import copy_cells, copy_regions, pack_cells, unpack_cells
from distfsi.mesh.particles import ParticleExchange
from distfsi.mesh.rows import Groups
from distfsi.scene.description import Scene
from distfsi.solid.protocol import Structure

LARGEST_MOVE = 0.3  # of a cell in a step, so that thin bodies stay closed, before forces between particles change it
FARTHEST_MOVE = 0.35  # of a cell, whatever they do: then the solid makes no other sub-step
PARTICLE_DRIVERS = (
    *EXCHANGE,
    copy_cells,
    pack_cells,
    unpack_cells,
    *row_kernels.REDUCTIONS,
    *wall_particles.DRIVERS,
    *wall_forces.PARTICLE_DRIVERS,
    *dust.PARTICLE_DRIVERS,
)
FLUID_DRIVERS = (
    kernels.take_contents,
    kernels.mark_leaving,
    kernels.absorb,
    kernels.find_trapped,
    kernels.put_moved,
    kernels.look_around,
    kernels.mix,
    kernels.put_mixed,
    kernels.put_rest,
    cut_fluxes.find_walls,
    cut_fluxes.find_faces,
    cut_fluxes.find_fluxes,
    cut_fluxes.advance_band,
    kernels.exchange_volumes,
    *sides.DRIVERS,
    kernels.keep_volumes,
    *wall_forces.FLUID_DRIVERS,
    *dust.FLUID_DRIVERS,
)


class CutCells:
    """Conservative coupling: the wall cuts cells, and fluid neither is made nor passes through bodies.

    reach   [m]: how far the solid's ghosts must go for its own sake: not at all
    sub_steps, stray  the most sub-steps of the solid in a step, and how far its particles may go in them [m]
    kind    field (local blocks, 1, Z, Y, X) on host and device: COVERED where a cell holds no fluid
    causes  of what the coupling creates: "wall" (what the solid receives less what the fluid gives; bodies that touch
            an end of the domain push against it), "sides" (what the fluid counts as having left the domain beside
            them, and has not)
    """

    causes = ("wall", "sides")
    reach = 0.0

    def __init__(self, scene: Scene, model, fluid: Fluid, solid: Structure, blocks: Blocks, team: Device):
        """Collective. Cuts the cells and fills them with the fluid on their open side."""
        self.model, self.fluid, self.solid, self.blocks, self.team = model, fluid, solid, blocks, team
        grid, self._dimensions = blocks.grid, blocks.grid.dimensions
        real = np.dtype(scene.fluid.precision).type
        self._stairs = scene.coupling.scheme == "stairs"
        coarsest = max(body.spacing for body in scene.solid.bodies)
        self.wall = WallGeometry(blocks, team, coarsest, real, scene.time.cfl, self._stairs)
        constants = {"DIMENSIONS": grid.dimensions, "LANES": self.wall.lanes, "KICKS": 1 + grid.dimensions}
        self.kernels = team.build(PARTICLE_DRIVERS, constants)
        self.fluid_kernels = team.build(
            FLUID_DRIVERS, model.constants | {"LANES": team.lanes}, model.bindings, scene.fluid.precision
        )
        self.exchange = GhostExchange(blocks, team, team.build([copy_regions], {}).copy_regions)
        self._near_ghosts = ChosenGhosts(self.exchange, team, self.kernels)
        particles = ParticleExchange(blocks, team, self.kernels)
        self._rows, built = particles.rows, (self.kernels, self.fluid_kernels)
        self._particles = WallParticles(solid, particles, self.kernels, self.wall)
        self._forces = WallForces(self.wall, self._particles, self._rows, built, self._near_ghosts)
        self._spacing = np.array(grid.spacing)
        self.sub_steps = scene.coupling.sub_steps
        self.stray = FARTHEST_MOVE * float(self._spacing[: self._dimensions].min())
        homes = (blocks.block_cells, blocks.curve_index)
        lower, *homes = (team.array(np.array(values)) for values in (grid.lower, *homes))
        place = (self.wall.shape, lower, self.wall.spacing, self.wall.origin, self.wall.cells, *homes, blocks.first)
        self.dust = Dust(solid.columns, self._rows, built, self.wall, *place)
        self._cell_volume = float(self._spacing.prod())
        self._initial = InitialState(scene.fluid, model)
        self._rest = self._state_at_rest(scene)
        self._rest_there = team.array(self._rest)

        self.kind = DualArray(team, blocks.allocate(1, np.uint8))
        self._fields = 3 if model.phases == 2 else 1
        self.swept = DualArray(team, np.ones((blocks.local_count, self._fields, *blocks.shape), real))
        fluid.volumes = self.swept
        self._state_parity, self._swept_parity = (
            team.array(np.where(axes < 0, 0, 1 << np.maximum(axes, 0)))
            for axes in (model.mirror, np.full(self._fields, -1))
        )
        self._master = team.array(blocks.allocate(grid.dimensions, np.int8))
        self._wall_sums = np.zeros((blocks.local_count, model.conserved))
        self._sides = Sides(fluid, model.conserved, self.wall, self.fluid_kernels)
        self._keep_lists([team.empty(0, np.int64)] * 3, np.zeros((blocks.local_count, 3), dtype=np.int64))
        (position,) = solid.columns.read("position")
        self._particles.look(position)
        self.dust.find(solid.columns, self._particles.middle, self._particles.bins)
        for _ in range(2):
            self._particles.cut(position, team.zeros(position.shape))
        self._fill_at_start()

    def _state_at_rest(self, scene: Scene) -> np.ndarray:
        """Conserved state (variables,) of the first region without its velocity."""
        state = self._initial.of(scene.fluid.regions[0].state)
        rest = np.array(self.model.formula("primitives")(state))
        rest[self.model.phases : self.model.phases + self._dimensions] = 0.0
        return np.array(self.model.formula("conserved")(tuple(rest)), dtype=scene.fluid.precision)

    def _fill_at_start(self) -> None:
        """Cut cells hold the state at the middle of their open corners; fluid fills what is open."""
        swept, kind, state = self.swept.host(), self.kind.host(), self.fluid.state
        swept[:, 0] = self.wall.fractions[1].host()[:, 0]
        for block in range(self.blocks.local_count):
            (x, y, z), middles = (a.T for a in self.wall.cut_cells(block))
            state[block][:, z, y, x] = self._initial.at(middles.T)
        self._classify()
        swept[:, 1:] = 0.0
        np.moveaxis(state, 1, -1)[kind[:, 0] == COVERED] = self._rest
        for changed in (self.swept, self.fluid):
            changed.changed()
        self._exchange_swept()

    # ---- one step ---------------------------------------------------------------------------------------------------

    def time_step(self) -> float:
        """Longest step [s] in which no particle of this rank goes farther than LARGEST_MOVE."""
        lowest, highest = self._rows.bounds(*self.solid.columns.read("velocity"))
        speed = max(-lowest.min(), highest.max())
        return LARGEST_MOVE * float(self._spacing[: self._dimensions].min()) / max(speed, 1e-300)

    def update_geometry(self) -> None:
        """Collective, after solid.advance(). Cut the cells where the particles are now, and find the moving wall."""
        team, D = self.team, self._dimensions
        particles = self._particles
        particles.thickness.way += particles.look(self.solid.start)
        self.dust.find(self.solid.columns, particles.middle, particles.bins)
        self._lone = self.dust.rows(self.solid.columns)
        particles.cut(self.solid.start, self.solid.carried)
        self._find_company()
        n = self._band.shape[0]
        self._area, self._start_volume = team.empty((n, D)), team.empty(n)
        self._opened, self._seen = team.empty((n, 2 * D)), team.empty(2 * D * n, np.int8)
        self._run(self.fluid_kernels.find_walls, self._area, self._opened, *self._walls, self.wall.spacing)
        self._run(self.fluid_kernels.find_faces, self._above, self._opened, self._seen, *self._walls)
        self._faces = self._rows.marked(self._seen)[1]
        self._flux = team.empty((n, 2 * D * self.model.constants["FLUXES"]))
        self._forces.begin(self._band, self._groups, self._area)
        self._sides.choose()

    def merge(self, stage: Stage) -> None:
        """Collective. Mix what belongs together in the stage's input, and leave it as states."""
        U, first = self.fluid.input_of(stage), stage.number == 0
        self._mix(U, self.wall.parts[0 if first else 1])
        if first:
            self._run(self.fluid_kernels.keep_volumes, self._swept, self.wall.shape, self._start_volume)
        self.fluid.wake(self.wall.near.host() > 0)
        self._start, self._input, self._output = self.fluid.device_state, U, self.fluid.output_of(stage)

    def apply_wall_fluxes(self, stage: Stage, dt: float) -> None:
        """Advance the cells of the band in the place of the fluid's stage, of a step of `dt` [s]."""
        rates, weight = np.array(self.fluid.rates(dt)[: len(self._spacing)]), stage.weight * dt
        rates, weights = (self.team.array(a) for a in (rates, weight * self._cell_volume / self._spacing))
        boxes, forces = -(-self._faces.shape[0] // self.team.lanes), self._forces
        given = (self._band, self._faces, self._seen, self._flux, self._input, self.wall.shape, self.wall.steps, rates)
        self.team.run(self.fluid_kernels.find_fluxes, boxes, *given)
        self._run_boxes(
            self.fluid_kernels.advance_band, self._above, self._opened, self._flux, self._start, self._input,
            self._output, self._swept, self._start_volume, self._area, forces.velocity, forces.impulse, forces.work,
            forces.added, self.wall.shape, rates, stage.b, dt, weight,
        )  # fmt: skip
        self._sides.book(self._input, self._walls, rates, weights)

    def redistribute(self) -> None:
        """Collective. Mix what the last stage left, and exchange volumes so that they stay near the geometric ones."""
        U, after, wall, k = self.fluid.device_state, self.wall.parts[1], self.wall, self.fluid_kernels
        self._mix(U, after)
        lists = [(cells, self._mixed(cells)) for cells in (self._band, self._loose)]
        for _ in range(2):
            self._exchange_contents(U)
            for cells, mixed in lists:
                self.team.run(
                    k.exchange_volumes, cells.shape[0], cells, mixed, U, self._swept, self._kinds, after, *wall.faces,
                    self._expands, wall.steps, wall.shape, wall.origin, wall.cells,
                )  # fmt: skip
            for cells, mixed in lists:
                self.team.run(k.put_mixed, cells.shape[0], cells, mixed, U, self._swept, wall.shape)
        self._near_ghosts.exchange((self.swept.device, self._swept_parity))

    def transfer_impulse(self, dt: float) -> Any:
        """Collective. Impulse (own, D) [N s] of the fluid on this rank's particles in the step of `dt` [s], on the
        device."""
        given = self._forces.impulse_on(self.solid)
        paid = np.zeros((self.blocks.local_count, self._dimensions + 1))
        self._dragged = self.drag(self._lone, given, dt) if self._lone.shape[0] else paid
        return given

    def drag(self, rows: Any, impulse: Any, dt: float) -> np.ndarray:
        """The fluid moves the lone particles `rows` (n,) in the last step, of `dt` [s]: their rows of `impulse`
        (own, D) [N s] are found, and what the fluid of each block pays for it (local blocks, D + 1) [N s, J]."""
        block, paid = self.dust.drag(
            self.solid.columns, rows, self.solid.start, dt, impulse, (self.fluid.device_state, self._swept),
            self._input, self._kinds,
        )  # fmt: skip
        sums = np.zeros((self.blocks.local_count, self._dimensions + 1))
        np.add.at(sums, block, paid)
        self.fluid.wake(np.bincount(block, minlength=len(sums)) > 0)
        return sums

    def account_work(self, excess: Any) -> None:
        """Collective, after solid.apply_impulse(), whose impulse worked at the `excess` (own, D) [m/s] over the
        velocity of the wall: the fluid pays for it."""
        D, P = self._dimensions, self.model.phases
        fluid = (self._joined, self.fluid.device_state, self._swept, *self._company)
        impulse, work = self._forces.pay(self.solid, excess, *fluid)
        self._wall_sums[:, P : P + D] += self.solid.given.sum(axis=1) - impulse - self._dragged[:, :-1]
        self._wall_sums[:, -1] += self.solid.work - work - self._dragged[:, -1]

    def pressure(self, dt: float) -> float:
        """Collective. The highest mean pressure [Pa] on a cell's wall in the last step, of `dt` [s]."""
        highest = self._rows.largest(self._forces.pressures(), 0.0) / dt
        return float(self.blocks.communicator.maximum(np.array([highest]))[0])

    def trapped(self) -> np.ndarray:
        """Collective. Mass [kg] of each phase in cells that are shut: it neither flows nor pushes."""
        held = self.team.empty((self._band.shape[0], self.model.phases))
        self._run(
            self.fluid_kernels.find_trapped, held, self._kinds, self.fluid.device_state, self._swept, self.wall.shape
        )
        return self.blocks.sum(self._cell_volume * self._groups.sums(held))

    def let_fluid_leave(self) -> None:
        """All that the fluid holds leaves the domain; from now on no cell has any."""
        self.fluid.leave(self.volume)
        self.swept.host()[:] = 0.0
        self.swept.changed()
        self._classify()

    def _classify(self) -> None:
        """Which cells are covered, by what they hold."""
        holds = self.swept.host()[:, :1] > 0.0
        self.kind.host()[:] = np.where(holds, FLUID, COVERED)
        self.kind.changed()

    # ---- parts of it ------------------------------------------------------------------------------------------------

    def _find_company(self) -> None:
        """Which cells join which, and the lists of the band's, the covered and the loose cells."""
        self.wall.find_masters(self._kinds, self._masters, self._swept, self._fields)
        self._exchange(self.kind.device, np.array([-1]), FLUID)
        self.wall.find_refuges(self._kinds, self._masters)
        self._exchange(self._master, np.arange(self._dimensions), 0)
        self._list_cells()
        self._run(self.fluid_kernels.take_contents, self.fluid.device_state, self._swept, self.wall.shape)
        mark = self.team.empty(self._band.shape[0], np.int8)
        self._run(self.fluid_kernels.mark_leaving, mark, self._kinds, self._masters, self.wall.shape, self.wall.steps)
        found = np.array([float(self._rows.any(mark)), float(self._lone.shape[0])])
        leaving, lone = self.blocks.communicator.maximum(found)
        if leaving > 0.0:
            self.absorb()
        self._expands = int(lone > 0.0 and not self._stairs)
        self._look_around()

    def absorb(self) -> None:
        """Collective. Contents of cells that are shut move, and these are covered."""
        U, wall, k = self.fluid.device_state, self.wall, self.fluid_kernels
        self._exchange_contents(U)
        moved = self.team.empty((self._band.shape[0], self.model.variables + 3), U.dtype)
        self._run(
            k.absorb, moved, U, self._swept, self._kinds, wall.parts[0], self._masters, wall.steps, wall.shape
        )  # fmt: skip
        self._run(k.put_moved, moved, U, self._swept, wall.shape)
        wall.cover_evicted(self._kinds, self._masters)
        self._list_cells()

    def _look_around(self) -> None:
        """Which cells around the band's belong together, and which of the band are next to each other."""
        wall, count, D = self.wall, self._band.shape[0], self._dimensions
        self._joined = self.team.empty((count, wall.offsets.shape[0]), np.int8)
        self._above = self.team.empty((count, D), np.int64)
        given = (self._masters, wall.offsets, wall.steps, wall.shape, wall.origin, wall.cells)
        self._run(self.fluid_kernels.look_around, self._joined, self._above, *given)

    def _list_cells(self) -> None:
        """Find the lists, and which ghosts are around the wall."""
        self._keep_lists(*self.wall.lists(self._kinds, self._swept, self._fields))
        self._exchange(self.wall.mark, np.array([-1]), FAR)
        self._near_ghosts.choose(self.wall.mark.reshape(-1))

    def _keep_lists(self, lists: list[Any], counts: np.ndarray) -> None:
        self._band, self._covered, self._loose = lists
        self._band_cells = counts[:, 0]
        self._groups = Groups(self.team, self.kernels, self._band_cells)

    def _mix(self, U: Any, fraction: Any) -> None:
        """Contents of the band become states of what belongs together; covered cells rest."""
        self._exchange_contents(U)
        wall, k, mixed = self.wall, self.fluid_kernels, self._mixed(self._band)
        self._run_boxes(k.mix, self._joined, mixed, U, self._swept, fraction, *self._company)
        self._run(k.put_mixed, mixed, U, self._swept, wall.shape)
        rest = (self._covered, U, self._swept, self._rest_there, wall.shape)
        self.team.run(k.put_rest, self._covered.shape[0], *rest)

    def _mixed(self, cells: Any) -> Any:
        """Room for states and volumes of a list of cells."""
        return self.team.empty((cells.shape[0], self.model.variables + 1), self.swept.dtype)

    def _run(self, kernel: Any, *arguments: Any) -> None:
        self.team.run(kernel, self._band.shape[0], self._band, *arguments)

    def _run_boxes(self, kernel: Any, *arguments: Any) -> None:
        """`_run`, of a kernel whose items are boxes of the device's lanes."""
        self.team.run(kernel, -(-self._band.shape[0] // self.team.lanes), self._band, *arguments)

    @property
    def _swept(self) -> Any:
        return self.swept.device.reshape(-1)

    @property
    def _kinds(self) -> Any:
        return self.kind.device.reshape(-1)

    @property
    def _masters(self) -> Any:
        return self._master.reshape(-1)

    @property
    def _walls(self) -> tuple[Any, ...]:
        """What decides how open a face is."""
        return self._kinds, *self.wall.faces, self.wall.shape, self.wall.steps

    @property
    def _company(self) -> tuple[Any, ...]:
        """What tells where masters and other neighbours are."""
        return self._masters, self.wall.offsets, self.wall.steps, self.wall.shape

    def _exchange(self, field: Any, mirror: np.ndarray, inflow: float) -> None:
        self.exchange.start(field, mirror, np.full((3, 2, field.shape[1]), inflow))
        self.exchange.finish()

    def _exchange_contents(self, U: Any) -> None:
        """Of the cells around the wall."""
        self._near_ghosts.exchange((U, self._state_parity), (self.swept.device, self._swept_parity))

    def _exchange_swept(self) -> None:
        self._exchange(self.swept.device, np.full(self._fields, -1), 1.0)

    # ---- looking at it ----------------------------------------------------------------------------------------------

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether a cell holds no fluid, ghosts included."""
        return self.swept.host()[:, 0] <= 0.0

    @property
    def volume(self) -> np.ndarray:
        """(local blocks, Z, Y, X) the part of each cell that its fluid fills."""
        return self.swept.host()[:, 0]

    def memory(self) -> int:
        """Bytes of this rank's fields, the corners' as if they were as many as cells."""
        fields = (self.kind, self.swept, *self.wall.fractions, *self.wall.apertures)
        cells, D = self.kind.nbytes, self._dimensions
        return sum(field.nbytes for field in fields) + cells * (2 + D + 8 * (1 + D) + 8)

    def workload(self) -> np.ndarray:
        """(local blocks,) cells in the band around the wall."""
        return self._band_cells.astype(float)

    def snapshot(self) -> Snapshot:
        """What a restart needs: the volumes, and the books."""
        return {
            "cells": {"swept": self.blocks.without_ghosts(self.swept.host()[:, :1])},
            "sums": {"wall": self._wall_sums, "sides": self._sides.passed.host()},
            "values": {"way": np.array(self._particles.thickness.way)},
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, after the solid has."""
        self.blocks.without_ghosts(self.swept.host()[:, :1])[:] = snapshot["cells"]["swept"]
        self.swept.changed()
        self._classify()
        self._exchange_swept()
        self._particles.thickness.way = float(snapshot["values"]["way"])
        self._wall_sums[:] = snapshot["sums"]["wall"]
        self._sides.restore(snapshot["sums"]["sides"])
        self.wall.near.host()[:] = 1
        self.wall.near.changed()
        position, velocity = self.solid.columns.read("position", "velocity")
        self._particles.look(position)
        self._particles.cut(position, velocity)

    def ledger(self) -> dict[str, np.ndarray]:
        """Collective. Masses, momentum and energy (conserved,) that the coupling has created so far, per cause."""
        totals = self.blocks.sum(np.hstack([self._wall_sums, self._sides.sums()]))
        return dict(zip(self.causes, np.split(totals, len(self.causes)), strict=True))
