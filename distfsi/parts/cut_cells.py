"""Fluid and solid together: cells that the wall cuts, with the volume that their fluid has swept (docs/theory.md)."""

from __future__ import annotations

from itertools import product

import numpy as np

from distfsi.device.seam import Device, Pair
from distfsi.kernels import coupling as immersed_kernels
from distfsi.kernels import cut_cells as kernels
from distfsi.kernels import cut_forces
from distfsi.kernels.cut_geometry import SHUT
from distfsi.kernels.particles import EXCHANGE
from distfsi.kernels.regions import copy_regions
from distfsi.mesh.blocks import GHOSTS, Blocks, Snapshot
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.particles import GhostPlan, ParticleExchange
from distfsi.parts.fluid import Fluid, Stage
from distfsi.parts.initial import InitialState
from distfsi.parts.solid import Solid
from distfsi.parts.wall_geometry import WallGeometry
from distfsi.parts.wall_points import wall_points
from distfsi.scene.description import Scene

MIRRORS = ("symmetry", "wall", "outflow", "inflow")
LARGEST_MOVE = 0.45  # of a cell in a step, before the forces between particles change its speed
PARTICLE_DRIVERS = (cut_forces.see_particles, cut_forces.find_debts, immersed_kernels.push)
FLUID_DRIVERS = (
    kernels.take_contents,
    kernels.evict,
    kernels.put_moved,
    kernels.mix,
    kernels.put_mixed,
    kernels.put_rest,
    kernels.find_walls,
    kernels.advance_band,
    kernels.exchange_volumes,
    kernels.book_sides,
    cut_forces.spread_impulse,
    cut_forces.pay_debts,
)


class CutCells:
    """Conservative coupling: the wall cuts cells, and fluid neither is made nor passes through bodies.

    reach   [m]: how far the solid's ghosts must go for its own sake: not at all
    kind    field (local blocks, 1, Z, Y, X): COVERED where a cell holds no fluid
    causes  of what the coupling creates: "wall" (what the solid receives less what the fluid gives; bodies that touch
            an end of the domain push against it), "sides" (what the fluid counts as having left the domain beside
            them, and has not)
    """

    causes = ("wall", "sides")
    reach = 0.0

    def __init__(self, scene: Scene, model, fluid: Fluid, solid: Solid, blocks: Blocks, team: Device):
        """Collective. Cuts the cells and fills them with the fluid on their open side."""
        self.model, self.fluid, self.solid, self.blocks, self.team = model, fluid, solid, blocks, team
        grid, self._dimensions = blocks.grid, blocks.grid.dimensions
        real = np.dtype(scene.fluid.precision).type
        self.wall = WallGeometry(blocks, team, max(body.spacing for body in scene.solid.bodies), real)
        self.kernels = team.build(PARTICLE_DRIVERS, {"DIMENSIONS": grid.dimensions})
        self.fluid_kernels = team.build(FLUID_DRIVERS, model.constants, model.bindings, scene.fluid.precision)
        self.exchange = GhostExchange(blocks, team, team.build([copy_regions], {}).copy_regions)
        self._particles = ParticleExchange(blocks, team, team.build(EXCHANGE, {"DIMENSIONS": grid.dimensions}))
        self._lower, self._spacing = np.array(grid.lower), np.array(grid.spacing)
        self._cell_volume = float(self._spacing.prod())
        self._initial = InitialState(scene.fluid, model)
        self._rest = self._state_at_rest(scene)

        self.kind = blocks.allocate(1, np.uint8)
        self.swept = np.ones((blocks.local_count, 3 if model.phases == 2 else 1, *blocks.shape), real)
        fluid.volumes = Pair(team, self.swept)
        self._master = blocks.allocate(grid.dimensions, np.int8)
        self._kick, self._debt = blocks.allocate(grid.dimensions), blocks.allocate(1)
        self._band = np.empty(0, dtype=np.int64)
        self._wall_sums = np.zeros((blocks.local_count, model.conserved))
        self._find_sides()
        c = solid.columns
        self._cut(c["position"], np.zeros_like(c["velocity"]))
        self._cut(c["position"], np.zeros_like(c["velocity"]))
        self._fill_at_start()

    def _state_at_rest(self, scene: Scene) -> np.ndarray:
        """Conserved state (variables,) of the first region without its velocity."""
        state = self._initial.of(scene.fluid.regions[0].state)
        rest = np.array(self.model.formula("primitives")(state))
        rest[self.model.phases : self.model.phases + self._dimensions] = 0.0
        return np.array(self.model.formula("conserved")(tuple(rest)), dtype=scene.fluid.precision)

    def _fill_at_start(self) -> None:
        """Cut cells hold the state at the middle of their open corners; fluid fills what is open."""
        self.swept[:, 0] = self.wall.fractions[1][:, 0]
        for block in range(self.blocks.local_count):
            (x, y, z), middles = (a.T for a in self.wall.cut_cells(block))
            self.fluid.state[block][:, z, y, x] = self._initial.at(middles.T)
        self.kind[:] = np.where(self.swept[:, :1] > 0.0, immersed_kernels.FLUID, immersed_kernels.COVERED)
        self.swept[:, 1:] = 0.0
        covered = self.kind[:, 0] == immersed_kernels.COVERED
        np.moveaxis(self.fluid.state, 1, -1)[covered] = self._rest
        self._exchange_swept()

    def _find_sides(self) -> None:
        """This rank's cells at the domain's sides, and which sides; and the range of cells that particles see: the grid
        and its images at all sides."""
        grid, blocks = self.blocks.grid, self.blocks
        cells = np.arange(blocks.local_count * np.prod(blocks.shape)).reshape(-1, *blocks.shape)
        places, sides = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for block, (origin, extent) in enumerate(zip(blocks.origin, blocks.extent, strict=True)):
            active = self.fluid.active(cells, block)
            for axis, side in product(range(grid.dimensions), (0, 1)):
                if origin[axis] + side * extent[axis] == side * grid.cells[axis]:
                    places.append(active.take(-side, axis=2 - axis).ravel())
                    sides.append(np.full(len(places[-1]), 2 * axis + side))
        self._side_cells, self._side = np.concatenate(places), np.concatenate(sides)
        self._side_blocks = self._side_cells // int(self.wall.shape.prod())
        self._through_sides = np.zeros((len(self._side), self.model.conserved))
        images = GHOSTS * (np.arange(3) < grid.dimensions)
        self._seen_cells = np.column_stack([-images, grid.cells + images])

    # ---- one step ---------------------------------------------------------------------------------------------------

    def time_step(self) -> float:
        """Longest step [s] in which no particle of this rank crosses more than half a cell."""
        speed = np.abs(self.solid.columns["velocity"]).max(initial=0.0)
        return LARGEST_MOVE * float(self._spacing[: self._dimensions].min()) / max(speed, 1e-300)

    def follow(self) -> None:
        """Collective, after solid.advance(). Cut the cells where the particles are now, and find the moving wall."""
        c, D = self.solid.columns, self._dimensions
        self._cut(self.solid.start, c["velocity"])
        self._find_company()
        n = len(self._band)
        self._area, self._velocity = np.empty((2, n, D))
        self._inertia, self._start_volume = np.empty((2, n))
        self._impulse, self._work = np.zeros((n, D)), np.zeros(n)
        self._run(self.fluid_kernels.find_walls, self._area, *self._walls, self._spacing)
        self._see(self._particle_velocity, self._velocity)

    def before_stage(self, stage: Stage) -> None:
        """Collective. Mix what belongs together in the stage's input, and leave it as states."""
        U, first = self.fluid.input_of(stage), stage.number == 0
        self._mix(U, self.wall.parts[0 if first else 1])
        if first:
            block, cell = self._places()
            self._start_volume[:] = self.swept.reshape(*self.swept.shape[:2], self.wall.shape.prod())[block, 0, cell]
        self.fluid.wake(self.wall.near > 0)
        self._start, self._input, self._output = self.fluid.state, U, self.fluid.output_of(stage)

    def after_stage(self, stage: Stage, dt: float) -> None:
        """Advance the cells of the band in the place of the fluid's stage, of a step of `dt` [s]."""
        rates, weight = np.array(self.fluid.rates(dt)[: len(self._spacing)]), stage.weight * dt
        self._run(
            self.fluid_kernels.advance_band, self._start, self._input, self._output, self.swept.reshape(-1),
            self._start_volume, self._area, self._velocity, self._impulse, self._work, *self._walls, rates,
            stage.b, dt, weight,
        )  # fmt: skip
        near = np.flatnonzero(self.wall.is_band(self._side_cells))
        self.team.run(
            self.fluid_kernels.book_sides, len(near), near, self._side_cells, self._side, self._through_sides,
            self._input, *self._walls, rates, weight * self._cell_volume / self._spacing,
        )  # fmt: skip
        if stage is self.fluid.stages[-1]:
            self._settle()

    def _settle(self) -> None:
        """Mix what the last stage left, and exchange volumes so that they stay near the geometric ones."""
        U, after = self.fluid.state, self.wall.parts[1]
        self._mix(U, after)
        uneven = np.concatenate([self._band, self._loose])
        mixed = np.empty((len(uneven), self.model.variables + 1), U.dtype)
        for _ in range(2):
            self._exchange_state(U)
            self._exchange_swept()
            self.team.run(
                self.fluid_kernels.exchange_volumes, len(uneven), uneven, mixed, U, self.swept.reshape(-1),
                self.kind.reshape(-1), after, *self.wall.faces, self.wall.steps, self.wall.shape, self.blocks.origin,
                self.wall.cells,
            )  # fmt: skip
            self.team.run(
                self.fluid_kernels.put_mixed, len(uneven), uneven, mixed, U, self.swept.reshape(-1), self.wall.shape
            )  # fmt: skip
        self._exchange_swept()

    def impulse(self) -> np.ndarray:
        """Collective. Impulse (own, D) [N s] of the fluid on this rank's particles in the step."""
        D, P, blocks = self._dimensions, self.model.phases, self.blocks
        impulse = self._impulse * self._cell_volume
        self._run(self.fluid_kernels.spread_impulse, impulse, self._inertia, self._kick, self.wall.shape)
        self._exchange(self._kick, np.arange(D), 0.0)
        start, mass = self.solid.start, self._own_mass
        given, home = np.empty_like(start), np.empty(len(start), dtype=np.int64)
        self.team.run(
            self.kernels.push, len(home), start, mass, given, home, self.wall.seen, self._kick, self.wall.shape,
            self._lower, self._spacing, blocks.origin, blocks.extent, self._seen_cells, self.wall.cells,
            np.array(blocks.block_cells), blocks.curve_index, blocks.first,
        )  # fmt: skip
        block, cell = self._places()
        self._kick.reshape(-1, D, self.wall.shape.prod())[block, :, cell] = 0.0
        self._wall_sums[:, P : P + D] += self._per_block(home, given) - self._per_block(block, impulse)
        self._wall_sums[:, -1] -= self._per_block(block, self._work[:, None] * self._cell_volume)[:, 0]
        return given

    def book_work(self, gain: np.ndarray) -> None:
        """Collective, after solid.push(), which gave particles `gain` (own, D) [m/s]: the fluid pays for it."""
        (velocity,) = self._plan.exchange([(gain, tuple((a,) for a in range(self._dimensions)))])
        mean = np.empty_like(self._velocity)
        self._see(velocity, mean)
        band, debt, paid = self._band, self._debt.reshape(-1), np.zeros(len(self._band))
        self.team.run(self.kernels.find_debts, len(band), band, debt, self._impulse, mean)
        self._exchange(self._debt, np.array([-1]), 0.0)
        self._run(
            self.fluid_kernels.pay_debts, paid, debt, self.fluid.state, self.swept.reshape(-1),
            self._master.reshape(-1), self.wall.offsets, self.wall.steps, self.wall.shape, self.blocks.origin,
            self.wall.cells,
        )  # fmt: skip
        debt[band] = 0.0
        self._wall_sums[:, -1] -= self._per_block(self._places()[0], paid[:, None] * self._cell_volume)[:, 0]
        self._wall_sums[:, -1] += self.solid.work

    # ---- parts of it ------------------------------------------------------------------------------------------------

    def _cut(self, start: np.ndarray, velocity: np.ndarray) -> None:
        """The cells cut by this rank's particles and those around, which have moved from `start` with `velocity`."""
        c, D, wall = self.solid.columns, self._dimensions, self.wall
        vector = tuple((a,) for a in range(D))
        self._own_mass = np.where(self._part_inside(start, c["mass"] / c["density"]) > 0.0, c["mass"], 0.0)
        point, volume, number = wall_points(c, float(self._spacing[:D].max()))
        volume = volume * self._part_inside(point, volume)
        self._plan = self._ghosts(start, c["id"])
        self._particle_start, self._particle_velocity, self._mass = self._plan.exchange(
            [(start, "position"), (velocity, vector), (self._own_mass, ((),))]
        )
        self._start_bins = wall.sort(self._particle_start, self._plan.key.there)
        plan = self._plan if number is c["id"] else self._ghosts(point, number)
        position, volume = plan.exchange([(point, "position"), (volume, ((),))])
        volume, bins = volume[:, None], wall.sort(position, plan.key.there)
        (filled,) = plan.exchange([(wall.fill(plan.own, position, volume, bins), ((),))])
        (ball,) = plan.exchange([(wall.thicken(plan.own, filled, position, volume, bins), ((),))])
        wall.cut(position, volume, ball, bins)

    def _ghosts(self, position: np.ndarray, id: np.ndarray) -> GhostPlan:
        """Collective. Who needs copies of which particles or points."""
        images = self.wall.search + 0.5 * self._spacing[: self._dimensions].max()
        return self._particles.ghosts(position, id, self.wall.reach, image_reach=images, mirrors=MIRRORS)

    def _part_inside(self, position: np.ndarray, volume: np.ndarray) -> np.ndarray:
        """Part (n,) of the cubes of `volume` (n,) around the positions (n, D) that is in the domain."""
        grid, D = self.blocks.grid, self._dimensions
        side = np.maximum(volume, 1e-300)[:, None] ** (1.0 / D)
        depth = np.minimum(position - grid.lower[:D], np.array(grid.upper[:D]) - position)
        return np.clip(0.5 + depth / side, 0.0, 1.0).prod(axis=1)

    def _find_company(self) -> None:
        """Which cells join which, and the lists of the band's, the covered and the loose cells."""
        self.wall.find_masters(self.kind, self._master, self.swept)
        self._exchange(self.kind, np.array([-1]), immersed_kernels.FLUID)
        self.wall.find_refuges(self.kind, self._master)
        self._exchange(self._master, np.arange(self._dimensions), 0)
        self._band, self._covered, self._loose = self.wall.lists(self.kind, self.swept)
        self._evict()

    def _evict(self) -> None:
        """Collective. States of the band become contents; those of cells that are shut move, and these are covered."""
        U, swept, shape, k = self.fluid.state, self.swept.reshape(-1), self.wall.shape, self.fluid_kernels
        self._run(k.take_contents, U, swept, shape)
        self._exchange_state(U)
        self._exchange_swept()
        moved = np.empty((len(self._band), self.model.variables + 3), U.dtype)
        self._run(
            k.evict, moved, U, swept, self.kind.reshape(-1), self.wall.parts[0], self._master.reshape(-1),
            self.wall.steps, shape,
        )  # fmt: skip
        self._run(k.put_moved, moved, U, swept, shape)
        left = (self.kind == SHUT) & (self._master != 0).any(axis=1, keepdims=True)
        self.kind[left] = immersed_kernels.COVERED
        self._master[np.broadcast_to(left, self._master.shape)] = 0
        self._band, self._covered, self._loose = self.wall.lists(self.kind, self.swept)

    def _see(self, velocity: np.ndarray, mean: np.ndarray) -> None:
        """mean (band, D) of particles' velocities around the cells, where the particles were when the step began."""
        momentum = np.column_stack([self._mass, self._mass[:, None] * velocity])
        self._run(
            self.kernels.see_particles, self._area, mean, self._inertia, self.wall.seen, momentum,
            self._particle_start, *self._start_bins, self.wall.shape, self._spacing, self.blocks.origin,
        )  # fmt: skip

    def _mix(self, U: np.ndarray, fraction: np.ndarray) -> None:
        """Contents of the band become states of what belongs together; covered cells rest."""
        self._exchange_state(U)
        self._exchange_swept()
        swept, shape, k = self.swept.reshape(-1), self.wall.shape, self.fluid_kernels
        mixed = np.empty((len(self._band), self.model.variables + 1), U.dtype)
        self._run(
            k.mix, mixed, U, swept, fraction, self._master.reshape(-1), self.wall.offsets, self.wall.steps, shape,
            self.blocks.origin, self.wall.cells,
        )  # fmt: skip
        self._run(k.put_mixed, mixed, U, swept, shape)
        self.team.run(k.put_rest, len(self._covered), self._covered, U, swept, self._rest, shape)

    def _run(self, kernel, *arguments) -> None:
        self.team.run(kernel, len(self._band), self._band, *arguments)

    @property
    def _walls(self) -> tuple[np.ndarray, ...]:
        """What decides how open a face is."""
        return self.kind.reshape(-1), *self.wall.faces, self.wall.shape, self.wall.steps

    def _exchange(self, field: np.ndarray, mirror: np.ndarray, inflow: float) -> None:
        self.exchange.start(field, mirror, np.full((3, 2, field.shape[1]), inflow))
        self.exchange.finish()

    def _exchange_state(self, U: np.ndarray) -> None:
        self.exchange.start(U, self.model.mirror, self.fluid.inflow)
        self.exchange.finish()

    def _exchange_swept(self) -> None:
        self._exchange(self.swept, np.full(self.swept.shape[1], -1), 1.0)

    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Local block of each cell of the band, and its place in the block."""
        return np.divmod(self._band, self.wall.shape.prod())

    def _per_block(self, block: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Sums (local blocks, k) of `values` (n, k) in the blocks (n,)."""
        return np.stack([np.bincount(block, v, minlength=self.blocks.local_count) for v in values.T], axis=1)

    # ---- looking at it ----------------------------------------------------------------------------------------------

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether a cell holds no fluid, ghosts included."""
        return self.swept[:, 0] <= 0.0

    @property
    def volume(self) -> np.ndarray:
        """(local blocks, Z, Y, X) the part of each cell that its fluid fills."""
        return self.swept[:, 0]

    def memory(self) -> int:
        """Bytes of this rank's fields, the corners' as if they were as many as cells."""
        fields = (
            self.kind,
            self.swept,
            self._master,
            self._kick,
            self._debt,
            *self.wall.fractions,
            *self.wall.apertures,
        )
        return sum(field.nbytes for field in fields) + self._debt.nbytes

    def workload(self) -> np.ndarray:
        """(local blocks,) cells in the band around the wall."""
        return np.bincount(self._places()[0], minlength=self.blocks.local_count).astype(float)

    def snapshot(self) -> Snapshot:
        """What a restart needs: the volumes, and the books."""
        return {
            "cells": {"swept": self.blocks.without_ghosts(self.swept[:, :1])},
            "sums": {"wall": self._wall_sums, "sides": self._through_sides},
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, after the solid has."""
        self.blocks.without_ghosts(self.swept[:, :1])[:] = snapshot["cells"]["swept"]
        self._exchange_swept()
        self._wall_sums[:] = snapshot["sums"]["wall"]
        self._through_sides[:] = snapshot["sums"]["sides"]
        c = self.solid.columns
        self.wall.near[:] = 1
        self._cut(c["position"], c["velocity"])

    def ledger(self) -> dict[str, np.ndarray]:
        """Collective. Masses, momentum and energy (conserved,) that the coupling has created so far, per cause."""
        sides = self._per_block(self._side_blocks, self._through_sides)
        totals = self.blocks.sum(np.hstack([self._wall_sums, sides]))
        return dict(zip(self.causes, np.split(totals, len(self.causes)), strict=True))
