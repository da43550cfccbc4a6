"""Fluid and solid together: cells that the wall cuts, each with a fluid volume fraction (docs/theory.md)."""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.coupling.cut_cells import fluxes, forces, lone, redistribution, sides, wall_particles
from distfsi.coupling.cut_cells.exact_surface import exact_surface
from distfsi.coupling.cut_cells.fluxes import BandFluxes
from distfsi.coupling.cut_cells.forces import WallForces
from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels.fluxes import StageTimes
from distfsi.coupling.cut_cells.kernels.records import Walls
from distfsi.coupling.cut_cells.lone import LoneParticles
from distfsi.coupling.cut_cells.merging import CellMerging
from distfsi.coupling.cut_cells.redistribution import Redistribution
from distfsi.coupling.cut_cells.sides import Sides
from distfsi.coupling.cut_cells.values import CellLists, CutGeometry, StageCells, Transfer
from distfsi.coupling.cut_cells.wall_particles import WallParticles
from distfsi.coupling.kernels.cells import COVERED, FLUID
from distfsi.coupling.particles import SolidParticles
from distfsi.device.interface import Device, DualArray
from distfsi.fluid.fluid import Fluid
from distfsi.fluid.initial import InitialState
from distfsi.fluid.model import FluidModel
from distfsi.fluid.stages import Stage
from distfsi.mesh.blocks import Blocks, Snapshot
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.kernels import rows as row_kernels
from distfsi.mesh.kernels.particles import EXCHANGE
from distfsi.mesh.kernels.regions import copy_cells, copy_regions, pack_cells, unpack_cells
from distfsi.mesh.particles import ParticleExchange
from distfsi.narrowing import present
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
    *forces.PARTICLE_DRIVERS,
    *lone.PARTICLE_DRIVERS,
)
FLUID_DRIVERS = (
    *redistribution.DRIVERS,
    *fluxes.DRIVERS,
    *sides.DRIVERS,
    *forces.FLUID_DRIVERS,
    *lone.FLUID_DRIVERS,
)


class CutCells:
    """Conservative coupling: the wall cuts cells, and fluid neither is made nor passes through bodies.

    reach   [m]: how far the solid's ghosts must go for its own sake: not at all
    sub_steps, stray  the most sub-steps of the solid in a step, and how far its particles may go in them [m]
    causes  of what the coupling creates: "wall" (what the solid receives less what the fluid gives); or of what passes
            the ends of the domain with bodies: "ends" (the same while bodies touch an end, which gives the rest),
            "sides" (what the fluid counts as having left beside them, and has not)
    geometry  of the last step; None before the first. That of a wall that stands is found once
    """

    causes = ("wall", "ends", "sides")
    at_ends = ("ends", "sides")
    reach = 0.0

    def __init__(
        self, scene: Scene, model: FluidModel, fluid: Fluid, solid: Structure, blocks: Blocks, device: Device
    ) -> None:
        """Collective. Cuts the cells and fills them with the fluid on their open side."""
        self.model, self.fluid, self.solid, self.blocks, self.device = model, fluid, solid, blocks, device
        grid, self._dimensions = blocks.grid, blocks.grid.dimensions
        self._staircase = scene.coupling.scheme == "staircase"
        self._particles = SolidParticles(solid)
        self._cell_volume = float(np.prod(grid.spacing))
        self._initial = InitialState(present(scene.fluid), model, grid)
        self._rest = self._state_at_rest(scene)
        self.geometry: CutGeometry | None = None
        self._settled = False
        self._wall_sums, self._end_sums = np.zeros((2, blocks.local_count, model.conserved))
        # the kernels, and who uses them
        coarsest = max(body.spacing for body in present(scene.solid).bodies)
        surface = exact_surface(scene, solid, blocks.communicator)
        self.wall = WallGeometry(blocks, device, coarsest, self._rest.dtype.type, self._staircase, surface)
        constants = {"DIMENSIONS": grid.dimensions, "GHOSTS": grid.ghost_layers}
        constants |= {"LANES": self.wall.lanes, "TRANSFERRED": 1 + grid.dimensions}
        of_particles = device.build(PARTICLE_DRIVERS, constants)
        of_fluid = device.build(
            FLUID_DRIVERS, model.constants | {"LANES": device.lanes}, model.bindings, present(scene.fluid).precision
        )
        ghosts = GhostExchange(blocks, device, device.build([copy_regions], {}).copy_regions)
        exchange = ParticleExchange(blocks, device, of_particles)
        self._rows = exchange.rows
        self._merging = CellMerging(self.wall, ghosts, of_particles, scene.time.cfl)
        self._redistribution = Redistribution(model, self.wall, self._merging, self._rows, of_fluid, self._rest)
        self._wall_particles = WallParticles(self._particles, exchange, of_particles, self.wall)
        self._lone = LoneParticles(self._particles, self._rows, self.wall, of_particles, of_fluid)
        self._fluxes = BandFluxes(model, self.wall.grid, device, self._rows, of_fluid)
        self._forces = WallForces(self._particles, self.wall, self._merging, self._rows, of_particles, of_fluid)
        self._sides = Sides(self.fluid, model.conserved, self.wall.grid, device, of_fluid)
        # what a step asks for, and what it finds
        self.sub_steps = scene.coupling.sub_steps
        self._narrowest = float(min(grid.spacing[: grid.dimensions]))
        self.stray = FARTHEST_MOVE * self._narrowest
        fluid.set_volumes(self.fluid_volume)
        # a wall that rests: the fractions before and after a step are the same
        position = self._particles.position
        passage = self._wall_particles.find(position)
        self._lone.find(passage.middle, passage.bins)
        for _ in ("before", "after"):
            self._wall_particles.cut(passage, position, device.zeros(position.shape))
        self._fill_at_start()

    def _state_at_rest(self, scene: Scene) -> np.ndarray:
        """Conserved state (variables,) of the first region without its velocity."""
        state = self._initial.of(present(scene.fluid).regions[0].state)
        rest = np.array(self.model.formula("primitives")(state))
        rest[self.model.phases : self.model.phases + self._dimensions] = 0.0
        return np.array(self.model.formula("conserved")(tuple(rest)), dtype=present(scene.fluid).precision)

    def _fill_at_start(self) -> None:
        """Cut cells hold the state at the middle of their open nodes; fluid fills what is open."""
        volume, kind, state = self.fluid_volume.host(), self.kind.host(), self.fluid.state
        volume[:, 0] = self.wall.fractions[1].host()[:, 0]
        for block in range(self.blocks.local_count):
            (x, y, z), middles = (a.T for a in self.wall.cut_cells(block))
            state[block][:, z, y, x] = self._initial.at(middles.T)
        self._classify()
        volume[:, 1:] = 0.0
        np.moveaxis(state, 1, -1)[kind[:, 0] == COVERED] = self._rest
        for changed in (self.fluid_volume, self.fluid):
            changed.changed()
        self._fill_volume_ghosts()

    # ---- one step ---------------------------------------------------------------------------------------------------

    def time_step(self) -> float:
        """Longest step [s] in which no particle of this rank goes farther than LARGEST_MOVE."""
        lowest, highest = (np.zeros(1),) * 2 if self.solid.stands else self._rows.bounds(self._particles.velocity)
        speed = max(-lowest.min(), highest.max())
        return LARGEST_MOVE * self._narrowest / max(speed, 1e-300)

    def update_geometry(self) -> CutGeometry:
        """Collective, after solid.advance(). Cut the cells where the particles are now, and find the moving wall. From
        then on the fluid's band holds contents, until merge()."""
        if self._settled:
            self.geometry = geometry = present(self.geometry).again(self.device)
            states = self._redistribution.states(self.fluid.device_state)
            self._redistribution.take_contents(geometry.lists.band, states)
            return geometry
        start = self._particles.start
        # particles
        passage = self._wall_particles.find(start)
        self._wall_particles.thin.drift += passage.farthest
        self._lone.find(passage.middle, passage.bins)
        rows = self._lone.rows()
        # cells
        motion = self._wall_particles.cut(passage, start, self._particles.carried)
        touched = self._rows.largest(motion.image.reshape(-1), 0.0)
        lists, walls, expands, at_end = self._merge_cells(rows.shape[0] > 0, touched > 0.0)
        merging, above = self._merging.merging_of(lists.band)
        # faces
        band, faces = self._fluxes.find_faces(lists.band, above, walls)
        loads, walled = self._forces.begin(band, motion)
        ends = self._merging.rows_in_band(self._sides.cells)
        start_volume = self.device.empty(lists.band.shape[0])
        self.geometry = CutGeometry(
            motion, rows, walls, lists, band, merging, faces, ends, walled, loads, start_volume, expands, at_end
        )
        self._settled = self.solid.stands and self._redistribution.is_settled(lists, rows, walls)
        return self.geometry

    def _merge_cells(self, lone: bool, touched: bool) -> tuple[CellLists, Walls, bool, bool]:
        """Collective. Find merge targets, and let isolated cells hand their fluid to receivers; the lists of cells, and
        whether any rank has `lone` particles whose cells expand, and whether on any an end of the domain is `touched`
        by bodies."""
        walls = self._walls
        self._merging.find_targets(walls, self.fluid_volume.device)
        lists = self._merging.list_cells(walls, self.fluid_volume.device)
        states = self._redistribution.states(self.fluid.device_state)
        self._redistribution.take_contents(lists.band, states)
        found = (self._redistribution.any_absorbed(lists.band, walls.kind), lone, touched)
        absorbed, alone, at_end = self.blocks.communicator.maximum(np.array(found, dtype=float))
        if absorbed > 0.0:
            lists = self.absorb(lists, walls)
        return lists, walls, bool(alone > 0.0) and not self._staircase, bool(at_end > 0.0)

    def absorb(self, lists: CellLists, walls: Walls) -> CellLists:
        """Collective. Contents of isolated cells move to their receivers, and these cells are covered: the new
        lists."""
        contents = self._redistribution.contents(self.fluid.device_state)
        self._redistribution.absorb(lists.band, contents, walls)
        self._merging.cover_absorbed()
        return self._merging.list_cells(walls, self.fluid_volume.device)

    def merge(self, geometry: CutGeometry, stage: Stage) -> StageCells:
        """Collective. Contents in the stage's input become states, those of merged cells one state."""
        fluid, first = self.fluid, stage.number == 0
        walls, contents = geometry.walls, self._redistribution.contents(fluid.input_of(stage))
        fraction = walls.old_fraction if first else walls.new_fraction
        states = self._redistribution.redistribute(geometry.lists, contents, fraction, geometry.merging)
        if first:
            self._redistribution.keep_volumes(geometry.band.cells, states, geometry.start_volume)
        fluid.wake(self.wall.near.host() > 0)
        output = self._redistribution.contents(fluid.output_of(stage))
        return StageCells(fluid.device_state, states, output)

    def apply_wall_fluxes(self, geometry: CutGeometry, cells: StageCells, stage: Stage, dt: float) -> None:
        """Advance the cells of the band in the place of the fluid's stage, in a step of `dt` [s], to contents."""
        times = StageTimes(stage.b, dt, stage.weight * dt)
        self._fluxes.advance(geometry, cells, times)
        self._sides.account(geometry.sides, cells.input.U, geometry.walls, dt, times.weight)

    def redistribute(self, geometry: CutGeometry) -> None:
        """Collective. Contents that the last stage left become states; volumes come nearer to the geometric ones."""
        contents = self._redistribution.contents(self.fluid.device_state)
        fraction = geometry.walls.new_fraction
        states = self._redistribution.redistribute(geometry.lists, contents, fraction, geometry.merging)
        self._redistribution.exchange_volumes(geometry.lists, states, geometry.walls, geometry.expands)

    def transfer_impulse(self, geometry: CutGeometry, cells: StageCells, dt: float) -> Transfer:
        """Collective. What the fluid gives to this rank's particles in a step of `dt` [s] whose last stage had the
        `cells`."""
        impulse, shared = self._forces.impulse_on(geometry)
        paid = np.zeros((self.blocks.local_count, self._dimensions + 1))
        if geometry.lone.shape[0]:
            paid = self.drag(geometry, geometry.lone, cells.input.U, impulse, dt)
        return Transfer(impulse, shared, paid)

    def drag(self, geometry: CutGeometry, rows: Any, pressing: Any, impulse: Any, dt: float) -> np.ndarray:
        """The fluid moves the lone particles `rows` (n,) in a step of `dt` [s], whose last stage had the input
        `pressing`: their rows of `impulse` (own, D) [N s] are found, and what the fluid of each block pays for it
        (local blocks, D + 1) [N s, J]."""
        states = self._redistribution.states(self.fluid.device_state)
        block, paid = self._lone.drag(rows, impulse, states, pressing, geometry.walls, dt)
        sums = np.zeros((self.blocks.local_count, self._dimensions + 1))
        np.add.at(sums, block, paid)
        self.fluid.wake(np.bincount(block, minlength=len(sums)) > 0)
        return sums

    def account_work(self, geometry: CutGeometry, transfer: Transfer, excess: Any) -> None:
        """Collective, after solid.apply_impulse(), whose impulse worked at the `excess` (own, D) [m/s] over the
        velocity of the wall: the fluid pays for it."""
        D, P, p = self._dimensions, self.model.phases, self._particles
        states = None if self.solid.stands else self._redistribution.states(self.fluid.device_state)
        impulse, work = self._forces.correct(geometry, excess, transfer.shared, states)
        sums = self._end_sums if geometry.at_end else self._wall_sums
        sums[:, P : P + D] += p.impulse - impulse - transfer.dragged[:, :-1]
        sums[:, -1] += p.work - work - transfer.dragged[:, -1]

    # ---- between steps ----------------------------------------------------------------------------------------------

    def pressure(self, dt: float) -> float:
        """Collective. The highest mean pressure [Pa] on a cell's wall in the last step, of `dt` [s]."""
        pressures = self._forces.pressures(present(self.geometry))
        highest = self._rows.largest(pressures, 0.0) / dt
        return float(self.blocks.communicator.maximum(np.array([highest]))[0])

    def trapped(self) -> np.ndarray:
        """Collective. Mass [kg] of each phase in isolated cells: it neither flows nor pushes."""
        held = np.zeros((self.blocks.local_count, self.model.phases))
        if self.geometry is not None:
            lists, states = self.geometry.lists, self._redistribution.states(self.fluid.device_state)
            kind = self.kind.device.reshape(-1)
            held = self._cell_volume * lists.blocks.sums(self._redistribution.trapped(lists.band, states, kind))
        return self.blocks.sum(held)

    def let_fluid_leave(self) -> None:
        """All that the fluid holds leaves the domain; from now on no cell has any."""
        self.fluid.leave(self.volume)
        self.fluid_volume.host()[:] = 0.0
        self.fluid_volume.changed()
        self._classify()

    def _classify(self) -> None:
        """Which cells are covered, by what they hold."""
        holds = self.fluid_volume.host()[:, :1] > 0.0
        self.kind.host()[:] = np.where(holds, FLUID, COVERED)
        self.kind.changed()

    def _fill_volume_ghosts(self) -> None:
        self._merging.fill_ghosts(self.fluid_volume.device, np.full(self._redistribution.fields, -1), 1.0)

    # ---- looking at it ----------------------------------------------------------------------------------------------

    @property
    def kind(self) -> DualArray:
        """Field (local blocks, 1, Z, Y, X) on host and device: COVERED where a cell holds no fluid."""
        return self._merging.kind

    @property
    def fluid_volume(self) -> DualArray:
        """Field (local blocks, …, Z, Y, X) on host and device: fluid volume fraction of each cell, first."""
        return self._redistribution.volume

    @property
    def _walls(self) -> Walls:
        kind = self.kind.device.reshape(-1)
        return Walls(kind, *self.wall.flat_fractions, *self.wall.flat_apertures)

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether a cell holds no fluid, ghosts included."""
        return self.fluid_volume.host()[:, 0] <= 0.0

    @property
    def volume(self) -> np.ndarray:
        """(local blocks, Z, Y, X) the part of each cell that its fluid fills."""
        return self.fluid_volume.host()[:, 0]

    def memory(self) -> int:
        """Bytes of this rank's fields, those of nodes as if they were as many as cells."""
        fields = (self.kind, self.fluid_volume, *self.wall.fractions, *self.wall.apertures)
        cells, D = self.kind.nbytes, self._dimensions
        return sum(field.nbytes for field in fields) + cells * (2 + D + 8 * (1 + D) + 8)

    def workload(self) -> np.ndarray:
        """(local blocks,) cells in the band around the wall."""
        counts = self.geometry.lists.counts if self.geometry else np.zeros(self.blocks.local_count)
        return counts.astype(float)

    def snapshot(self) -> Snapshot:
        """What a restart needs: the volumes, and the budget."""
        return {
            "cells": {"fluid_volume": self.blocks.without_ghosts(self.fluid_volume.host()[:, :1])},
            "sums": {"wall": self._wall_sums, "ends": self._end_sums, "sides": self._sides.passed.host()},
            "values": {"drift": np.array(self._wall_particles.thin.drift)},
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, after the solid has."""
        self.blocks.without_ghosts(self.fluid_volume.host()[:, :1])[:] = snapshot["cells"]["fluid_volume"]
        self.fluid_volume.changed()
        self._classify()
        self._fill_volume_ghosts()
        self._wall_particles.thin.drift = float(snapshot["values"]["drift"])
        self._wall_sums[:], self._end_sums[:] = (snapshot["sums"][name] for name in ("wall", "ends"))
        self._sides.restore(snapshot["sums"]["sides"])
        self.wall.near.host()[:] = 1
        self.wall.near.changed()
        position = self._particles.position
        self._wall_particles.cut(self._wall_particles.find(position), position, self._particles.velocity)
        self._settled = False

    def budget_by_cause(self) -> dict[str, np.ndarray]:
        """Collective. Masses, momentum and energy (conserved,) that there are more since the start, per cause."""
        totals = self.blocks.sum(np.hstack([self._wall_sums, self._end_sums, self._sides.sums()]))
        return dict(zip(self.causes, np.split(totals, len(self.causes)), strict=True))
