"""Fluid and solid together: an immersed boundary made of particles (paper, Eqs. 31-35 made consistent)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import numpy as np

from distfsi.coupling.immersed_boundary.kernels import covering, states
from distfsi.coupling.immersed_boundary.kernels.covering import COVERED_CELLS, FRESH_CELLS
from distfsi.coupling.immersed_boundary.kernels.states import Surroundings
from distfsi.coupling.kernels import cells as kinds
from distfsi.coupling.kernels import spreading
from distfsi.coupling.kernels.interpolation import Cloud
from distfsi.coupling.kernels.spreading import Receivers
from distfsi.coupling.particles import SolidParticles
from distfsi.device.interface import Device, DualArray
from distfsi.fluid.fluid import Fluid
from distfsi.fluid.initial import InitialState
from distfsi.fluid.model import FluidModel
from distfsi.fluid.stages import Stage
from distfsi.mesh import search
from distfsi.mesh.blocks import Blocks, Snapshot
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.kernels import rows as row_kernels
from distfsi.mesh.kernels.regions import copy_regions
from distfsi.mesh.rows import Groups
from distfsi.narrowing import present
from distfsi.scene.description import Scene
from distfsi.solid.protocol import Structure

COVER_RADIUS = 1.5  # in cells, of the kernel that decides what is covered; at least three particle spacings
VELOCITY_RADIUS = 1.4  # in cover radii, of the kernel between particles and cells; at most the ghost cells allow
PARTICLE_DRIVERS = (
    *search.DRIVERS,
    row_kernels.add_rows,
    covering.find_amounts,
    covering.find_depth,
    covering.list_cells,
    covering.find_wall_velocity,
    spreading.find_homes,
    spreading.spread,
    states.find_impulse,
    states.clear,
)
FLUID_DRIVERS = (
    covering.cover,
    states.fill_covered,
    states.fill_fresh,
    states.fill_deep,
    states.find_contents,
    states.collect_wall,
    states.collect_sides,
    states.find_transfer,
)


@dataclass(frozen=True)
class CoveredCells:
    """What the solid covers in a step, and what the fluid gives to it; arrays are the device's.

    covered, deep, fresh  (n,), (m,), (k,): covered cells that fluxes see, those that they do not, and cells that are
              fluid since this step, block by block
    counts    (local blocks, 3) how many of each there are, on the host
    velocity  (n, D) [m/s] of the wall in covered cells
    inertia   (n,) [kg/m^d] sum of mass times kernel of the particles that make it
    passed    (n, conserved) what has crossed the wall into covered cells: the stages add to it
    """

    covered: Any
    deep: Any
    fresh: Any
    counts: np.ndarray
    velocity: Any
    inertia: Any
    passed: Any


@dataclass(frozen=True)
class Transfer:
    """What the fluid gives in a step: the impulse (own, D) [N s] on this rank's particles, on the device."""

    impulse: Any


class ImmersedBoundary:
    """What the solid covers of the fluid's grid, the state of the covered cells, and the forces across the wall.

    reach   [m]: how far the solid's ghosts and images must go
    sub_steps, stray  the most sub-steps of the solid, and how far its particles may go in them [m]: there are none
    causes  of what the coupling creates: "wall" (what the solid receives less what the fluid loses there),
            "covered" and "fresh" cells, "sides" (what the fluid counts as having left the domain at covered cells)
    kind    field (local blocks, 1, Z, Y, X) on host and device: what cells are (coupling/kernels/cells.py)
    """

    causes = ("wall", "covered", "fresh", "sides")
    at_ends = ("sides",)
    sub_steps, stray = 1, 0.0

    def __init__(
        self, scene: Scene, model: FluidModel, fluid: Fluid, solid: Structure, blocks: Blocks, device: Device
    ) -> None:
        """Collective. Prepares the solid and classifies the cells, so that `covered` is known from the start on."""
        self.model, self.fluid, self.solid, self.blocks, self.device = model, fluid, solid, blocks, device
        grid, self._dimensions = blocks.grid, blocks.grid.dimensions
        self._particles = SolidParticles(solid)
        self._grid, self._table = blocks.grid_on(device), blocks.table_on(device)
        constants = {"DIMENSIONS": grid.dimensions, "GHOSTS": grid.ghost_layers}
        constants |= {"LANES": 1, "TRANSFERRED": grid.dimensions}
        self.kernels = device.build(PARTICLE_DRIVERS, constants)
        self.fluid_kernels = device.build(
            FLUID_DRIVERS, model.constants, model.bindings, present(scene.fluid).precision
        )
        self.exchange = GhostExchange(blocks, device, device.build([copy_regions], {}).copy_regions)

        h = min(scene.domain.spacing)
        self.cover_radius = COVER_RADIUS * max(h, 2.0 * max(body.spacing for body in present(scene.solid).bodies))
        self.reach = min(VELOCITY_RADIUS * self.cover_radius, (grid.ghost_layers + 0.5) * h)
        D = grid.dimensions
        self._cells = search.CellSort(self.kernels, device, grid.lower[:D], grid.upper[:D])
        self._search_cell, self._cell_volume = min(grid.spacing[:D]), float(np.prod(grid.spacing))
        self._real = np.dtype(present(scene.fluid).precision).type
        self._around = self._find_surroundings(self._state_at_rest(scene))
        images = grid.ghost_layers * (np.array(grid.boundaries) == "symmetry")
        self._seen_cells = device.array(np.column_stack([-images[:, 0], grid.cells + images[:, 1]]))
        self._side_cells, self._sides, self._side_blocks = self._find_sides()
        self._through_sides = DualArray(device, np.zeros((len(self._side_blocks), model.conserved)))

        self.kind = DualArray(device, np.full((blocks.local_count, 1, *blocks.shape), kinds.UNKNOWN, np.uint8))
        self._occupied = DualArray(device, np.ones(blocks.local_count, dtype=np.uint8))
        self._transfer = device.array(blocks.allocate(grid.dimensions))
        self._created = {cause: np.zeros((blocks.local_count, model.conserved)) for cause in self.causes[:-1]}
        solid.prepare(self.reach)
        self._counts = self.update_geometry().counts

    def _state_at_rest(self, scene: Scene) -> np.ndarray:
        """Primitive state (variables,) of the first region without its velocity."""
        fluid = present(scene.fluid)
        state = InitialState(fluid, self.model, self.blocks.grid).of(fluid.regions[0].state)
        rest = np.array(self.model.formula("primitives")(state), dtype=self._real)
        rest[self.model.phases : self.model.phases + self._dimensions] = 0.0
        return rest

    def _find_surroundings(self, rest: np.ndarray) -> Surroundings:
        """The cells around a cell, ring by ring, and their weights in Eq. 32: 1/distance^2; `rest` where there are
        none."""
        D, layers, upload = self._dimensions, self.blocks.grid.ghost_layers, self.device.array
        around = np.array([o for o in product(range(-layers, layers + 1), repeat=D) if any(o)])
        ring = np.abs(around).max(axis=1)
        around = around[np.argsort(ring, kind="stable")]
        _, size_y, size_x = self.blocks.shape
        steps = np.array([1, size_x, size_x * size_y])
        spacing = np.array(self.blocks.grid.spacing[:D])
        weights = (1.0 / ((around * spacing) ** 2).sum(axis=1)).astype(self._real)
        rings = np.searchsorted(np.sort(ring), np.arange(1, layers + 2))
        return Surroundings(upload(around @ steps[:D]), upload(weights), upload(rings), upload(rest))

    def _find_sides(self) -> tuple[Any, Any, np.ndarray]:
        """This rank's cells (n,) at the domain's sides, periodic ones apart, and which sides, on the device; their
        blocks."""
        grid, blocks = self.blocks.grid, self.blocks
        cells = np.arange(blocks.local_count * prod(blocks.shape)).reshape(-1, *blocks.shape)
        found, sides = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for block, (origin, extent) in enumerate(zip(blocks.origin, blocks.extent, strict=True)):
            active = self.fluid.active(cells, block)
            for axis, side in product(range(grid.dimensions), (0, 1)):
                at_end = origin[axis] + side * extent[axis] == side * grid.cells[axis]
                if at_end and grid.boundaries[axis][side] != "periodic":
                    found.append(active.take(-side, axis=2 - axis).ravel())
                    sides.append(np.full(len(found[-1]), 2 * axis + side))
        cell = np.concatenate(found)
        return self.device.array(cell), self.device.array(np.concatenate(sides)), cell // prod(blocks.shape)

    # ---- one step ---------------------------------------------------------------------------------------------------

    def time_step(self) -> float:
        """Longest step [s] that the coupling allows: any."""
        return np.inf

    def update_geometry(self) -> CoveredCells:
        """Collective. Find the covered cells, and the velocity of the wall in those that fluxes see."""
        around, device, blocks, D = self.solid.around, self.device, self.blocks, self._dimensions
        # the particles
        position, count = around.position, around.position.shape[0]
        volume, momentum = device.empty((count, 1)), device.empty((count, 1 + D))
        device.run(self.kernels.find_amounts, count, around.state, volume, momentum)
        _, bins = self._cells.sort(position, around.plan.key.device, self._search_cell)
        # what they cover
        lost = device.zeros((blocks.local_count, self.model.conserved))
        known = (self._kinds, self._occupied.device, self.fluid.device_state, lost, self.cover_radius)
        device.run(self.fluid_kernels.cover, blocks.local_count, *known, Cloud(position, volume, bins), self._grid)
        self._created["covered"] -= device.download(lost) * self._cell_volume
        self._exchange(self.kind.device, np.array([-1]), kinds.COVERED)
        counts, covered, deep, fresh = self._list_cells()
        self._counts = counts
        # how the wall moves there
        n = covered.shape[0]
        velocity, inertia = device.empty((n, D), self._real), device.empty(n)
        particles = Cloud(position, momentum, bins)
        self._run(self.kernels.find_wall_velocity, covered, velocity, inertia, self.reach, particles, self._grid)
        passed = device.zeros((n, self.model.conserved))
        return CoveredCells(covered, deep, fresh, counts, velocity, inertia, passed)

    def merge(self, cells: CoveredCells, stage: Stage) -> Any:
        """Collective. Give the covered cells of the stage's input, and before the first stage the fresh ones, their
        states (Eqs. 31, 32). Returns the input."""
        self.fluid.exchange_ghosts(stage)
        U, k, kind, around, grid = self.fluid.input_of(stage), self.fluid_kernels, self._kinds, self._around, self._grid
        self.fluid.wake(self._occupied.host() > 0)
        self._run(k.fill_covered, cells.covered, cells.velocity, U, kind, around, grid)
        self._run(k.fill_deep, cells.deep, U, around.rest, grid)
        if stage.number == 0:
            self._run(k.fill_fresh, cells.fresh, U, kind, around, grid)
            content = self.device.empty((cells.fresh.shape[0], self.model.conserved))
            self._run(k.find_contents, cells.fresh, U, content, grid)
            self._created["fresh"] += self._per_block(cells.counts[:, FRESH_CELLS], content) * self._cell_volume
        return U

    def apply_wall_fluxes(self, cells: CoveredCells, U: Any, stage: Stage, dt: float) -> None:
        """Add up what has crossed the wall in a stage with the input U, of a step of `dt` [s], with the fluxes of that
        stage (Eqs. 33, 35)."""
        known = (U, self._kinds, dt, stage.weight * dt, self._grid)
        self._run(self.fluid_kernels.collect_wall, cells.covered, cells.passed, *known)
        given = (self._side_cells, self._sides, self._through_sides.device, *known)
        self._run(self.fluid_kernels.collect_sides, *given)

    def redistribute(self, cells: CoveredCells) -> None:
        """No cell shares its content with others."""

    def transfer_impulse(self, cells: CoveredCells, U: Any, dt: float) -> Transfer:
        """Collective. What the fluid gives to this rank's particles in the step."""
        D, p, device, k = self._dimensions, self._particles, self.device, self.kernels
        # what a covered cell gives per kernel value
        wall = (cells.passed, cells.velocity, cells.inertia)
        self._run(self.fluid_kernels.find_transfer, cells.covered, *wall, self._transfer, self._grid)
        self._exchange(self._transfer, np.arange(D), 0.0)
        # the sum over cells around each particle
        own, start, home = p.count, p.start, device.empty(p.count, np.int64)
        device.run(k.find_homes, own, start, home, self._grid, self._table)
        chosen, gained = device.array(np.arange(own)), device.empty((own, D))
        receivers = Receivers(start, home, device.array(np.ones((own, D))))
        given = (self.reach, self._kinds, kinds.COVERED, self._transfer, self._seen_cells)
        device.run(k.spread, own, chosen, receivers, *given, gained, self._grid)
        impulse = device.empty((own, D))
        device.run(k.find_impulse, own, p.mass, gained, impulse)
        self._run(k.clear, cells.covered, D, self._transfer.reshape(-1), self._grid)
        self._created["wall"] -= self._per_block(cells.counts[:, COVERED_CELLS], cells.passed)
        return Transfer(impulse)

    def account_work(self, cells: CoveredCells, transfer: Transfer, excess: Any) -> None:
        """Enter what the solid has received, after solid.apply_impulse()."""
        D, P = self._dimensions, self.model.phases
        self._created["wall"][:, P : P + D] += self._particles.impulse
        self._created["wall"][:, -1] += self._particles.work

    # ---- parts of it ------------------------------------------------------------------------------------------------

    def _list_cells(self) -> tuple[np.ndarray, Any, Any, Any]:
        """How many cells of each kind there are (local blocks, 3); covered cells that fluxes see, those that they do
        not, and fresh ones, block by block."""
        device, count, k = self.device, self.blocks.local_count, self.kernels
        found = device.empty((count, 3), np.int64)
        device.run(k.find_depth, count, self._kinds, self._occupied.read, self._around.offsets, found, self._grid)
        counts = device.download(found)
        first = device.array(np.cumsum(counts, axis=0) - counts)
        lists = [device.empty(n, np.int64) for n in counts.sum(axis=0)]
        device.run(k.list_cells, count, self._kinds, self._occupied.read, first, *lists, self._grid)
        return counts, *lists

    @property
    def _kinds(self) -> Any:
        return self.kind.device.reshape(-1)

    def _run(self, kernel: Any, cells: Any, *arguments: Any) -> None:
        self.device.run(kernel, cells.shape[0], cells, *arguments)

    def _exchange(self, field: np.ndarray, mirror: np.ndarray, inflow: float) -> None:
        self.exchange.start(field, mirror, np.full((3, 2, field.shape[1]), inflow))
        self.exchange.finish()

    def _per_block(self, counts: np.ndarray, values: Any) -> np.ndarray:
        """Sums (local blocks, k) of `values` (n, k) on the device, of which each block has so many."""
        return Groups(self.device, self.kernels, counts).sums(values)

    # ---- looking at it ----------------------------------------------------------------------------------------------

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether the solid covers a cell, ghosts included."""
        return self.kind.host()[:, 0] >= kinds.COVERED

    def trapped(self) -> np.ndarray:
        """Mass [kg] of each phase in isolated cells: there are none."""
        return np.zeros(self.model.phases)

    def memory(self) -> int:
        """Bytes of this rank's fields."""
        return self.kind.nbytes * (1 + self._dimensions * 8)

    def workload(self) -> np.ndarray:
        """(local blocks,) covered cells that fluxes see."""
        return self._counts[:, COVERED_CELLS].astype(float)

    @property
    def volume(self) -> np.ndarray:
        """(local blocks, Z, Y, X) the part of each cell that fluid fills: all or nothing."""
        return np.where(self.covered, 0.0, 1.0)

    def snapshot(self) -> Snapshot:
        """What a restart needs: which cells are covered, so that those are known that come free; and the budget."""
        return {
            "cells": {"kind": self.blocks.without_ghosts(self.kind.host())},
            "sums": {**self._created, "sides": self._through_sides.host()},
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self.blocks.without_ghosts(self.kind.host())[:] = snapshot["cells"]["kind"]
        self._occupied.host()[:] = 1
        for cause, amounts in {**self._created, "sides": self._through_sides.host()}.items():
            amounts[:] = snapshot["sums"][cause]
        for pair in (self.kind, self._occupied, self._through_sides):
            pair.changed()

    def budget_by_cause(self) -> dict[str, np.ndarray]:
        """Collective. Masses, momentum and energy (conserved,) that the coupling has created so far, per cause."""
        count, through = self.blocks.local_count, self._through_sides.host()
        sides = np.stack([np.bincount(self._side_blocks, amounts, count) for amounts in through.T], axis=1)
        totals = self.blocks.sum(np.hstack([*self._created.values(), sides]))
        return dict(zip(self.causes, np.split(totals, len(self.causes)), strict=True))
