"""A simulation: the parts that a scene needs, time, and the loop's view of a step (distfsi/step.py)."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import psutil

from distfsi.coupling.cut_cells.cut_cells import CutCells
from distfsi.coupling.immersed_boundary.immersed_boundary import ImmersedBoundary
from distfsi.coupling.protocol import Coupling, ReleasesFluid
from distfsi.device.cpu import Cpu
from distfsi.device.interface import Device
from distfsi.device.timers import Timers
from distfsi.diagnostics.derived import DerivedFields
from distfsi.diagnostics.front import Front
from distfsi.diagnostics.gauges import GaugeRecorder
from distfsi.diagnostics.peaks import Peaks
from distfsi.diagnostics.schlieren import Schlieren
from distfsi.errors import Diverged, InputError, StepFailed, StepTooShort
from distfsi.fluid.fluid import Fluid
from distfsi.fluid.model import fluid_model, ghost_layers
from distfsi.mesh.blocks import Blocks, Grid, Snapshot
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.requests import Request
from distfsi.scene.description import Scene
from distfsi.scene.description import Solid as SolidScene
from distfsi.scene.packing import pack
from distfsi.solid.loads import Loads
from distfsi.solid.obstacles import Obstacles
from distfsi.solid.solid import Solid
from distfsi.solid.with_bars import SolidWithBars
from distfsi.solid.with_rigid import SolidWithRigid
from distfsi.step import Reason, TimeStep, find_forces, make_step, time_step

COUPLINGS: dict[str, Callable[..., Coupling]] = {
    "cut_cells": CutCells,
    "staircase": CutCells,
    "immersed_boundary": ImmersedBoundary,
}
COST_OF_PARTICLE = 30.0  # in cells, for the first deal of blocks to ranks

NOT_REDONE = "; a step of fluid and solid together is not redone with a smaller time step: try a smaller time.cfl"


@dataclass
class Simulation:
    """The parts of a scene on this rank, and the step that advances them.

    timers    count the parts of a step (distfsi/step.py)
    watchers  what looks at the state at the start and after every step: it has a `name`, `after_step(simulation)`,
              `snapshot()` and `restore(snapshot)`
    derived   fields of the cells for the output files, beside those of the fluid
    last_step the step made last
    first_step  the longest stable step [s] at the start
    named     what set steps, with the cell or particle, as it was named last
    loaded    whether the fluid has pressed on the solid by more than the scene's limit
    alone     whether by less since, so that it was dropped, and the solid goes on alone
    requested  what this rank is asked for; looked at once in every step
    """

    scene: Scene
    communicator: Communicator
    blocks: Blocks
    fluid: Fluid | None
    solid: Solid | None
    coupling: Coupling | None
    timers: Timers
    loads: Loads | None = None
    front: Front | None = None
    watchers: list[Peaks | GaugeRecorder] = field(default_factory=list)
    derived: list[DerivedFields] = field(default_factory=list)
    time: float = 0.0
    steps: int = 0
    last_step: TimeStep = TimeStep()
    first_step: float = 0.0
    named: dict[Reason, str] = field(default_factory=dict)
    loaded: bool = False
    alone: bool = False
    requested: Callable[[], Request] = lambda: Request.NOTHING

    @classmethod
    def of(
        cls,
        scene: Scene,
        communicator: Communicator,
        threads: int | None = None,
        costs: np.ndarray | None = None,
        device: Device | None = None,
        resumed: bool = False,
    ) -> Simulation:
        """Build the parts the scene needs, and no others.

        `costs`: those of the blocks where they are known; `device`: in the place of this rank's threads; `resumed`: a
        snapshot will be restored.
        """
        blocks = deal_blocks(scene, communicator, costs)
        device = device or Cpu(threads or threads_of_rank(communicator))
        model = fluid_model(scene) if scene.fluid else None
        fluid = Fluid(scene, model, blocks, device.with_own_clock(), resumed) if model else None
        parts = (scene, blocks, communicator, device.with_own_clock())
        solid = structure_of(scene.solid)(*parts) if scene.solid else None
        coupling: Coupling | None = None
        if model and fluid and solid:
            coupled = COUPLINGS[scene.coupling.scheme]
            coupling = coupled(scene, model, fluid, solid, blocks, device.with_own_clock())
        loads = Loads(scene, solid, device) if scene.loads and isinstance(solid, Solid) else None
        simulation = cls(scene, communicator, blocks, fluid, solid, coupling, Timers(device), loads)
        if fluid and isinstance(scene.time.front, float):
            simulation.front = Front(fluid, scene.time.front, present(scene.fluid).regions[0].state.pressure)
        if fluid and fluid.mapping:
            simulation.time = fluid.mapping.time
        if scene.output.peaks and fluid:
            peaks = Peaks(scene.output.peaks, fluid, coupling)
            simulation.watchers.append(peaks)
            simulation.derived.append(peaks)
        if scene.output.schlieren and fluid:
            simulation.derived.append(Schlieren(fluid))
        simulation.watchers += [GaugeRecorder(name, gauge, simulation) for name, gauge in scene.gauges.items()]
        return simulation

    @property
    def parts(self) -> list[Fluid | Solid | Coupling]:
        """Those that the scene needs."""
        return [part for part in (self.fluid, self.solid, self.coupling) if part is not None]

    def step(self) -> None:
        """Advance everything by one step."""
        try:
            made = self._advance()
        except StepTooShort:
            raise
        except Diverged as error:
            faults = self._faults() or [f"{error} at t = {self.time:.6g} s, after {self.steps} steps"]
            if isinstance(error, StepFailed):
                present(self.fluid).reject()
                raise Diverged(f"{faults[0]}; {error}") from error
            raise Diverged(faults[0] + (NOT_REDONE if self.coupling else "")) from error
        self.last_step = made
        self.time += made.dt
        self.steps += 1
        if made.reason not in self.named:
            self.name_limit()
        if self.front:
            self.front.look()
        self.watch()
        minimum = self.scene.coupling.drop_below
        if minimum is not None and not self.alone and isinstance(self.coupling, ReleasesFluid):
            self._end_loads(self.coupling, minimum)

    def _advance(self) -> TimeStep:
        """Plan a step and make it."""
        fluid, solid, coupling = self._active
        find_forces(solid, coupling, self.timers)
        planned = self.time_step()
        self._refuse_short(planned)
        return make_step(fluid, solid, coupling, self.loads, planned, self.timers)

    def _refuse_short(self, planned: TimeStep) -> None:
        """Collective. Raise StepTooShort where a step is planned that would never get to the end of the run."""
        self.first_step = self.first_step or planned.stable
        smallest = self.scene.time.smallest_step
        if planned.reason is not Reason.END and planned.stable < smallest * self.first_step:
            cause = planned.name_reason(self.fluid, self.communicator)
            when = f"at t = {self.time:.6g} s, after {self.steps} steps"
            limit = f"less than {smallest:g} of the first, {self.first_step:.3g} s (time.smallest_step)"
            raise StepTooShort(f"the stable time step is {planned.stable:.3g} s {when}, {limit}: {cause}")

    def time_step(self) -> TimeStep:
        """Collective. The longest step that all parts on all ranks can take now. Raises Diverged."""
        fluid, solid, coupling = self._active
        given = (self.time, self.scene.time, self.requested(), self.communicator, self.timers)
        with self.timers("time step"):
            return time_step(fluid, solid, coupling, *given)

    @property
    def dt(self) -> float:
        """[s] of the last step; 0 before the first."""
        return self.last_step.dt

    @property
    def _active(self) -> tuple[Fluid | None, Solid | None, Coupling | None]:
        """Fluid, solid and coupling as far as they are computed."""
        return (None, self.solid, None) if self.alone else (self.fluid, self.solid, self.coupling)

    def _end_loads(self, coupling: ReleasesFluid, minimum: float) -> None:
        """Collective. Drop the fluid when it pressed on the solid by `minimum` [Pa] and does no more."""
        pressure = coupling.pressure(self.dt)
        self.loaded = self.loaded or pressure >= minimum
        if self.loaded and pressure < minimum:
            self.alone = True
            coupling.let_fluid_leave()
            present(self.solid).given[:] = 0.0

    def watch(self) -> None:
        """Show the state to the watchers: once before the first step, then after each."""
        with self.timers("output"):
            for watcher in self.watchers:
                watcher.after_step(self)

    def check_restored(self) -> None:
        """Collective. Raise InputError on all ranks when a restart file has left a state from which no step can start,
        or when the samples of a gauge cannot be continued."""
        faults = self._faults(self.coupling.covered if self.coupling else None)
        if faults:
            raise InputError([f"the restart file holds no valid state: {faults[0]}"])
        for watcher in self.watchers:
            if isinstance(watcher, GaugeRecorder):
                watcher.check()

    def name_limit(self) -> str:
        """Collective. What set the last time step; if the fluid did, where it was fastest and how fast; if the solid
        did, which particle and why."""
        step = self.last_step
        self.named[step.reason] = step.name_reason(self.fluid, self.communicator)
        return self.named[step.reason]

    @property
    def limited_by(self) -> str:
        """What set the last time step, with the cell or particle that was named last, when it or one like it was."""
        return self.named.get(self.last_step.reason, str(self.last_step.reason))

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
        names = ("time", "steps", "first_step", "loaded", "alone")
        arrived = {"arrived": np.array(self.front.arrived)} if self.front else {}
        return {"values": {name: np.array(getattr(self, name)) for name in names} | arrived}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        values = snapshot["values"]
        self.time, self.steps = float(values["time"]), int(values["steps"])
        self.first_step = float(values["first_step"])
        self.loaded, self.alone = bool(values["loaded"]), bool(values["alone"])
        if self.front:
            self.front.arrived = bool(values["arrived"])

    @property
    def done(self) -> bool:
        limit, arrived = self.scene.time.maximum_steps, self.front is not None and self.front.arrived
        return self.time >= self.scene.time.end or arrived or (limit is not None and self.steps >= limit)

    def outputs(self) -> tuple[dict[str, np.ndarray] | None, dict[str, np.ndarray] | None]:
        """Collective. Fields of cells and particles for the output files."""
        covered = self.coupling.covered if self.coupling else None
        cells = self.fluid.outputs(covered) if self.fluid else None
        for derived in self.derived:
            cells = present(cells) | derived.outputs(covered)
        if self.solid is None:
            return cells, None
        self.solid.label_pieces()
        return cells, self.solid.outputs()


def structure_of(solid: SolidScene) -> type[Solid]:
    """The kind of structure that moves these bodies."""
    if solid.obstacles:
        return Obstacles
    if any(body.bars for body in solid.bodies):
        return SolidWithBars
    return SolidWithRigid if any(body.motion for body in solid.bodies) else Solid


def deal_blocks(scene: Scene, communicator: Communicator, costs: np.ndarray | None = None) -> Blocks:
    """The blocks of the scene's domain, dealt to ranks by `costs`, or by the numbers of cells and particles."""
    domain = scene.domain
    grid = Grid.of(domain.lower, domain.upper, domain.cells, domain.boundaries, ghost_layers(scene), domain.coordinates)
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
