"""The run: the parts a scene needs, the step functions, the loop over time."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
from threadpoolctl import threadpool_limits

from distfsi.device.cpu import Team
from distfsi.errors import Diverged
from distfsi.mesh.blocks import Blocks, Grid
from distfsi.mesh.communicator import Communicator
from distfsi.model import fluid_model
from distfsi.output.fields import FieldWriter
from distfsi.output.history import History
from distfsi.output.picture import draw_summary
from distfsi.output.progress import Progress
from distfsi.output.schedule import Every
from distfsi.parts.accounts import Accounts
from distfsi.parts.coupling import Coupling
from distfsi.parts.fluid import SSP_RK3, Fluid
from distfsi.parts.solid import Solid
from distfsi.scene.description import Scene
from distfsi.scene.packing import pack

COST_OF_PARTICLE = 30.0  # in cells, for dealing blocks to ranks

TimeStep = Callable[[], float]


def fluid_step(fluid: Fluid, time_step: TimeStep) -> float:
    """Advance the fluid by one step and return it [s]."""
    dt = time_step()
    for stage in SSP_RK3:  # paper, Eq. 16
        fluid.advance_stage(stage, dt)  # MUSCL, HLLC, update and relaxation: Eqs. 11-30
    return dt


def solid_step(solid: Solid, time_step: TimeStep) -> float:
    """Advance the solid by one step and return it [s]."""
    solid.prepare()
    dt = time_step()
    solid.advance(dt)  # Eqs. 5-7
    solid.migrate()
    return dt


def coupled_step(fluid: Fluid, solid: Solid, coupling: Coupling, time_step: TimeStep) -> float:
    """Advance fluid and solid together by one step and return it [s] (paper, Sec. 4 and Fig. 4)."""
    solid.prepare(coupling.reach)
    coupling.classify()
    for stage in SSP_RK3:
        fluid.exchange_ghosts(stage)
        coupling.fill(stage)  # Eqs. 31, 32
        if stage is SSP_RK3[0]:
            dt = time_step()
        fluid.advance_stage(stage, dt)
        coupling.collect_force(stage, dt)  # Eqs. 33, 35
    solid.advance(dt, coupling.impulse())  # Eqs. 5-7, 34
    coupling.book_work()
    solid.migrate()
    return dt


@dataclass
class Simulation:
    """The parts of a scene on this rank, and the step that advances them."""

    scene: Scene
    communicator: Communicator
    blocks: Blocks
    fluid: Fluid | None
    solid: Solid | None
    coupling: Coupling | None
    time: float = 0.0
    steps: int = 0
    dt: float = 0.0
    limited_by: str = "start"

    @classmethod
    def of(cls, scene: Scene, communicator: Communicator, threads: int | None = None) -> Simulation:
        """Build the parts the scene needs, and no others."""
        blocks = deal_blocks(scene, communicator)
        team = Team(threads or threads_of_rank(communicator))
        model = fluid_model(scene) if scene.fluid else None
        fluid = Fluid(scene, model, blocks, team) if scene.fluid else None
        solid = Solid(scene, blocks, communicator, team) if scene.solid else None
        coupling = Coupling(scene, model, fluid, solid, blocks, team) if fluid and solid else None
        return cls(scene, communicator, blocks, fluid, solid, coupling)

    def step(self) -> None:
        """Advance everything by one step."""
        parts = [part for part in (self.fluid, self.solid, self.coupling) if part is not None]
        step = coupled_step if self.coupling else fluid_step if self.fluid else solid_step
        self.dt = step(*parts, self.time_step)
        self.time += self.dt
        self.steps += 1

    def time_step(self) -> float:
        """The longest stable step [s] of all parts on all ranks. Raises Diverged when a part has no valid state."""
        signal = self.fluid.fastest_signal() if self.fluid else 0.0
        solid_dt, solid_reason = self.solid.time_step() if self.solid else (np.inf, "")
        rates = np.array([signal / self.scene.time.cfl, 1.0 / solid_dt])
        fluid_rate, solid_rate = self.communicator.maximum(rates)
        if not np.isfinite(fluid_rate) or not np.isfinite(solid_rate):
            self._explain()
        if solid_rate > fluid_rate:
            holder = [
                reason for rate, reason in self.communicator.allgather((rates[1], solid_reason)) if rate == solid_rate
            ]
            self.limited_by = holder[0]
        else:
            self.limited_by = "fluid CFL"
        dt = 1.0 / max(fluid_rate, solid_rate)
        left = self.scene.time.end - self.time
        if dt >= left:
            self.limited_by = "end time"
        return min(dt, left)

    def _explain(self) -> None:
        """Raise Diverged with what the rank that sees it can tell."""
        message = ""
        try:
            if self.fluid:
                self.fluid.check(self.time)
        except Diverged as error:
            message = str(error)
        known = [text for text in self.communicator.allgather(message) if text]
        raise Diverged(known[0] if known else f"the time step vanished at t = {self.time:.6g} s, step {self.steps}")

    @property
    def done(self) -> bool:
        limit = self.scene.time.maximum_steps
        return self.time >= self.scene.time.end or (limit is not None and self.steps >= limit)

    def outputs(self) -> tuple[dict | None, dict | None]:
        """Fields of cells and particles for the output files."""
        covered = self.coupling.covered if self.coupling else None
        cells = self.fluid.outputs(covered) if self.fluid else None
        return cells, self.solid.outputs() if self.solid else None


def deal_blocks(scene: Scene, communicator: Communicator) -> Blocks:
    """The blocks of the scene's domain, dealt to ranks by cells and particles."""
    domain = scene.domain
    grid = Grid.of(domain.lower, domain.upper, domain.cells, domain.boundaries)
    blocks = Blocks(grid, scene.performance.block_cells, communicator)
    if scene.solid is None:
        return blocks
    cells = np.minimum(blocks.block_cells, np.array(grid.cells) - blocks.coordinates * blocks.block_cells)
    costs = cells.prod(axis=1).astype(float) if scene.fluid else np.ones(blocks.count)
    for body in scene.solid.bodies:
        positions, _ = pack(body, domain.lower, domain.upper)
        costs += COST_OF_PARTICLE * np.bincount(blocks.block_of(positions), minlength=blocks.count)
    return Blocks(grid, scene.performance.block_cells, communicator, costs)


def threads_of_rank(communicator: Communicator) -> int:
    """Cores this process may use, shared with the other ranks of the node."""
    return max(1, len(psutil.Process().cpu_affinity()) // communicator.local_size)


def run(scene: Scene, communicator: Communicator, threads: int | None = None) -> Simulation:
    """Run the scene to its end, writing fields, history and a picture into its output directory."""
    started = clock.perf_counter()
    with threadpool_limits(1):
        simulation = Simulation.of(scene, communicator, threads)
    directory = Path(scene.output.directory)
    writer = FieldWriter(directory, simulation.blocks, communicator)
    accounts = Accounts(simulation.fluid, simulation.solid, simulation.coupling)
    history = History(directory / "history.csv", accounts.columns, communicator)
    progress = Progress(scene.time.end, communicator)
    fields_due, frame = Every(scene.output.fields_every), 0

    def record(always: bool = False) -> None:
        nonlocal frame
        if fields_due.due(simulation.time) or always:
            writer.write(frame, simulation.time, *simulation.outputs())
            frame += 1
        if simulation.steps % scene.output.history_every == 0 or always:
            history.append(accounts.row(simulation))

    record()
    while not simulation.done:
        simulation.step()
        record(always=simulation.done)
        progress.update(simulation.steps, simulation.time, simulation.dt, simulation.limited_by)
    elapsed = clock.perf_counter() - started
    progress.finish(
        f"done: t = {simulation.time:.6g} s after {simulation.steps} steps in {elapsed:.1f} s. {accounts.summary(simulation)}"
    )
    if communicator.rank == 0:
        print(f"results in {directory}, picture in {draw_summary(directory)}", flush=True)
    return simulation
