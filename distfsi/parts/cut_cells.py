"""Fluid and solid together: cells that the wall cuts, with the volume that their fluid has swept (docs/theory.md)."""

from __future__ import annotations

from itertools import product
from math import prod
from typing import Any

import numpy as np

from distfsi.device.seam import Device, Pair
from distfsi.kernels import coupling as immersed_kernels
from distfsi.kernels import cut_cells as kernels
from distfsi.kernels import cut_fluxes, cut_forces, images, push
from distfsi.kernels import rows as row_kernels
from distfsi.kernels.band import BAND, FAR
from distfsi.kernels.particles import EXCHANGE
from distfsi.kernels.regions import copy_cells, copy_regions, pack_cells, unpack_cells
from distfsi.mesh.blocks import GHOSTS, Blocks, Snapshot
from distfsi.mesh.chosen import ChosenGhosts
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.particles import GhostPlan, ParticleExchange
from distfsi.mesh.rows import Groups
from distfsi.parts import dust
from distfsi.parts.dust import Dust
from distfsi.parts.fluid import Fluid, Stage
from distfsi.parts.initial import InitialState
from distfsi.parts.solid import Solid
from distfsi.parts.thickness import Thickness
from distfsi.parts.wall_geometry import WallGeometry
from distfsi.parts.wall_points import WallPoints
from distfsi.scene.description import Scene

MIRRORS = ("symmetry", "wall", "outflow", "inflow")
LARGEST_MOVE = 0.3  # of a cell in a step, so that thin bodies stay closed, before forces between particles change it
FARTHEST_MOVE = 0.35  # of a cell, whatever they do: then the solid makes no other sub-step
PARTICLE_DRIVERS = (
    *EXCHANGE,
    copy_cells,
    pack_cells,
    unpack_cells,
    *row_kernels.REDUCTIONS,
    cut_forces.keep_mass,
    cut_forces.keep_inside,
    cut_forces.find_volumes,
    cut_forces.mark_stretched,
    cut_forces.find_middle,
    cut_forces.find_momentum,
    cut_forces.find_gains,
    cut_forces.mark_walled,
    cut_forces.see_particles,
    cut_forces.push_together,
    cut_forces.find_pressures,
    cut_forces.find_debts,
    cut_forces.clear,
    *dust.PARTICLE_DRIVERS,
    images.weigh_images,
    images.fade_images,
    push.find_homes,
    push.gather_kicks,
)
FLUID_DRIVERS = (
    kernels.take_contents,
    kernels.mark_leaving,
    kernels.evict,
    kernels.find_sealed,
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
    cut_fluxes.book_sides,
    kernels.keep_volumes,
    cut_forces.spread_impulse,
    cut_forces.pay_debts,
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

    def __init__(self, scene: Scene, model, fluid: Fluid, solid: Solid, blocks: Blocks, team: Device):
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
        self._particles = ParticleExchange(blocks, team, self.kernels)
        self._points = WallPoints(self._particles.rows, self.kernels, max(grid.spacing[: grid.dimensions]))
        self._spacing = np.array(grid.spacing)
        self.sub_steps = scene.coupling.sub_steps
        self.stray = FARTHEST_MOVE * float(self._spacing[: self._dimensions].min())
        self._corners = [team.array(np.array(corner)) for corner in (grid.lower, grid.upper)]
        self._homes = [team.array(np.array(values)) for values in (blocks.block_cells, blocks.curve_index)]
        place = (self.wall.shape, self._corners[0], self.wall.spacing, self.wall.origin, self.wall.cells, *self._homes)
        built = (self.kernels, self.fluid_kernels)
        self.dust = Dust(solid.columns, self._particles.rows, built, self.wall, *place, blocks.first)
        self._cell_volume = float(self._spacing.prod())
        self._initial = InitialState(scene.fluid, model)
        self._rest = self._state_at_rest(scene)
        self._rest_there = team.array(self._rest)

        self.kind = Pair(team, blocks.allocate(1, np.uint8))
        self._fields = 3 if model.phases == 2 else 1
        self.swept = Pair(team, np.ones((blocks.local_count, self._fields, *blocks.shape), real))
        fluid.volumes = self.swept
        self._state_parity, self._swept_parity, self._given_parity = (
            team.array(np.where(axes < 0, 0, 1 << np.maximum(axes, 0)))
            for axes in (model.mirror, np.full(self._fields, -1), np.append(np.arange(grid.dimensions), -1))
        )
        self._master = team.array(blocks.allocate(grid.dimensions, np.int8))
        self._kick, self._debt = (team.array(blocks.allocate(1 + grid.dimensions)) for _ in range(2))
        self._wall_sums = np.zeros((blocks.local_count, model.conserved))
        self._find_sides()
        self._keep_lists([team.empty(0, np.int64)] * 3, np.zeros((blocks.local_count, 3), dtype=np.int64))
        self._thickness = Thickness(solid.columns, self.wall, max(grid.spacing[: grid.dimensions]))
        (position,) = solid.columns.read("position")
        self._look(position)
        self.dust.find(solid.columns, self._middle, self._middle_bins)
        for _ in range(2):
            self._cut(position, team.zeros(position.shape))
        self._fill_at_start()

    def _state_at_rest(self, scene: Scene) -> np.ndarray:
        """Conserved state (variables,) of the first region without its velocity."""
        state = self._initial.of(scene.fluid.regions[0].state)
        rest = np.array(self.model.formula("primitives")(state))
        rest[self.model.phases : self.model.phases + self._dimensions] = 0.0
        return np.array(self.model.formula("conserved")(tuple(rest)), dtype=scene.fluid.precision)

    def _fill_at_start(self) -> None:
        """Cut cells hold the state at the middle of their open corners; fluid fills what is open."""
        swept, kind, state = self.swept.here(), self.kind.here(), self.fluid.state
        swept[:, 0] = self.wall.fractions[1].here()[:, 0]
        for block in range(self.blocks.local_count):
            (x, y, z), middles = (a.T for a in self.wall.cut_cells(block))
            state[block][:, z, y, x] = self._initial.at(middles.T)
        self._classify()
        swept[:, 1:] = 0.0
        np.moveaxis(state, 1, -1)[kind[:, 0] == immersed_kernels.COVERED] = self._rest
        for changed in (self.swept, self.fluid):
            changed.changed()
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
        self._side_blocks = self._side_cells // prod(blocks.shape)
        self._sides = [self.team.array(a) for a in (self._side_cells, self._side)]
        self._through_sides = Pair(self.team, np.zeros((len(self._side), self.model.conserved)))
        images = GHOSTS * (np.arange(3) < grid.dimensions)
        self._seen_cells = self.team.array(np.column_stack([-images, grid.cells + images]))

    # ---- one step ---------------------------------------------------------------------------------------------------

    def time_step(self) -> float:
        """Longest step [s] in which no particle of this rank goes farther than LARGEST_MOVE."""
        lowest, highest = self._particles.rows.bounds(*self.solid.columns.read("velocity"))
        speed = max(-lowest.min(), highest.max())
        return LARGEST_MOVE * float(self._spacing[: self._dimensions].min()) / max(speed, 1e-300)

    def follow(self) -> None:
        """Collective, after solid.advance(). Cut the cells where the particles are now, and find the moving wall."""
        team, D = self.team, self._dimensions
        self._thickness.way += self._look(self.solid.start)
        self.dust.find(self.solid.columns, self._middle, self._middle_bins)
        self._lone = self.dust.rows(self.solid.columns)
        self._cut(self.solid.start, self.solid.carried)
        self._find_company()
        n = self._band.shape[0]
        self._area, self._start_volume = team.empty((n, D)), team.empty(n)
        self._velocity, self._inertia = team.zeros((n, D)), team.zeros(n)
        self._impulse, self._work, self._added = team.zeros((n, D)), team.zeros(n), team.zeros(n)
        self._opened, self._seen = team.empty((n, 2 * D)), team.empty(2 * D * n, np.int8)
        self._run(self.fluid_kernels.find_walls, self._area, self._opened, *self._walls, self.wall.spacing)
        self._run(self.fluid_kernels.find_faces, self._above, self._opened, self._seen, *self._walls)
        self._faces = self._particles.rows.marked(self._seen)[1]
        self._flux = team.empty((n, 2 * D * self.model.constants["FLUXES"]))
        mark = team.empty(n, np.int8)
        self._run(self.kernels.mark_walled, self._area, mark)
        walled = self._particles.rows.marked(mark)[1]
        cells = self._particles.rows.taken(self._band, walled)
        self._walled = self.wall.near_order(walled, cells, self.blocks.shape)
        self._see(self._particle_velocity, self._velocity)
        self._near_sides = self.wall.band_rows(self._sides[0])

    def before_stage(self, stage: Stage) -> None:
        """Collective. Mix what belongs together in the stage's input, and leave it as states."""
        U, first = self.fluid.input_of(stage), stage.number == 0
        self._mix(U, self.wall.parts[0 if first else 1])
        if first:
            self._run(self.fluid_kernels.keep_volumes, self._swept, self.wall.shape, self._start_volume)
        self.fluid.wake(self.wall.near.here() > 0)
        self._start, self._input, self._output = self.fluid.there, U, self.fluid.output_of(stage)

    def after_stage(self, stage: Stage, dt: float) -> None:
        """Advance the cells of the band in the place of the fluid's stage, of a step of `dt` [s]."""
        rates, weight = np.array(self.fluid.rates(dt)[: len(self._spacing)]), stage.weight * dt
        self._dt = dt
        rates, weights = (self.team.array(a) for a in (rates, weight * self._cell_volume / self._spacing))
        boxes = -(-self._faces.shape[0] // self.team.lanes)
        given = (self._band, self._faces, self._seen, self._flux, self._input, self.wall.shape, self.wall.steps, rates)
        self.team.run(self.fluid_kernels.find_fluxes, boxes, *given)
        self._run_boxes(
            self.fluid_kernels.advance_band, self._above, self._opened, self._flux, self._start, self._input,
            self._output, self._swept, self._start_volume, self._area, self._velocity, self._impulse, self._work,
            self._added, self.wall.shape, rates, stage.b, dt, weight,
        )  # fmt: skip
        self.team.run(
            self.fluid_kernels.book_sides, self._near_sides.shape[0], self._near_sides, *self._sides,
            self._through_sides.there, self._input, *self._walls, rates, weights,
        )  # fmt: skip
        if stage is self.fluid.stages[-1]:
            self._settle()

    def _settle(self) -> None:
        """Mix what the last stage left, and exchange volumes so that they stay near the geometric ones."""
        U, after, wall, k = self.fluid.there, self.wall.parts[1], self.wall, self.fluid_kernels
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
        self._near_ghosts.exchange((self.swept.there, self._swept_parity))

    def impulse(self) -> Any:
        """Collective. Impulse (own, D) [N s] of the fluid on this rank's particles in the step, on the device."""
        D, wall, own = self._dimensions, self.wall, self.solid.count
        self._run(
            self.fluid_kernels.spread_impulse, self._cell_volume, self._impulse, self._added, self._inertia, self._kick,
            wall.shape,
        )  # fmt: skip
        self._near_ghosts.exchange((self._kick, self._given_parity))
        gained = self._gather_kicks()
        for cells in (self._band, *self._near_ghosts.cells):
            self.team.run(self.kernels.clear, cells.shape[0], cells, 1 + D, self._kick.reshape(-1), wall.shape)
        given, self._shared = (self.team.empty((own, D)) for _ in range(2))
        fixed, velocity = self.solid.columns.read("fixed", "velocity")
        known = (self._own_mass, fixed, self.solid.before, velocity, gained)
        self.team.run(self.kernels.push_together, own, *known, given, self._shared)
        paid = np.zeros((self.blocks.local_count, D + 1))
        self._dragged = self.drag(self._lone, given) if self._lone.shape[0] else paid
        return given

    def drag(self, rows: Any, impulse: Any) -> np.ndarray:
        """The fluid moves the lone particles `rows` (n,) in the last step: their rows of `impulse` (own, D) [N s] are
        found, and what the fluid of each block pays for it (local blocks, D + 1) [N s, J]."""
        block, paid = self.dust.drag(
            self.solid.columns, rows, self.solid.start, self._dt, impulse, (self.fluid.there, self._swept),
            self._input, self._kinds,
        )  # fmt: skip
        sums = np.zeros((self.blocks.local_count, self._dimensions + 1))
        np.add.at(sums, block, paid)
        self.fluid.wake(np.bincount(block, minlength=len(sums)) > 0)
        return sums

    def book_work(self, excess: Any) -> None:
        """Collective, after solid.push(), whose impulse worked at the `excess` (own, D) [m/s] over the velocity of the
        wall: the fluid pays for it."""
        D, P = self._dimensions, self.model.phases
        vector = tuple((a,) for a in range(D))
        own, paid, debt = self.solid.count, self.team.empty(self._band.shape), self._debt.reshape(-1)
        gains = self.team.empty((own, 2 * D + 1))
        self.team.run(self.kernels.find_gains, own, self.solid.carried, excess, self._shared, gains)
        (gains,) = self._plan.exchange([(gains, (*vector, *vector, ()))])
        seen = self.team.zeros((self._band.shape[0], 2 * D + 1))
        self._see(gains, seen)
        self._run(self.kernels.find_debts, self._added, self._impulse, seen, debt, self.wall.shape)
        self._near_ghosts.exchange((self._debt, self._given_parity))
        self._run(
            self.fluid_kernels.pay_debts, self._joined, paid, debt, self.fluid.there, self._swept, *self._company
        )  # fmt: skip
        impulse, work, extra = (self._cell_volume * self._groups.sums(a) for a in (self._impulse, self._work, paid))
        self._wall_sums[:, P : P + D] += self.solid.given.sum(axis=1) - impulse - self._dragged[:, :-1]
        self._wall_sums[:, -1] += self.solid.work - work[:, 0] - extra[:, 0] - self._dragged[:, -1]

    def pressure(self, dt: float) -> float:
        """Collective. The highest mean pressure [Pa] on a cell's wall in the last step, of `dt` [s]."""
        pressure = self.team.empty(self._band.shape[0])
        self._run(self.kernels.find_pressures, self._area, self._impulse, pressure)
        highest = self._particles.rows.largest(pressure, 0.0) / dt
        return float(self.blocks.communicator.maximum(np.array([highest]))[0])

    def sealed(self) -> np.ndarray:
        """Collective. Mass [kg] of each phase in cells that are shut: it neither flows nor pushes."""
        held = self.team.empty((self._band.shape[0], self.model.phases))
        self._run(self.fluid_kernels.find_sealed, held, self._kinds, self.fluid.there, self._swept, self.wall.shape)
        return self.blocks.sum(self._cell_volume * self._groups.sums(held))

    def let_fluid_leave(self) -> None:
        """All that the fluid holds leaves the domain; from now on no cell has any."""
        self.fluid.leave(self.volume)
        self.swept.here()[:] = 0.0
        self.swept.changed()
        self._classify()

    def _classify(self) -> None:
        """Which cells are covered, by what they hold."""
        holds = self.swept.here()[:, :1] > 0.0
        self.kind.here()[:] = np.where(holds, immersed_kernels.FLUID, immersed_kernels.COVERED)
        self.kind.changed()

    # ---- parts of it ------------------------------------------------------------------------------------------------

    def _look(self, start: Any) -> float:
        """Collective. The particles around this rank's, which have moved from `start`; how far one did at most [m]."""
        c, team, own = self.solid.columns, self.team, self.solid.count
        self._own_middle, way = team.empty(start.shape), team.empty(own)
        team.run(self.kernels.find_middle, own, start, *c.read("position"), self._own_middle, way)
        self._stretched = self._points.stretched(c)
        most = np.array([self._particles.rows.largest(way, 0.0), float(self._stretched.shape[0])])
        farthest, split = self.blocks.communicator.maximum(most)
        self._split = split > 0.0
        self._plan = self._ghosts(start, c["id"])
        (self._middle,) = self._plan.exchange([(self._own_middle, "position")])
        self._middle_bins = self.wall.sort(self._middle, self._plan.key.there)
        return farthest

    def _cut(self, start: Any, velocity: Any) -> None:
        """The cells cut by the particles that _look() has found, which have moved from `start` with `velocity`."""
        c, team, wall, own = self.solid.columns, self.team, self.wall, self.solid.count
        self._own_mass, known = team.empty(own), c.read("dust", "mass", "density")
        team.run(self.kernels.keep_mass, own, start, *known, *self._corners, self._own_mass)
        vector = tuple((a,) for a in range(self._dimensions))
        self._particle_velocity, self._mass = self._plan.exchange([(velocity, vector), (self._own_mass, ((),))])
        (point,), size, plan = c.read("position"), self._points.volumes(c), self._plan
        if self._split:
            point, size, number = self._points.of(c, self._stretched)
            plan = self._ghosts(point, number)
        inside = team.empty((point.shape[0], 2))
        team.run(self.kernels.keep_inside, point.shape[0], point, size, *self._corners, inside)
        position, volume = plan.exchange([(point, "position"), (inside, ((), ()))])
        bins = wall.sort(position, plan.key.there)
        points = (plan.key.there, volume, position, *bins)
        self._image, image = self._weigh_images(plan, point, size, points)
        team.run(self.kernels.fade_images, plan.count, plan.key.there, image, 2, volume.reshape(-1))
        if self._split:
            self._image, image = self._weigh_images(self._plan, *c.read("position"), self._points.volumes(c), points)
        team.run(self.kernels.fade_images, self._plan.count, self._plan.key.there, image, 1, self._mass)
        ball = self._thickness.balls(c, plan, position, volume, bins, self._split)
        wall.cut(position, volume, ball, plan.key.there, bins)

    def _ghosts(self, position: Any, id: np.ndarray) -> GhostPlan:
        """Collective. Who needs copies of which particles or points."""
        return self._particles.ghosts(position, id, self.wall.reach, image_reach=self.wall.images, mirrors=MIRRORS)

    def _weigh_images(self, plan: GhostPlan, place: Any, size: Any, points: tuple[Any, ...]) -> tuple[Any, Any]:
        """Collective. How much images along each axis count of the particles at a `place` (own, D) [m], of a `size`
        (own, 1) [m^D], beside the `points` of all bodies: (own, D) and (count, D) of the plan."""
        own, D, wall = place.shape[0], self._dimensions, self.wall
        weight = self.team.empty((own, D))
        self.team.run(
            self.kernels.weigh_images, own, weight, place, size, *self._corners, *wall.touching, wall.images, *points
        )
        (extended,) = plan.exchange([(weight, ((),) * D)])
        return weight, extended

    def _find_company(self) -> None:
        """Which cells join which, and the lists of the band's, the covered and the loose cells."""
        self.wall.find_masters(self._kinds, self._masters, self._swept, self._fields)
        self._exchange(self.kind.there, np.array([-1]), immersed_kernels.FLUID)
        self.wall.find_refuges(self._kinds, self._masters)
        self._exchange(self._master, np.arange(self._dimensions), 0)
        self._list_cells()
        self._run(self.fluid_kernels.take_contents, self.fluid.there, self._swept, self.wall.shape)
        mark = self.team.empty(self._band.shape[0], np.int8)
        self._run(self.fluid_kernels.mark_leaving, mark, self._kinds, self._masters, self.wall.shape, self.wall.steps)
        found = np.array([float(self._particles.rows.any(mark)), float(self._lone.shape[0])])
        leaving, lone = self.blocks.communicator.maximum(found)
        if leaving > 0.0:
            self.evict()
        self._expands = int(lone > 0.0 and not self._stairs)
        self._look_around()

    def evict(self) -> None:
        """Collective. Contents of cells that are shut move, and these are covered."""
        U, wall, k = self.fluid.there, self.wall, self.fluid_kernels
        self._exchange_contents(U)
        moved = self.team.empty((self._band.shape[0], self.model.variables + 3), U.dtype)
        self._run(
            k.evict, moved, U, self._swept, self._kinds, wall.parts[0], self._masters, wall.steps, wall.shape
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

    def _see(self, values: Any, mean: Any) -> None:
        """mean (band, k) of what particles have (count, k) around the cells with a wall, where they were in the middle
        of the step: only there is the way that a turning wall went along itself."""
        (count, width), wall = values.shape, self.wall
        amounts = self.team.empty((count, 1 + width))
        self.team.run(self.kernels.find_momentum, count, width, self._mass, values, amounts)
        self.team.run(
            self.kernels.see_particles, -(-self._walled.shape[0] // wall.lanes), self._band, self._walled, width, mean,
            self._inertia, wall.seen, amounts.reshape(-1), self._middle, *self._middle_bins, wall.shape, wall.spacing,
            wall.origin,
        )  # fmt: skip

    def _gather_kicks(self) -> Any:
        """What the cells give to the mass of each of this rank's particles (own, 1 + D): velocity, and added mass over
        its own."""
        own, wall, team = self.solid.count, self.wall, self.team
        gained, home = team.empty((own, 1 + self._dimensions)), team.empty(own, np.int64)
        chosen = wall.coarse_order(self._own_middle, *self.solid.columns.read("id"))
        grid, homes = (self._corners[0], wall.spacing), (wall.cells, *self._homes, self.blocks.first)
        team.run(self.kernels.find_homes, own, self.solid.start, home, *grid, *homes)
        team.run(
            self.kernels.gather_kicks, -(-own // wall.lanes), chosen, self._own_middle, home, self._image, gained,
            wall.seen, wall.mark.reshape(-1), BAND, self._kick, wall.shape, *grid, wall.origin, wall.extent,
            self._seen_cells, wall.cells,
        )  # fmt: skip
        return gained

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
        return self.swept.there.reshape(-1)

    @property
    def _kinds(self) -> Any:
        return self.kind.there.reshape(-1)

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
        self._near_ghosts.exchange((U, self._state_parity), (self.swept.there, self._swept_parity))

    def _exchange_swept(self) -> None:
        self._exchange(self.swept.there, np.full(self._fields, -1), 1.0)

    # ---- looking at it ----------------------------------------------------------------------------------------------

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether a cell holds no fluid, ghosts included."""
        return self.swept.here()[:, 0] <= 0.0

    @property
    def volume(self) -> np.ndarray:
        """(local blocks, Z, Y, X) the part of each cell that its fluid fills."""
        return self.swept.here()[:, 0]

    def memory(self) -> int:
        """Bytes of this rank's fields, the corners' as if they were as many as cells."""
        fields = (self.kind, self.swept, *self.wall.fractions, *self.wall.apertures)
        cells, D = self.kind.nbytes, self._dimensions
        return sum(field.nbytes for field in fields) + cells * (2 + D + 8 * D + 2 * 8)

    def workload(self) -> np.ndarray:
        """(local blocks,) cells in the band around the wall."""
        return self._band_cells.astype(float)

    def snapshot(self) -> Snapshot:
        """What a restart needs: the volumes, and the books."""
        return {
            "cells": {"swept": self.blocks.without_ghosts(self.swept.here()[:, :1])},
            "sums": {"wall": self._wall_sums, "sides": self._through_sides.here()},
            "values": {"way": np.array(self._thickness.way)},
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, after the solid has."""
        self.blocks.without_ghosts(self.swept.here()[:, :1])[:] = snapshot["cells"]["swept"]
        self.swept.changed()
        self._classify()
        self._exchange_swept()
        self._thickness.way = float(snapshot["values"]["way"])
        self._wall_sums[:] = snapshot["sums"]["wall"]
        self._through_sides.here()[:] = snapshot["sums"]["sides"]
        self._through_sides.changed()
        self.wall.near.here()[:] = 1
        self.wall.near.changed()
        position, velocity = self.solid.columns.read("position", "velocity")
        self._look(position)
        self._cut(position, velocity)

    def ledger(self) -> dict[str, np.ndarray]:
        """Collective. Masses, momentum and energy (conserved,) that the coupling has created so far, per cause."""
        count, through = self.blocks.local_count, self._through_sides.here()
        sides = np.stack([np.bincount(self._side_blocks, amounts, count) for amounts in through.T], axis=1)
        totals = self.blocks.sum(np.hstack([self._wall_sums, sides]))
        return dict(zip(self.causes, np.split(totals, len(self.causes)), strict=True))
