"""Fluid and solid together: an immersed boundary made of particles (paper, Eqs. 31-35 made consistent)."""

from __future__ import annotations

from itertools import product

import numpy as np

from distfsi.device.seam import Device, Pair
from distfsi.kernels import coupling as kernels
from distfsi.kernels.regions import copy_regions
from distfsi.mesh.blocks import GHOSTS, Blocks, Snapshot
from distfsi.mesh.exchange import GhostExchange
from distfsi.parts import search
from distfsi.parts.fluid import Fluid, Stage
from distfsi.parts.initial import InitialState
from distfsi.parts.solid import Solid
from distfsi.scene.description import Scene

COVER_RADIUS = 1.5  # in cells, of the kernel that decides what is covered; at least three particle spacings
VELOCITY_RADIUS = 1.4  # in cover radii, of the kernel between particles and cells; at most the ghost cells allow
PARTICLE_DRIVERS = (
    *search.DRIVERS,
    kernels.find_depth,
    kernels.list_cells,
    kernels.find_wall_velocity,
    kernels.push,
)
FLUID_DRIVERS = (
    kernels.cover,
    kernels.fill_covered,
    kernels.fill_fresh,
    kernels.fill_deep,
    kernels.collect_wall,
    kernels.collect_sides,
    kernels.spread,
)


class Coupling:
    """What the solid covers of the fluid's grid, the state of the covered cells, and the forces across the wall.

    reach   [m]: how far the solid's ghosts and images must go
    sub_steps, stray  the most sub-steps of the solid, and how far its particles may go in them [m]: there are none
    causes  of what the coupling creates: "wall" (what the solid receives less what the fluid loses there),
            "covered" and "fresh" cells, "sides" (what the fluid counts as having left the domain at covered cells)
    """

    causes = ("wall", "covered", "fresh", "sides")
    sub_steps, stray = 1, 0.0

    def __init__(self, scene: Scene, model, fluid: Fluid, solid: Solid, blocks: Blocks, team: Device):
        """Collective. Prepares the solid and classifies the cells, so that `covered` is known from the start on."""
        self.model, self.fluid, self.solid, self.blocks, self.team = model, fluid, solid, blocks, team
        grid, self._dimensions = blocks.grid, blocks.grid.dimensions
        self.kernels = team.build(PARTICLE_DRIVERS, {"DIMENSIONS": grid.dimensions})
        self.fluid_kernels = team.build(FLUID_DRIVERS, model.constants, model.bindings, scene.fluid.precision)
        self.exchange = GhostExchange(blocks, team, team.build([copy_regions], {}).copy_regions)

        h = min(scene.domain.spacing)
        self.cover_radius = COVER_RADIUS * max(h, 2.0 * max(body.spacing for body in scene.solid.bodies))
        self.reach = min(VELOCITY_RADIUS * self.cover_radius, (GHOSTS + 0.5) * h)
        self._lower, self._upper, self._spacing = (np.array(a) for a in (grid.lower, grid.upper, grid.spacing))
        self._shape = np.array(blocks.shape)
        D = grid.dimensions
        self._cells = search.CellSort(self.kernels, team, self._lower[:D], self._upper[:D])
        self._cell_volume = float(self._spacing.prod())
        self._rest = self._state_at_rest(scene)
        self._find_neighbourhood()
        self._find_sides()

        self.kind = Pair(team, np.full((blocks.local_count, 1, *blocks.shape), kernels.UNKNOWN, np.uint8))
        self._kinds = self.kind.there.reshape(-1)
        self._occupied = np.ones(blocks.local_count, dtype=np.uint8)
        self._kick = blocks.allocate(grid.dimensions)
        self._ledger = {cause: np.zeros((blocks.local_count, model.conserved)) for cause in self.causes[:-1]}
        solid.prepare(self.reach)
        self.follow()

    def _state_at_rest(self, scene: Scene) -> np.ndarray:
        """Primitive state (variables,) of the first region without its velocity."""
        state = InitialState(scene.fluid, self.model).of(scene.fluid.regions[0].state)
        rest = np.array(self.model.formula("primitives")(state), dtype=scene.fluid.precision)
        rest[self.model.phases : self.model.phases + self._dimensions] = 0.0
        return rest

    def _find_neighbourhood(self) -> None:
        """Places of the cells around a cell, ring by ring, and their weights in Eq. 32: 1/distance^2."""
        D = self._dimensions
        around = np.array([o for o in product(range(-GHOSTS, GHOSTS + 1), repeat=D) if any(o)])
        ring = np.abs(around).max(axis=1)
        around = around[np.argsort(ring, kind="stable")]
        self._steps = np.array([1, self._shape[2], self._shape[2] * self._shape[1]])
        self._offsets = around @ self._steps[:D]
        self._weights = (1.0 / ((around * self._spacing[:D]) ** 2).sum(axis=1)).astype(self._rest.dtype)
        self._rings = np.searchsorted(np.sort(ring), np.arange(1, GHOSTS + 2))

    def _find_sides(self) -> None:
        """This rank's cells at the domain's sides, periodic ones apart, and which sides; and the range of cells that
        particles see: the grid and its images at symmetry planes."""
        grid, blocks = self.blocks.grid, self.blocks
        cells = np.arange(self.blocks.local_count * self._shape.prod()).reshape(-1, *blocks.shape)
        places, sides = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for block, (origin, extent) in enumerate(zip(blocks.origin, blocks.extent, strict=True)):
            inner = (slice(g, g + n) for g, n in zip(grid.ghosts[::-1], extent[::-1], strict=True))
            active = cells[(block, *inner)]
            for axis, side in product(range(grid.dimensions), (0, 1)):
                at_end = origin[axis] + side * extent[axis] == side * grid.cells[axis]
                if at_end and grid.boundaries[axis][side] != "periodic":
                    places.append(active.take(-side, axis=2 - axis).ravel())
                    sides.append(np.full(len(places[-1]), 2 * axis + side))
        self._side_cells, self._side = np.concatenate(places), np.concatenate(sides)
        self._through_sides = np.zeros((len(self._side), self.model.conserved))
        images = GHOSTS * (np.array(grid.boundaries) == "symmetry")
        self._seen_cells = np.column_stack([-images[:, 0], grid.cells + images[:, 1]])

    # ---- one step ---------------------------------------------------------------------------------------------------

    def time_step(self) -> float:
        """Longest step [s] that the coupling allows: any."""
        return np.inf

    def follow(self) -> None:
        """Collective. Find the covered cells, and the velocity of the wall in those that fluxes see."""
        around, blocks, D = self.solid.around, self.blocks, self._dimensions
        position, mass = around["position"], around["mass"]
        _, bins = self._cells.sort(position, around["key"], self._spacing[:D].min())
        lost = np.zeros_like(self._ledger["covered"])
        self.team.run(
            self.fluid_kernels.cover, blocks.local_count, self._kinds, self._occupied, self.fluid.state, lost,
            self.cover_radius, (mass / around["density"])[:, None], position, *bins,
            self._shape, self._spacing, blocks.origin, blocks.extent,
        )  # fmt: skip
        self._ledger["covered"] -= lost * self._cell_volume
        self._exchange(self.kind.there, np.array([-1]), kernels.COVERED)
        self._list_cells()
        n = len(self._covered)
        self._velocity, self._inertia = np.empty((n, D), self._rest.dtype), np.empty(n)
        self._passed = np.zeros((n, self.model.conserved))
        self.team.run(
            self.kernels.find_wall_velocity, n, self._covered, self._velocity, self._inertia,
            self.reach, np.column_stack([mass, mass[:, None] * around["velocity"]]), position, *bins,
            self._shape, self._spacing, blocks.origin,
        )  # fmt: skip

    def before_stage(self, stage: Stage) -> None:
        """Collective. Give the covered cells of the stage's input, and before the first stage the fresh ones, their
        states (Eqs. 31, 32)."""
        self.fluid.exchange_ghosts(stage)
        U, run, k = self.fluid.input_of(stage), self.team.run, self.fluid_kernels
        self.fluid.wake(self._occupied > 0)
        around = (self._kinds, self._shape, self._offsets, self._weights, self._rings, self._rest)
        self._input = U
        run(k.fill_covered, len(self._covered), self._covered, self._velocity, U, *around)
        run(k.fill_deep, len(self._deep), self._deep, U, self._shape, self._rest)
        if stage.number == 0 and len(self._fresh):
            run(k.fill_fresh, len(self._fresh), self._fresh, U, *around)
            block, cell = self._in_block(self._fresh)
            content = U.reshape(*U.shape[:2], -1)[block, : self.model.conserved, cell]
            self._ledger["fresh"] += self._per_block(block, content * self._cell_volume)

    def after_stage(self, stage: Stage, dt: float) -> None:
        """Add up what has crossed the wall in a stage of a step of `dt` [s], with the fluxes of that stage (Eqs. 33,
        35)."""
        weights = stage.weight * dt * self._cell_volume / self._spacing
        rates = np.array(self.fluid.rates(dt)[: self._dimensions])
        rest = (self._input, self._kinds, self._shape, self._steps, rates, weights)
        run, k = self.team.run, self.fluid_kernels
        run(k.collect_wall, len(self._covered), self._covered, self._passed, *rest)
        run(k.collect_sides, len(self._side), self._side_cells, self._side, self._through_sides, *rest)

    def impulse(self) -> np.ndarray:
        """Collective. Impulse (own, D) [N s] of the fluid on this rank's particles in the step."""
        D, P, blocks, grid = self._dimensions, self.model.phases, self.blocks, self.blocks.grid
        run, (block, cell) = self.team.run, self._in_block(self._covered)
        wall = (self._covered, self._passed, self._velocity, self._inertia)
        run(self.fluid_kernels.spread, len(block), *wall, self._kick, self._shape)
        self._exchange(self._kick, np.arange(D), 0.0)
        start, mass = self.solid.start, self.solid.columns["mass"]
        impulse, home = np.empty_like(start), np.empty(len(mass), dtype=np.int64)
        run(
            self.kernels.push, len(home), start, mass, impulse, home, self.reach, self._kick,
            self._shape, self._lower, self._spacing, blocks.origin, blocks.extent, self._seen_cells,
            np.array(grid.cells), np.array(blocks.block_cells), blocks.curve_index, blocks.first,
        )  # fmt: skip
        self._kick.reshape(-1, D, self._shape.prod())[block, :, cell] = 0.0
        self._ledger["wall"] -= self._per_block(block, self._passed)
        self._ledger["wall"][:, P : P + D] += self._per_block(home, impulse)
        return impulse

    def book_work(self, excess: np.ndarray) -> None:
        """Enter the work of the impulse on the solid, after solid.push()."""
        self._ledger["wall"][:, -1] += self.solid.work

    # ---- parts of it ------------------------------------------------------------------------------------------------

    def _list_cells(self) -> None:
        """The covered cells that fluxes see, those that they do not, and the fresh ones, block by block."""
        blocks, count = self.blocks, self.blocks.local_count
        counts = np.zeros((count, 3), dtype=np.int64)
        place = (self._kinds, self._occupied, self._shape, blocks.extent)
        self.team.run(self.kernels.find_depth, count, *place, self._offsets, counts)
        first = np.cumsum(counts, axis=0) - counts
        lists = [np.empty(n, dtype=np.int64) for n in counts.sum(axis=0)]
        self.team.run(self.kernels.list_cells, count, *place, first, *lists)
        self._covered, self._deep, self._fresh = lists

    def _exchange(self, field: np.ndarray, mirror: np.ndarray, inflow: float) -> None:
        self.exchange.start(field, mirror, np.full((3, 2, field.shape[1]), inflow))
        self.exchange.finish()

    def _in_block(self, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Local block of each cell of a list, and its place in the block."""
        return np.divmod(cells, self._shape.prod())

    def _per_block(self, block: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Sums (local blocks, k) of `values` (n, k) in the blocks (n,)."""
        return np.stack([np.bincount(block, v, minlength=self.blocks.local_count) for v in values.T], axis=1)

    # ---- looking at it ----------------------------------------------------------------------------------------------

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether the solid covers a cell, ghosts included."""
        return self.kind.here()[:, 0] >= kernels.COVERED

    def memory(self) -> int:
        """Bytes of this rank's fields."""
        return self.kind.nbytes + self._kick.nbytes

    def workload(self) -> np.ndarray:
        """(local blocks,) covered cells that fluxes see."""
        return np.bincount(self._in_block(self._covered)[0], minlength=self.blocks.local_count).astype(float)

    @property
    def volume(self) -> np.ndarray:
        """(local blocks, Z, Y, X) the part of each cell that fluid fills: all or nothing."""
        return np.where(self.covered, 0.0, 1.0)

    def snapshot(self) -> Snapshot:
        """What a restart needs: which cells are covered, so that those are known that come free; and the books."""
        return {
            "cells": {"kind": self.blocks.without_ghosts(self.kind.here())},
            "sums": {**self._ledger, "sides": self._through_sides},
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self.blocks.without_ghosts(self.kind.here())[:] = snapshot["cells"]["kind"]
        self._occupied[:] = 1
        for cause, amounts in {**self._ledger, "sides": self._through_sides}.items():
            amounts[:] = snapshot["sums"][cause]

    def ledger(self) -> dict[str, np.ndarray]:
        """Collective. Masses, momentum and energy (conserved,) that the coupling has created so far, per cause."""
        sides = self._per_block(self._in_block(self._side_cells)[0], self._through_sides)
        totals = self.blocks.sum(np.hstack([*self._ledger.values(), sides]))
        return dict(zip(self.causes, np.split(totals, len(self.causes)), strict=True))
