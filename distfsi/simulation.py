"""The parts a scene needs, and the functions that advance them by one step."""

from __future__ import annotations

import math
import platform
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import psutil

from distfsi.coupling.cut_cells.cut_cells import FARTHEST_MOVE, LARGEST_MOVE, CutCells
from distfsi.coupling.immersed_boundary.immersed_boundary import ImmersedBoundary
from distfsi.device.cpu import Team
from distfsi.device.interface import Device
from distfsi.diagnostics.gauges import Gauge, gauge_of
from distfsi.diagnostics.peaks import Peaks, schlieren
from distfsi.errors import Diverged, StepFailed
from distfsi.fluid.fluid import Fluid
from distfsi.fluid.model import fluid_model, ghost_layers
from distfsi.mesh.blocks import Blocks, Grid, Snapshot
from distfsi.mesh.communicator import Communicator
from distfsi.output.requests import Request
from distfsi.scene.description import Scene
from distfsi.scene.packing import pack
from distfsi.solid.solid import Solid

COUPLINGS = {"cut_cells": CutCells, "stairs": CutCells, "paper": ImmersedBoundary}
Coupling = CutCells | ImmersedBoundary
COST_OF_PARTICLE = 30.0  # in cells, for the first deal of blocks to ranks

FLUID_LIMIT = "fluid CFL"
SUB_STEP_SLACK = 1.1  # by how much the solid's limit may fall during its sub-steps
ATTEMPTS = 8  # at a step, each with half the time step of the one before

NOT_REDONE = "; a step of fluid and solid together is not redone with a smaller time step: try a smaller time.cfl"

TimeStep = Callable[[], tuple[float, int]]  # [s], and in how many equal parts a coupled solid takes it


def fluid_step(fluid: Fluid, time_step: TimeStep) -> float:
    """Advance the fluid by one step and return it [s]; one that leaves no valid state is redone with half of it."""
    dt, _ = time_step()
    for attempt in range(ATTEMPTS):
        if attempt:
            fluid.reject()
            dt *= 0.5
        fluid.begin_step()
        for stage in fluid.stages:  # paper, Eq. 16
            fluid.advance_stage(stage, dt)  # MUSCL, HLLC, update and relaxation: Eqs. 11-30
        if fluid.is_valid():
            return dt
    raise StepFailed(f"{ATTEMPTS} attempts failed, the last with a step of {dt:.3g} s")


def solid_step(solid: Solid, time_step: TimeStep) -> float:
    """Advance the solid by one step and return it [s]."""
    solid.prepare()
    dt, _ = time_step()
    solid.advance(dt)  # Eqs. 5-7
    solid.migrate()
    return dt


def coupled_step(fluid: Fluid, solid: Solid, coupling: Coupling, time_step: TimeStep) -> float:
    """Advance fluid and solid together by one step and return it [s] (paper, Sec. 4 and Fig. 4)."""
    solid.prepare(coupling.reach, coupling.stray)
    dt = sub_cycle(solid, coupling, *time_step())  # Eqs. 5-7
    geometry = coupling.update_geometry()
    for stage in fluid.stages:
        cells = coupling.merge(geometry, stage)
        fluid.advance_stage(stage, dt)
        coupling.apply_wall_fluxes(geometry, cells, stage, dt)
    coupling.redistribute(geometry)
    transfer = coupling.transfer_impulse(geometry, cells, dt)
    excess = solid.apply_impulse(transfer.impulse)  # Eq. 34
    coupling.account_work(geometry, transfer, excess)
    solid.migrate()
    return dt


def sub_cycle(solid: Solid, coupling: Coupling, dt: float, parts: int) -> float:
    """Advance the solid by `dt` [s] in equal parts, with no force of the fluid meanwhile; how far it came [s].

    That is less when its own limit has fallen below a part, or when another part would take it too far.
    """
    part, way = dt / parts, 0.0
    for done in range(parts):
        if done:
            solid.prepare(coupling.reach, coupling.stray, goes_on=True)
        if parts > 1:
            rates = np.array([1.0 / solid.time_step()[0], 1.0 / coupling.time_step()])
            solid_rate, wall_rate = part * solid.communicator.maximum(rates)
            if done and not (solid_rate < SUB_STEP_SLACK and way + wall_rate < FARTHEST_MOVE / LARGEST_MOVE):
                return done * part
            way += wall_rate
        solid.advance(part)
    return dt


@dataclass
class Simulation:
    """The parts of a scene on this rank, and the step that advances them.

    loaded, alone  whether the fluid has pressed on the solid by more than the scene's limit; by less since, so that it
              was dropped, and the solid goes on alone
    watchers  what looks at the state at the start and after every step: it has a `name`, `after_step(simulation)`,
              `snapshot()` and `restore(snapshot)`
    sub_steps    that the solid was to make in the last step
    solid_limit  rate [1/s] of the shortest step that a particle of this rank needs, and why
    signals   of this rank's blocks of fluid [1/s] before the last step
    asked     what this rank is asked for; looked at once in every step
    request   the strongest of what all ranks were asked for in the last step: the same on all of them
    """

    scene: Scene
    communicator: Communicator
    blocks: Blocks
    fluid: Fluid | None
    solid: Solid | None
    coupling: Coupling | None
    watchers: list[Peaks | Gauge] = field(default_factory=list)
    time: float = 0.0
    steps: int = 0
    dt: float = 0.0
    limited_by: str = "start"
    loaded: bool = False
    alone: bool = False
    sub_steps: int = 1
    solid_limit: tuple[float, str] = (0.0, "")
    signals: np.ndarray | None = None
    asked: Callable[[], Request] = lambda: Request.NOTHING
    request: Request = Request.NOTHING

    @classmethod
    def of(
        cls,
        scene: Scene,
        communicator: Communicator,
        threads: int | None = None,
        costs: np.ndarray | None = None,
        device: Device | None = None,
    ) -> Simulation:
        """Build the parts the scene needs, and no others.

        `costs`: those of the blocks where they are known; `device`: in the place of this rank's threads.
        """
        blocks = deal_blocks(scene, communicator, costs)
        team = device or Team(threads or threads_of_rank(communicator))
        model = fluid_model(scene) if scene.fluid else None
        fluid = Fluid(scene, model, blocks, team.with_own_clock()) if scene.fluid else None
        solid = Solid(scene, blocks, communicator, team.with_own_clock()) if scene.solid else None
        coupled = COUPLINGS[scene.coupling.scheme]
        coupling = coupled(scene, model, fluid, solid, blocks, team.with_own_clock()) if fluid and solid else None
        simulation = cls(scene, communicator, blocks, fluid, solid, coupling)
        if scene.output.peaks:
            simulation.watchers.append(Peaks(scene.output.peaks, fluid, coupling))
        simulation.watchers += [gauge_of(gauge, simulation) for gauge in scene.gauges]
        return simulation

    @property
    def parts(self) -> list[Fluid | Solid | Coupling]:
        """Those that the scene needs."""
        return [part for part in (self.fluid, self.solid, self.coupling) if part is not None]

    def step(self) -> None:
        """Advance everything by one step."""
        parts = [self.solid] if self.alone else self.parts
        step = coupled_step if self.coupled else fluid_step if self.flows else solid_step
        rejected = self.rejected_steps
        try:
            self.dt = step(*parts, self.time_step)
        except Diverged as error:
            faults = self._faults() or [f"{error} at t = {self.time:.6g} s, after {self.steps} steps"]
            if isinstance(error, StepFailed):
                self.fluid.reject()
                raise Diverged(f"{faults[0]}; {error}") from error
            raise Diverged(faults[0] + (NOT_REDONE if self.coupling else "")) from error
        if self.rejected_steps > rejected:
            self.limited_by = "rejected step"
        if self.coupled and self.solid.sub_steps < self.sub_steps:
            self.limited_by = "sub-steps of the solid"
        self.time += self.dt
        self.steps += 1
        self.watch()
        if self.coupled and self.scene.coupling.drop_below is not None:
            self._end_loads(self.scene.coupling.drop_below)

    @property
    def flows(self) -> bool:
        """Whether there is a fluid that is computed."""
        return self.fluid is not None and not self.alone

    @property
    def coupled(self) -> bool:
        """Whether fluid and solid act on each other."""
        return self.coupling is not None and not self.alone

    def _end_loads(self, least: float) -> None:
        """Collective. Drop the fluid when it pressed on the solid by `least` [Pa] and does no more."""
        pressure = self.coupling.pressure(self.dt)
        self.loaded = self.loaded or pressure >= least
        if self.loaded and pressure < least:
            self.alone = True
            self.coupling.let_fluid_leave()
            self.solid.given[:] = 0.0

    @property
    def rejected_steps(self) -> int:
        """How many steps have been redone with a smaller time step."""
        return self.fluid.rejected_steps if self.fluid else 0

    def watch(self) -> None:
        """Show the state to the watchers: once before the first step, then after each."""
        for watcher in self.watchers:
            watcher.after_step(self)

    def time_step(self) -> tuple[float, int]:
        """The longest stable step [s] of all parts on all ranks, and in how many parts the solid takes it. Raises
        Diverged when a part has no valid state."""
        signal = self.fluid.fastest_signal() if self.flows else 0.0
        self.signals = self.fluid.signals.copy() if self.flows else None
        solid_dt, solid_reason = self.solid.time_step() if self.solid else (np.inf, "")
        wall_dt = self.coupling.time_step() if self.coupled else np.inf
        self.solid_limit = 1.0 / solid_dt, solid_reason
        rates = np.array([signal / self.scene.time.cfl, 1.0 / solid_dt, 1.0 / wall_dt, self.asked()])
        fluid_rate, solid_rate, wall_rate, request = self.communicator.maximum(rates)
        self.request = Request(int(request))
        if not np.isfinite(fluid_rate) or not np.isfinite(solid_rate):
            raise Diverged("there is no stable time step")
        parts = self.coupling.sub_steps if self.coupled else 1
        if solid_rate / parts > max(fluid_rate, wall_rate):
            self.limited_by = self.name_solid_limit()
        else:
            named = self.limited_by.startswith(FLUID_LIMIT)
            limit = self.limited_by if named else FLUID_LIMIT
            self.limited_by = limit if fluid_rate >= wall_rate else "wall speed"
        dt = 1.0 / max(fluid_rate, solid_rate / parts, wall_rate)
        left = self.scene.time.end - self.time
        if dt >= left:
            self.limited_by = "end time"
        dt = min(dt, left)
        self.sub_steps = max(1, math.ceil(dt * solid_rate * (1.0 - 1e-12)))
        return dt, self.sub_steps

    def name_solid_limit(self) -> str:
        """Collective. What bounds the solid's steps."""
        return max(self.communicator.allgather(self.solid_limit), key=lambda limit: limit[0])[1]

    def name_limit(self) -> str:
        """Collective. What set the last time step; if the fluid did, where it was fastest and how fast. Progress tells
        it until the next step that is limited otherwise, or asked for."""
        if self.limited_by.startswith(FLUID_LIMIT):
            cells = self.communicator.allgather(self.fluid.fastest_cell(self.signals))
            self.limited_by = f"{FLUID_LIMIT}, {max(cells, key=lambda cell: (cell[0], *cell[1]))[2]}"
        return self.limited_by

    def check(self) -> None:
        """Collective. Raise Diverged on all ranks when the next step cannot start from the present state."""
        faults = self._faults(self.coupling.covered if self.coupling else None)
        if faults:
            raise Diverged(faults[0])

    def is_valid(self) -> bool:
        """Collective. Whether the next step can start from the present state."""
        return not self._faults(self.coupling.covered if self.coupling else None)

    def _faults(self, covered: np.ndarray | None = None) -> list[str]:
        """Collective. What the ranks tell of invalid states; cells that are `covered` may hold anything."""
        fault = ""
        try:
            if self.fluid:
                self.fluid.check(self.time, covered)
            if self.solid:
                self.solid.check(self.time)
        except Diverged as error:
            fault = str(error)
        return [fault for fault in self.communicator.allgather(fault) if fault]

    def kept(self) -> dict[str, Any]:
        """All that a restart file keeps by snapshot() and brings back by restore(snapshot), by name."""
        parts = {"simulation": self, "fluid": self.fluid, "solid": self.solid, "coupling": self.coupling}
        present = {name: part for name, part in parts.items() if part is not None}
        return present | {watcher.name: watcher for watcher in self.watchers}

    def snapshot(self) -> Snapshot:
        """What a restart needs besides the parts."""
        names = ("time", "steps", "loaded", "alone")
        return {"values": {name: np.array(getattr(self, name)) for name in names}}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        values = snapshot["values"]
        self.time, self.steps = float(values["time"]), int(values["steps"])
        self.loaded, self.alone = bool(values["loaded"]), bool(values["alone"])

    @property
    def done(self) -> bool:
        limit = self.scene.time.maximum_steps
        return self.time >= self.scene.time.end or (limit is not None and self.steps >= limit)

    def outputs(self) -> tuple[dict | None, dict | None]:
        """Collective. Fields of cells and particles for the output files."""
        covered = self.coupling.covered if self.coupling else None
        cells = self.fluid.outputs(covered) if self.fluid else None
        for watcher in self.watchers:
            if isinstance(watcher, Peaks):
                cells |= watcher.outputs(covered)
        if self.scene.output.schlieren:
            cells["schlieren"] = schlieren(self.fluid, covered)
        if self.solid is None:
            return cells, None
        self.solid.label_pieces()
        return cells, self.solid.outputs()


def deal_blocks(scene: Scene, communicator: Communicator, costs: np.ndarray | None = None) -> Blocks:
    """The blocks of the scene's domain, dealt to ranks by `costs`, or by the numbers of cells and particles."""
    domain = scene.domain
    grid = Grid.of(domain.lower, domain.upper, domain.cells, domain.boundaries, ghost_layers(scene))
    blocks = Blocks(grid, scene.performance.block_cells, communicator, costs)
    if scene.solid is None or costs is not None:
        return blocks
    cells = np.minimum(blocks.block_cells, np.array(grid.cells) - blocks.coordinates * blocks.block_cells)
    costs = cells.prod(axis=1).astype(float) if scene.fluid else np.ones(blocks.count)
    for body in scene.solid.bodies:
        positions, _ = pack(body, domain.lower, domain.upper)
        costs += COST_OF_PARTICLE * np.bincount(blocks.block_of(positions), minlength=blocks.count)
    return Blocks(grid, scene.performance.block_cells, communicator, costs)


def threads_of_rank(communicator: Communicator) -> int:
    """Cores this process may use, shared with the other ranks of the node that may use the same."""
    own = platform.node(), psutil.Process().cpu_affinity()
    return max(1, len(own[1]) // communicator.allgather(own).count(own))
