"""Fluid and solid together: an immersed boundary made of particles (paper, Sec. 3.2 with Eqs. 31-35 made consistent)."""

from __future__ import annotations

from itertools import product

import numpy as np

from distfsi.device import cpu
from distfsi.kernels import coupling as kernels
from distfsi.kernels import solid as particle_kernels
from distfsi.kernels.regions import copy_regions
from distfsi.mesh.blocks import GHOSTS, Blocks
from distfsi.mesh.exchange import GhostExchange
from distfsi.parts.fluid import Fluid, Stage
from distfsi.parts.initial import InitialState
from distfsi.parts.solid import Solid
from distfsi.scene.description import Scene

COVER_RADIUS = 1.5  # in cells, of the kernel that decides what is covered; at least three particle spacings
VELOCITY_RADIUS = 1.4  # in cover radii, of the kernel between particles and cells; at most the ghost cells allow
PARTICLE_DRIVERS = (particle_kernels.find_cells, particle_kernels.fill_cells, particle_kernels.order_cells)
GEOMETRY_DRIVERS = (kernels.find_depth, kernels.list_cells, kernels.find_wall_velocity, kernels.push)
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

    A step is solid.prepare(reach); classify(); for each stage fluid.exchange_ghosts(), fill(), fluid.advance_stage(),
    collect_force(); then solid.advance(dt, impulse()); book_work().

    reach   [m]: the solid's ghosts and images must go as far
    causes  of what the coupling creates: "wall" (fluid that crosses the wall, and work that the wall does not return), "covered"
            and "fresh" cells, "sides" (what the fluid believes to have left the domain at covered cells)
    """

    causes = ("wall", "covered", "fresh", "sides")

    def __init__(self, scene: Scene, model, fluid: Fluid, solid: Solid, blocks: Blocks, team: cpu.Team):
        self.model, self.fluid, self.solid, self.blocks, self.team = model, fluid, solid, blocks, team
        grid, real = blocks.grid, scene.fluid.precision
        self.kernels = cpu.build(PARTICLE_DRIVERS + GEOMETRY_DRIVERS, {"DIMENSIONS": grid.dimensions})
        self.fluid_kernels = cpu.build(FLUID_DRIVERS, model.constants, model.bindings, real)
        self.exchange = GhostExchange(blocks, cpu.build([copy_regions], {}).copy_regions)
        self.real = np.dtype(real).type

        h, D = min(scene.domain.spacing), grid.dimensions
        self.cover_radius = COVER_RADIUS * max(h, 2.0 * max(body.spacing for body in scene.solid.bodies))
        self.reach = min(VELOCITY_RADIUS * self.cover_radius, (GHOSTS + 0.5) * h)
        self._bin_size = h
        self._lower, self._upper = np.array(grid.lower), np.array(grid.upper)
        self._spacing, self._shape = np.array(grid.spacing), np.array(blocks.shape)
        self._steps = np.array([1, blocks.shape[2], blocks.shape[1] * blocks.shape[2]])
        self._open_cells = np.array(
            [
                (-GHOSTS * (a == "symmetry"), n + GHOSTS * (b == "symmetry"))
                for n, (a, b) in zip(grid.cells, grid.boundaries)
            ]
        )
        first = InitialState(scene.fluid, model).of(scene.fluid.regions[0].state)
        self._rest = np.array(model.formula("primitives")(first), dtype=self.real)
        self._rest[model.phases : model.phases + D] = 0.0
        self._find_neighbourhood()
        self._find_sides()

        self.kind = blocks.allocate(1, np.uint8)
        self.kind[:] = kernels.UNKNOWN
        self._occupied = np.ones(blocks.local_count, dtype=np.uint8)
        self._kick = blocks.allocate(D)
        self._ledger = {cause: np.zeros((blocks.local_count, model.conserved)) for cause in self.causes}
        solid.prepare(self.reach)
        self.classify()

    def _find_neighbourhood(self) -> None:
        """Places of the cells around a cell, ring by ring, and their weights 1/distance^2 in Eq. 32."""
        D = self.blocks.grid.dimensions
        around = np.array([o[::-1] for o in product(range(-GHOSTS, GHOSTS + 1), repeat=D) if any(o)])
        ring = np.abs(around).max(axis=1)
        around = around[np.argsort(ring, kind="stable")]
        self._offsets = around @ self._steps[:D]
        self._weights = (1.0 / ((around * self._spacing[:D] / self._spacing[:D].min()) ** 2).sum(axis=1)).astype(
            self.real
        )
        self._rings = np.searchsorted(np.sort(ring), np.arange(1, GHOSTS + 2))

    def _find_sides(self) -> None:
        """This rank's cells at the domain's sides, periodic ones apart, and which sides those are."""
        grid, blocks = self.blocks.grid, self.blocks
        cells = np.arange(blocks.local_count * self._shape.prod()).reshape(-1, *blocks.shape)
        places, sides = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for block in range(blocks.local_count):
            origin, extent = blocks.origin[block], blocks.extent[block]
            active = cells[(block, *(slice(g, g + n) for g, n in zip(grid.ghosts[::-1], extent[::-1])))]
            for axis, side in product(range(grid.dimensions), (0, 1)):
                at_end = origin[axis] + side * extent[axis] == side * grid.cells[axis]
                if at_end and grid.boundaries[axis][side] != "periodic":
                    places.append(active.take(-side, axis=2 - axis).ravel())
                    sides.append(np.full(len(places[-1]), 2 * axis + side))
        self._side_cells, self._side = np.concatenate(places), np.concatenate(sides)
        self._through_sides = np.zeros((len(self._side), self.model.conserved))

    # ---- one step -----------------------------------------------------------------------------------------------------

    def classify(self) -> None:
        """Collective. Find the covered cells, and the velocity of the wall in those that fluxes see."""
        around = self.solid.around
        mass, position = around["mass"], around["position"]
        bins = self._fill_bins(position, around["key"])
        grid = (self._shape, self._spacing, self.blocks.origin)
        kind, count = self.kind.reshape(-1), self.blocks.local_count
        lost = np.zeros_like(self._ledger["covered"])
        self.team.run(
            self.fluid_kernels.cover, count, kind, self._occupied, self.fluid.state, lost, self.cover_radius,
            (mass / around["density"])[:, None], position, *bins, self._shape, self._spacing, self.blocks.origin,
            self.blocks.extent,
        )  # fmt: skip
        self._ledger["covered"] -= lost * self._cell_volume
        self._exchange(self.kind, np.array([-1]), kernels.COVERED)
        self._list_cells()
        n, D = len(self._covered), self.blocks.grid.dimensions
        self._velocity, self._inertia = np.empty((n, D), self.real), np.empty(n)
        self._passed = np.zeros((n, self.model.conserved))
        momentum = np.column_stack([mass, mass[:, None] * around["velocity"]])
        self.team.run(
            self.kernels.find_wall_velocity, n, self._covered, self._velocity, self._inertia, self.reach, momentum, position, *bins, *grid,
        )  # fmt: skip

    def fill(self, stage: Stage) -> None:
        """Give the covered cells of the stage's input, and before the first stage the fresh ones, their states.

        The input's ghost cells must be filled; those of covered cells need not be.
        """
        U, kind, shape = self.fluid.input_of(stage), self.kind.reshape(-1), self._shape
        around = (kind, shape, self._offsets, self._weights, self._rings, self._rest)
        run, k = self.team.run, self.fluid_kernels
        run(k.fill_covered, len(self._covered), self._covered, self._velocity, U, *around)
        run(k.fill_deep, len(self._deep), self._deep, U, shape, self._rest)
        if stage.number == 0 and len(self._fresh):
            run(k.fill_fresh, len(self._fresh), self._fresh, U, *around)
            block, cell = np.divmod(self._fresh, shape.prod())
            content = U.reshape(*U.shape[:2], -1)[block, : self.model.conserved, cell]
            self._ledger["fresh"] += self._per_block(block, content * self._cell_volume)

    def collect_force(self, stage: Stage, dt: float) -> None:
        """Add up what has crossed the wall in a stage of a step of `dt` [s], with the fluxes of that stage."""
        U, kind = self.fluid.input_of(stage), self.kind.reshape(-1)
        weights = stage.weight * dt * self._cell_volume / self._spacing
        rest = (U, kind, self._shape, self._steps, weights)
        run, k = self.team.run, self.fluid_kernels
        run(k.collect_wall, len(self._covered), self._covered, self._passed, *rest)
        run(k.collect_sides, len(self._side), self._side_cells, self._side, self._through_sides, *rest)

    def impulse(self) -> np.ndarray:
        """Collective. Impulse (own, D) [N s] of the fluid on this rank's particles in the step."""
        D, P, blocks, grid = self.blocks.grid.dimensions, self.model.phases, self.blocks, self.blocks.grid
        self._kick[:] = 0.0
        self.team.run(
            self.fluid_kernels.spread, len(self._covered), self._covered, self._passed, self._velocity, self._inertia, self._kick, self._shape,
        )  # fmt: skip
        self._exchange(self._kick, np.arange(D), 0.0)
        own = self.solid.columns
        impulse, home = np.empty_like(own["position"]), np.empty(len(own["id"]), dtype=np.int64)
        self.team.run(
            self.kernels.push, len(home), own["position"], own["mass"], impulse, home, self.reach, self._kick, self._shape,
            self._lower, self._spacing, blocks.origin, blocks.extent, self._open_cells, np.array(grid.cells),
            np.array(blocks.block_cells), blocks.curve_index, blocks.first,
        )  # fmt: skip
        wall = self._ledger["wall"]
        wall -= self._per_block(self._covered // self._shape.prod(), self._passed)
        wall[:, P : P + D] += self._per_block(home, impulse)
        return impulse

    def book_work(self) -> None:
        """Enter the work of the impulse on the solid; after solid.advance()."""
        self._ledger["wall"][:, -1] += self.solid.work

    # ---- parts of it --------------------------------------------------------------------------------------------------

    def _fill_bins(self, position: np.ndarray, key: np.ndarray) -> tuple:
        """Sort the particles into the cells of a search grid, the same on all ranks: start, order and the window held."""
        D, size = self.blocks.grid.dimensions, self._bin_size
        lower, upper = self._lower[:D], self._upper[:D]
        lowest = np.fmin.reduce(position, axis=0, initial=np.inf)
        highest = np.fmax.reduce(position, axis=0, initial=-np.inf)
        last = np.ceil((upper - lower) / size)
        low, high = np.clip(np.floor((np.stack([lowest, highest]) - lower) / size), -1.0, last)
        window = np.maximum(high - low, 0.0).astype(np.int64) + 3
        strides = np.cumprod([1, *window[:-1], *[1] * (3 - D)])
        cell, order = np.empty((2, len(position)), dtype=np.int64)
        start = np.zeros(window.prod() + 1, dtype=np.int64)
        run, k = self.team.run, self.kernels
        run(k.find_cells, len(position), position, self._lower, size, low, high, strides, cell)
        k.fill_cells(cell, start, order)
        run(k.order_cells, len(start) - 1, start, order, key)
        return start, order, self._lower, size, low, window, strides

    def _list_cells(self) -> None:
        kind, count, occupied = self.kind.reshape(-1), self.blocks.local_count, self._occupied
        counts = np.empty((count, 3), dtype=np.int64)
        place = (kind, occupied, self._shape, self.blocks.extent)
        self.team.run(self.kernels.find_depth, count, *place, self._offsets, counts)
        ends = np.cumsum(counts, axis=0)
        totals = ends[-1] if count else np.zeros(3, dtype=np.int64)
        lists = [np.empty(n, dtype=np.int64) for n in totals]
        self.team.run(self.kernels.list_cells, count, *place, ends - counts, *lists)
        self._covered, self._deep, self._fresh = lists

    def _exchange(self, field: np.ndarray, mirror: np.ndarray, inflow: float) -> None:
        self.exchange.start(field, mirror, np.full((3, 2, field.shape[1]), inflow))
        self.exchange.finish()

    def _per_block(self, block: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Sums (local blocks, k) of `values` (n, k) in the blocks (n,)."""
        count = self.blocks.local_count
        return np.stack([np.bincount(block, v, minlength=count) for v in values.T], axis=1)

    @property
    def _cell_volume(self) -> float:
        return float(self._spacing.prod())

    # ---- looking at it ------------------------------------------------------------------------------------------------

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether the solid covers a cell, ghosts included."""
        return self.kind[:, 0] >= kernels.COVERED

    def ledger(self) -> dict[str, np.ndarray]:
        """Collective. Masses, momentum and energy (conserved,) that the coupling has created so far, per cause."""
        sides = self._per_block(self._side_cells // self._shape.prod(), self._through_sides)
        ledger = self._ledger | {"sides": sides}
        return dict(
            zip(self.causes, np.split(self.blocks.sum(np.hstack([ledger[c] for c in self.causes])), len(self.causes)))
        )
