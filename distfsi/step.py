"""The time step as the paper tells it (Sec. 4 and Fig. 4): how long it may be, and what it does, in order.

Forces between particles come first, since they bound the step. `time_step` then plans one and changes nothing; a step
function makes it, or a shorter one, and returns the one it has made. Its parts are timed by their names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from distfsi.coupling.cut_cells.cut_cells import FARTHEST_MOVE, LARGEST_MOVE
from distfsi.coupling.protocol import Coupling
from distfsi.device.timers import Timers
from distfsi.errors import Diverged, StepFailed
from distfsi.fluid.fluid import Fluid
from distfsi.fluid.stages import Stage
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.requests import Request
from distfsi.scene.description import Scene, Time
from distfsi.solid.loads import Loads
from distfsi.solid.protocol import Structure

# Parts of a step by what is there, as timers count them; what is written and sampled between steps is "output".
FLUID_PARTS = ("exchange", "stage")
SOLID_PARTS = ("solid",)
COUPLING_PARTS = ("geometry", "merge", "flux", "forces")

SUB_STEP_SLACK = 1.1  # by how much the solid's limit may fall during its sub-steps
ATTEMPTS = 8  # at a step of the fluid, each with half the time step of the one before


class Reason(StrEnum):
    """What sets a time step; `TimeStep.name_reason` tells the cell or the particle, too."""

    START = "start"
    FLUID = "fluid CFL"
    SOLID = "solid"
    WALL = "wall speed"
    SUB_STEPS = "sub-steps of the solid"
    REJECTED = "rejected step"
    END = "end time"


@dataclass(frozen=True, eq=False)
class TimeStep:
    """A step in time: one that is planned, or one that has been made. By default the one before the first.

    dt         [s]
    stable     the longest stable one [s]; dt is shorter at the end of the run, and where it did not go as planned
    sub_steps  in how many equal parts a coupled solid takes it
    start      when it begins [s]
    request    the strongest of what all ranks were asked for when it was planned
    signals    (local blocks,) fastest signals [1/s] of this rank's fluid before it
    particle   of this rank's particles the one that needs the shortest step: its rate [1/s], and why
    """

    dt: float = 0.0
    stable: float = 0.0
    sub_steps: int = 0
    start: float = 0.0
    reason: Reason = Reason.START
    request: Request = Request.NOTHING
    signals: np.ndarray | None = None
    particle: tuple[float, str] = (0.0, "")

    def name_reason(self, fluid: Fluid | None, communicator: Communicator) -> str:
        """Collective, before the next step. What set the step: if the fluid did, where it was fastest and how fast; if
        the solid did, which particle and why."""
        if self.reason is Reason.FLUID:
            cells = communicator.allgather(present(fluid).fastest_cell(present(self.signals)))
            return f"{self.reason}, {max(cells, key=lambda cell: (cell[0], *cell[1]))[2]}"
        return self.name_particle(communicator) if self.reason is Reason.SOLID else str(self.reason)

    def name_particle(self, communicator: Communicator) -> str:
        """Collective. What bounds the solid's sub-steps."""
        return max(communicator.allgather(self.particle), key=lambda limit: limit[0])[1]


def parts_of(scene: Scene) -> tuple[str, ...]:
    """The parts that the steps of a scene have."""
    fluid, solid = scene.fluid is not None, scene.solid is not None
    between = FLUID_PARTS * fluid + COUPLING_PARTS * (fluid and solid) + SOLID_PARTS * solid
    return ("time step", *between, "output")


def time_step(
    fluid: Fluid | None,
    solid: Structure | None,
    coupling: Coupling | None,
    time: float,
    limits: Time,
    request: Request,
    communicator: Communicator,
    timers: Timers,
) -> TimeStep:
    """Collective, after find_forces(). The longest stable step of all parts on all ranks from `time` [s] on, within the
    `limits` of the scene.

    `request`: what this rank is asked for; it rides in the same reduction. Raises Diverged on all ranks when a part has
    no valid state.
    """
    signal = fluid.fastest_signal() if fluid else 0.0
    particle_dt, particle = solid.time_step() if solid else (np.inf, "")
    with timers("geometry"):
        wall_dt = coupling.time_step() if coupling else np.inf
    rates = np.array([signal / limits.cfl, 1.0 / particle_dt, 1.0 / wall_dt, request])
    fluid_rate, solid_rate, wall_rate, strongest = communicator.maximum(rates)
    if not np.isfinite(fluid_rate) or not np.isfinite(solid_rate):
        raise Diverged("there is no stable time step")
    maximum = coupling.sub_steps if coupling else 1
    rate_of = {Reason.FLUID: fluid_rate, Reason.WALL: wall_rate, Reason.SOLID: solid_rate / maximum}
    reason = max(rate_of, key=rate_of.__getitem__)
    stable = 1.0 / rate_of[reason] if rate_of[reason] else np.inf  # nothing is left that could bound it
    left = limits.end - time
    dt = min(stable, left)
    reason = reason if stable < left else Reason.END
    sub_steps = max(1, math.ceil(dt * solid_rate * (1.0 - 1e-12)))
    signals = fluid.signals.copy() if fluid else None
    limit, request = (1.0 / particle_dt, particle), Request(int(strongest))
    return TimeStep(dt, stable, sub_steps, time, reason, request, signals, limit)


def find_forces(solid: Structure | None, coupling: Coupling | None, timers: Timers) -> None:
    """Collective. Find each particle's neighbours and the forces between them."""
    with timers("solid"):
        if coupling:
            present(solid).prepare(coupling.reach, coupling.stray)
        elif solid:
            solid.prepare()


def make_step(
    fluid: Fluid | None,
    solid: Structure | None,
    coupling: Coupling | None,
    loads: Loads | None,
    planned: TimeStep,
    timers: Timers,
) -> TimeStep:
    """Collective. Make the planned step of the parts that there are. Raises Diverged."""
    if coupling:
        return coupled_step(present(fluid), present(solid), coupling, planned, timers)
    return fluid_step(fluid, planned, timers) if fluid else solid_step(present(solid), loads, planned, timers)


def fluid_step(fluid: Fluid, planned: TimeStep, timers: Timers) -> TimeStep:
    """Advance the fluid by one step; one that leaves no valid state is redone with half of it. Raises StepFailed."""
    dt = planned.dt
    for attempt in range(ATTEMPTS):
        if attempt:
            fluid.reject()
            dt *= 0.5
        fluid.begin_step()
        fluid.average_sources(planned.start, dt)
        for stage in fluid.stages:  # Eq. 16
            advance_stage(fluid, stage, dt, timers)
        react(fluid, planned.start, dt, timers)
        with timers("time step"):  # its signals are those of the next step
            valid = fluid.is_valid()
        if valid:
            return replace(planned, dt=dt, reason=Reason.REJECTED) if attempt else planned
    raise StepFailed(f"{ATTEMPTS} attempts failed, the last with a step of {dt:.3g} s")


def solid_step(solid: Structure, loads: Loads | None, planned: TimeStep, timers: Timers) -> TimeStep:
    """Advance the solid by one step."""
    solid.body_force.average_over(planned.start, planned.dt)
    with timers("solid"):
        solid.advance(planned.dt)  # Eqs. 5-7
        if loads:
            loads.bear(planned.start, planned.dt)
        solid.migrate()
    return planned


def coupled_step(fluid: Fluid, solid: Structure, coupling: Coupling, planned: TimeStep, timers: Timers) -> TimeStep:
    """Advance fluid and solid together by one step."""
    with timers("solid"):
        made = sub_cycle(solid, coupling, planned)  # Eqs. 5-7
    with timers("geometry"):
        geometry = coupling.update_geometry()
    fluid.average_sources(made.start, made.dt)
    for stage in fluid.stages:  # Eq. 16
        with timers("merge"):
            cells = coupling.merge(geometry, stage)
        advance_stage(fluid, stage, made.dt, timers)
        with timers("flux"):
            coupling.apply_wall_fluxes(geometry, cells, stage, made.dt)
    with timers("merge"):
        coupling.redistribute(geometry)
    with timers("forces"):
        transfer = coupling.transfer_impulse(geometry, cells, made.dt)
    with timers("solid"):
        excess = solid.apply_impulse(transfer.impulse)  # Eq. 34
    with timers("forces"):
        coupling.account_work(geometry, transfer, excess)
    react(fluid, made.start, made.dt, timers)
    with timers("solid"):
        solid.migrate()
    return made


def advance_stage(fluid: Fluid, stage: Stage, dt: float, timers: Timers) -> None:
    """Advance the fluid by one Runge-Kutta stage; tiles that need no other rank are computed while messages travel."""
    with timers("exchange"):
        fluid.start_exchange(stage)
    with timers("stage"):  # reconstruction, flux, update and relaxation: Eqs. 11-30
        fluid.begin_stage()
        fluid.account_force(stage, dt)
        fluid.advance_tiles(fluid.ready_tiles, stage, dt)
    with timers("exchange"):
        fluid.finish_exchange()
    with timers("stage"):
        fluid.advance_tiles(fluid.waiting_tiles, stage, dt)
        fluid.end_stage(stage)


def react(fluid: Fluid, start: float, dt: float, timers: Timers) -> None:
    """What burns in a step of `dt` [s] from `start` [s] on burns at its end."""
    if fluid.reactions:
        with timers("stage"):
            fluid.wake(fluid.reactions.advance(fluid.device_state, start + dt, dt))


def sub_cycle(solid: Structure, coupling: Coupling, planned: TimeStep) -> TimeStep:
    """Advance the solid in equal sub-steps, with no force of the fluid meanwhile.

    The step is shorter than planned when the solid's own limit has fallen below a sub-step, or when another one would
    take it too far.
    """
    part, way = planned.dt / planned.sub_steps, 0.0
    for done in range(planned.sub_steps):
        if done:
            solid.prepare(coupling.reach, coupling.stray, goes_on=True)
        if planned.sub_steps > 1:
            rates = np.array([1.0 / solid.time_step()[0], 1.0 / coupling.time_step()])
            solid_rate, wall_rate = part * solid.communicator.maximum(rates)
            if done and not (solid_rate < SUB_STEP_SLACK and way + wall_rate < FARTHEST_MOVE / LARGEST_MOVE):
                return replace(planned, dt=done * part, sub_steps=done, reason=Reason.SUB_STEPS)
            way += wall_rate
        solid.body_force.average_over(planned.start + done * part, part)
        solid.advance(part)
    return planned
