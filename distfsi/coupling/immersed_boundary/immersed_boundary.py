"""Fluid and solid together: an immersed boundary made of particles (paper, Eqs. 31-35 made consistent)."""

from __future__ import annotations

from itertools import product
from math import prod
from typing import Any

import numpy as np

from distfsi.coupling.immersed_boundary import kernels
from distfsi.coupling.kernels import cells as kinds
from distfsi.coupling.kernels import spreading as push
from distfsi.device.interface import Device, DualArray
from distfsi.fluid.fluid import Fluid, Stage
from distfsi.fluid.initial import InitialState
from distfsi.mesh import search
from distfsi.mesh.blocks import GHOSTS, Blocks, Snapshot
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.kernels import rows as row_kernels
from distfsi.mesh.kernels.regions import copy_regions
from distfsi.mesh.rows import Groups
from distfsi.scene.description import Scene
from distfsi.solid.protocol import Structure

COVER_RADIUS = 1.5  # in cells, of the kernel that decides what is covered; at least three particle spacings
VELOCITY_RADIUS = 1.4  # in cover radii, of the kernel between particles and cells; at most the ghost cells allow
PARTICLE_DRIVERS = (
    *search.DRIVERS,
    row_kernels.add_rows,
    kernels.find_amounts,
    kernels.find_depth,
    kernels.list_cells,
    kernels.find_wall_velocity,
    push.find_homes,
    push.gather_kicks,
    push.push,
    kernels.clear,
)
FLUID_DRIVERS = (
    kernels.cover,
    kernels.fill_covered,
    kernels.fill_fresh,
    kernels.fill_deep,
    kernels.find_contents,
    kernels.collect_wall,
    kernels.collect_sides,
    kernels.spread,
)


class ImmersedBoundary:
    """What the solid covers of the fluid's grid, the state of the covered cells, and the forces across the wall.

    reach   [m]: how far the solid's ghosts and images must go
    sub_steps, stray  the most sub-steps of the solid, and how far its particles may go in them [m]: there are none
    causes  of what the coupling creates: "wall" (what the solid receives less what the fluid loses there),
            "covered" and "fresh" cells, "sides" (what the fluid counts as having left the domain at covered cells)
    """

    causes = ("wall", "covered", "fresh", "sides")
    sub_steps, stray = 1, 0.0

    def __init__(self, scene: Scene, model, fluid: Fluid, solid: Structure, blocks: Blocks, team: Device):
        """Collective. Prepares the solid and classifies the cells, so that `covered` is known from the start on."""
        self.model, self.fluid, self.solid, self.blocks, self.team = model, fluid, solid, blocks, team
        grid, self._dimensions = blocks.grid, blocks.grid.dimensions
        self.kernels = team.build(
            PARTICLE_DRIVERS, {"DIMENSIONS": grid.dimensions, "LANES": 1, "KICKS": grid.dimensions}
        )
        self.fluid_kernels = team.build(FLUID_DRIVERS, model.constants, model.bindings, scene.fluid.precision)
        self.exchange = GhostExchange(blocks, team, team.build([copy_regions], {}).copy_regions)

        h = min(scene.domain.spacing)
        self.cover_radius = COVER_RADIUS * max(h, 2.0 * max(body.spacing for body in scene.solid.bodies))
        self.reach = min(VELOCITY_RADIUS * self.cover_radius, (GHOSTS + 0.5) * h)
        D = grid.dimensions
        self._cells = search.CellSort(self.kernels, team, np.array(grid.lower[:D]), np.array(grid.upper[:D]))
        self._spacing, self._cell_volume = np.array(grid.spacing), float(np.prod(grid.spacing))
        self._shape, self._lower, self._widths = map(self._upload, (blocks.shape, grid.lower, grid.spacing))
        self._origin, self._extent = team.array(blocks.origin), team.array(blocks.extent)
        self._homes = [self._upload(values) for values in (grid.cells, blocks.block_cells, blocks.curve_index)]
        self._real = np.dtype(scene.fluid.precision)
        self._rest = team.array(self._state_at_rest(scene))
        self._find_neighbourhood()
        self._find_sides()

        self.kind = DualArray(team, np.full((blocks.local_count, 1, *blocks.shape), kinds.UNKNOWN, np.uint8))
        self._occupied = DualArray(team, np.ones(blocks.local_count, dtype=np.uint8))
        self._kick = team.array(blocks.allocate(grid.dimensions))
        self._ledger = {cause: np.zeros((blocks.local_count, model.conserved)) for cause in self.causes[:-1]}
        solid.prepare(self.reach)
        self.update_geometry()

    def _upload(self, values: Any) -> Any:
        return self.team.array(np.array(values))

    def _state_at_rest(self, scene: Scene) -> np.ndarray:
        """Primitive state (variables,) of the first region without its velocity."""
        state = InitialState(scene.fluid, self.model).of(scene.fluid.regions[0].state)
        rest = np.array(self.model.formula("primitives")(state), dtype=self._real)
        rest[self.model.phases : self.model.phases + self._dimensions] = 0.0
        return rest

    def _find_neighbourhood(self) -> None:
        """Places of the cells around a cell, ring by ring, and their weights in Eq. 32: 1/distance^2."""
        D = self._dimensions
        around = np.array([o for o in product(range(-GHOSTS, GHOSTS + 1), repeat=D) if any(o)])
        ring = np.abs(around).max(axis=1)
        around = around[np.argsort(ring, kind="stable")]
        _, size_y, size_x = self.blocks.shape
        steps = np.array([1, size_x, size_x * size_y])
        weights = (1.0 / ((around * self._spacing[:D]) ** 2).sum(axis=1)).astype(self._real)
        rings = np.searchsorted(np.sort(ring), np.arange(1, GHOSTS + 2))
        self._steps, self._offsets, self._weights, self._rings = map(
            self._upload, (steps, around @ steps[:D], weights, rings)
        )

    def _find_sides(self) -> None:
        """This rank's cells at the domain's sides, periodic ones apart, and which sides; and the range of cells that
        particles see: the grid and its images at symmetry planes."""
        grid, blocks = self.blocks.grid, self.blocks
        cells = np.arange(blocks.local_count * prod(blocks.shape)).reshape(-1, *blocks.shape)
        places, sides = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for block, (origin, extent) in enumerate(zip(blocks.origin, blocks.extent, strict=True)):
            inner = (slice(g, g + n) for g, n in zip(grid.ghosts[::-1], extent[::-1], strict=True))
            active = cells[(block, *inner)]
            for axis, side in product(range(grid.dimensions), (0, 1)):
                at_end = origin[axis] + side * extent[axis] == side * grid.cells[axis]
                if at_end and grid.boundaries[axis][side] != "periodic":
                    places.append(active.take(-side, axis=2 - axis).ravel())
                    sides.append(np.full(len(places[-1]), 2 * axis + side))
        places = np.concatenate(places)
        self._side_blocks = places // prod(blocks.shape)
        self._sides = [self.team.array(places), self.team.array(np.concatenate(sides))]
        self._through_sides = DualArray(self.team, np.zeros((len(places), self.model.conserved)))
        images = GHOSTS * (np.array(grid.boundaries) == "symmetry")
        self._seen_cells = self.team.array(np.column_stack([-images[:, 0], grid.cells + images[:, 1]]))

    # ---- one step ---------------------------------------------------------------------------------------------------

    def time_step(self) -> float:
        """Longest step [s] that the coupling allows: any."""
        return np.inf

    def update_geometry(self) -> None:
        """Collective. Find the covered cells, and the velocity of the wall in those that fluxes see."""
        around, team, blocks, D = self.solid.around, self.team, self.blocks, self._dimensions
        position, count = around.position, around.position.shape[0]
        volume, momentum = team.empty((count, 1)), team.empty((count, 1 + D))
        team.run(self.kernels.find_amounts, count, around.state, volume, momentum)
        _, bins = self._cells.sort(position, around.plan.key.device, self._spacing[:D].min())
        lost = team.zeros((blocks.local_count, self.model.conserved))
        team.run(
            self.fluid_kernels.cover, blocks.local_count, self._kinds, self._occupied.device, self.fluid.device_state,
            lost, self.cover_radius, volume, position, *bins, self._shape, self._widths, self._origin, self._extent,
        )  # fmt: skip
        self._ledger["covered"] -= team.download(lost) * self._cell_volume
        self._exchange(self.kind.device, np.array([-1]), kinds.COVERED)
        self._list_cells()
        n = self._covered.shape[0]
        self._velocity, self._inertia = team.empty((n, D), self._real), team.empty(n)
        self._passed = team.zeros((n, self.model.conserved))
        team.run(
            self.kernels.find_wall_velocity, n, self._covered, self._velocity, self._inertia, self.reach, momentum,
            position, *bins, self._shape, self._widths, self._origin,
        )  # fmt: skip

    def merge(self, stage: Stage) -> None:
        """Collective. Give the covered cells of the stage's input, and before the first stage the fresh ones, their
        states (Eqs. 31, 32)."""
        self.fluid.exchange_ghosts(stage)
        U, k = self.fluid.input_of(stage), self.fluid_kernels
        self.fluid.wake(self._occupied.host() > 0)
        around = (self._kinds, self._shape, self._offsets, self._weights, self._rings, self._rest)
        self._input = U
        self._run(k.fill_covered, self._covered, self._velocity, U, *around)
        self._run(k.fill_deep, self._deep, U, self._shape, self._rest)
        if stage.number == 0:
            self._run(k.fill_fresh, self._fresh, U, *around)
            content = self.team.empty((self._fresh.shape[0], self.model.conserved))
            self._run(k.find_contents, self._fresh, U, self._shape, content)
            self._ledger["fresh"] += self._per_block(kinds.FRESH_CELLS, content) * self._cell_volume

    def apply_wall_fluxes(self, stage: Stage, dt: float) -> None:
        """Add up what has crossed the wall in a stage of a step of `dt` [s], with the fluxes of that stage (Eqs. 33,
        35)."""
        weights = self.team.array(stage.weight * dt * self._cell_volume / self._spacing)
        rates = self._upload(self.fluid.rates(dt)[: self._dimensions])
        rest = (self._input, self._kinds, self._shape, self._steps, rates, weights)
        self._run(self.fluid_kernels.collect_wall, self._covered, self._passed, *rest)
        self._run(self.fluid_kernels.collect_sides, *self._sides, self._through_sides.device, *rest)

    def redistribute(self) -> None:
        """No cell shares its content with others."""

    def transfer_impulse(self, dt: float) -> Any:
        """Collective. Impulse (own, D) [N s] of the fluid on this rank's particles in the step of `dt` [s], on the
        device."""
        D, own, team = self._dimensions, self.solid.count, self.team
        wall = (self._covered, self._passed, self._velocity, self._inertia)
        self._run(self.fluid_kernels.spread, *wall, self._kick, self._shape)
        self._exchange(self._kick, np.arange(D), 0.0)
        impulse, gained, image = team.empty((own, D)), team.empty((own, D)), team.array(np.ones((own, D)))
        start, grid, home = self.solid.start, (self._lower, self._widths), team.empty(own, np.int64)
        team.run(self.kernels.find_homes, own, start, home, *grid, *self._homes, self.blocks.first)
        team.run(
            self.kernels.gather_kicks, own, team.array(np.arange(own)), start, home, image, gained, self.reach,
            self._kinds, kinds.COVERED, self._kick, self._shape, *grid, self._origin, self._extent, self._seen_cells,
            self._homes[0],
        )  # fmt: skip
        team.run(self.kernels.push, own, *self.solid.columns.read("mass"), gained, impulse)
        self._run(self.kernels.clear, self._covered, D, self._kick.reshape(-1), self._shape)
        self._ledger["wall"] -= self._per_block(kinds.COVERED_CELLS, self._passed)
        return impulse

    def account_work(self, excess: Any) -> None:
        """Enter what the solid has received, after solid.apply_impulse()."""
        D, P = self._dimensions, self.model.phases
        self._ledger["wall"][:, P : P + D] += self.solid.given.sum(axis=1)
        self._ledger["wall"][:, -1] += self.solid.work

    # ---- parts of it ------------------------------------------------------------------------------------------------

    def _list_cells(self) -> None:
        """The covered cells that fluxes see, those that they do not, and the fresh ones, block by block."""
        team, count = self.team, self.blocks.local_count
        counts = team.empty((count, 3), np.int64)
        place = (self._kinds, self._occupied.read, self._shape, self._extent)
        team.run(self.kernels.find_depth, count, *place, self._offsets, counts)
        self._counts = team.download(counts)
        first = team.array(np.cumsum(self._counts, axis=0) - self._counts)
        lists = [team.empty(n, np.int64) for n in self._counts.sum(axis=0)]
        team.run(self.kernels.list_cells, count, *place, first, *lists)
        self._covered, self._deep, self._fresh = lists

    @property
    def _kinds(self) -> Any:
        return self.kind.device.reshape(-1)

    def _run(self, kernel: Any, cells: Any, *arguments: Any) -> None:
        self.team.run(kernel, cells.shape[0], cells, *arguments)

    def _exchange(self, field: np.ndarray, mirror: np.ndarray, inflow: float) -> None:
        self.exchange.start(field, mirror, np.full((3, 2, field.shape[1]), inflow))
        self.exchange.finish()

    def _per_block(self, cells: int, values: Any) -> np.ndarray:
        """Sums (local blocks, k) of `values` (n, k) on the device, of the cells of a column of the counts."""
        return Groups(self.team, self.kernels, self._counts[:, cells]).sums(values)

    # ---- looking at it ----------------------------------------------------------------------------------------------

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether the solid covers a cell, ghosts included."""
        return self.kind.host()[:, 0] >= kinds.COVERED

    def trapped(self) -> np.ndarray:
        """Mass [kg] of each phase that is shut in: none."""
        return np.zeros(self.model.phases)

    def memory(self) -> int:
        """Bytes of this rank's fields."""
        return self.kind.nbytes * (1 + self._dimensions * 8)

    def workload(self) -> np.ndarray:
        """(local blocks,) covered cells that fluxes see."""
        return self._counts[:, kinds.COVERED_CELLS].astype(float)

    @property
    def volume(self) -> np.ndarray:
        """(local blocks, Z, Y, X) the part of each cell that fluid fills: all or nothing."""
        return np.where(self.covered, 0.0, 1.0)

    def snapshot(self) -> Snapshot:
        """What a restart needs: which cells are covered, so that those are known that come free; and the books."""
        return {
            "cells": {"kind": self.blocks.without_ghosts(self.kind.host())},
            "sums": {**self._ledger, "sides": self._through_sides.host()},
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self.blocks.without_ghosts(self.kind.host())[:] = snapshot["cells"]["kind"]
        self._occupied.host()[:] = 1
        for cause, amounts in {**self._ledger, "sides": self._through_sides.host()}.items():
            amounts[:] = snapshot["sums"][cause]
        for pair in (self.kind, self._occupied, self._through_sides):
            pair.changed()

    def ledger(self) -> dict[str, np.ndarray]:
        """Collective. Masses, momentum and energy (conserved,) that the coupling has created so far, per cause."""
        count, through = self.blocks.local_count, self._through_sides.host()
        sides = np.stack([np.bincount(self._side_blocks, amounts, count) for amounts in through.T], axis=1)
        totals = self.blocks.sum(np.hstack([*self._ledger.values(), sides]))
        return dict(zip(self.causes, np.split(totals, len(self.causes)), strict=True))
