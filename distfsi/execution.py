"""A run: the loop over time, what it writes and what ends it."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.device.cache import cache_faults
from distfsi.device.cpu import Cpu
from distfsi.device.cuda import NoGpu, gpu_of
from distfsi.device.gpu import Gpu
from distfsi.device.interface import Device
from distfsi.device.native import compilation
from distfsi.device.nvrtc import CompileError
from distfsi.device.timers import Timers
from distfsi.diagnostics.budget import Budget
from distfsi.diagnostics.performance import Performance
from distfsi.direct import arrives, refusal
from distfsi.errors import Diverged, InputError, Stopped
from distfsi.memory import shortage
from distfsi.mesh.balance import Balance, Handover
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.directory import held
from distfsi.output.journal import Journal
from distfsi.output.manifest import begin, claim, in_the_way, resume, set_aside, size_of
from distfsi.output.progress import Progress
from distfsi.output.records import Records
from distfsi.output.requests import Request, Requests
from distfsi.output.restart import Restart, find_restart
from distfsi.output.status import Status
from distfsi.output.storage import on_root, storage
from distfsi.scene.description import Scene
from distfsi.scene.warnings import warnings
from distfsi.simulation import Simulation, threads_of_rank
from distfsi.step import parts_of

STEPS_BETWEEN_DEALS = 100
STEPS_TO_COMPILE = 2  # the second one goes on from the state that the first one leaves


def gpu_of_rank(communicator: Communicator, direct: bool = False) -> Device:
    """Collective. The GPU on which this rank computes. Raises InputError on all ranks where one has none.

    `direct`: messages are to lie in the GPU's memory.
    """
    gpu: Gpu | None = None
    faults: list[str] = []
    try:
        gpu = gpu_of(communicator.local_rank, direct)
    except (NoGpu, CompileError) as error:
        faults.append(f"--gpu: {error}")
    _refuse(faults, communicator)
    if direct:
        why = refusal(communicator)
        _refuse([f"--gpu-aware-mpi: {why}"] if why else [], communicator)
        if not arrives(communicator, present(gpu)):
            raise InputError(["--gpu-aware-mpi: messages between ranks arrive otherwise than they were sent"])
    return present(gpu)


def _refuse(faults: list[str], communicator: Communicator) -> None:
    """Collective. Raise InputError on all ranks when one has faults."""
    faults = [fault for others in communicator.allgather(faults) for fault in others]
    if faults:
        raise InputError(sorted(set(faults)))


def compile_kernels(scene: Scene, communicator: Communicator) -> int:
    """Compile what the first steps of a scene need; how many kernels were not yet on disk. Nothing is written."""
    _refuse(cache_faults(), communicator)
    for stage in scene.stages:
        compile_kernels(stage, communicator)
    simulation = Simulation.of(scene, communicator, resumed=True)  # from what need not be there yet
    budget = Budget(simulation.fluid, simulation.solid, simulation.coupling)
    simulation.watch()
    for _ in range(STEPS_TO_COMPILE):
        simulation.step()
    budget.summary(simulation)
    return compilation.made


def run(
    scene: Scene,
    communicator: Communicator,
    threads: int | None = None,
    restart: str | None = None,
    on_gpu: bool = False,
    direct: bool = False,
) -> Simulation:
    """Run the scene to its end, writing fields, history, restart files and a picture into its output directory.

    `restart`: a restart file to go on from, or "auto": the newest in the output directory; without one from the start.
    `on_gpu`: compute on the node's GPUs, rank by rank, in the place of threads; `direct`: with messages straight from
    their memory.
    Raises on all ranks: InputError for a restart file of another scene and for a directory that is not the run's,
    OutputError, Diverged, and Stopped when a signal, the stop file or the wall-clock limit has ended the run early.
    """
    for stage in scene.stages:
        run(stage, communicator, threads, "auto" if restart else None, on_gpu, direct)
    started = clock.perf_counter()
    directory, output = Path(scene.output.directory), scene.output
    requests = Requests(directory / output.stop_file, scene.time.wall_clock_limit, output.restart_every, communicator)
    files = storage(output.hdf5, communicator)
    _refuse([*cache_faults(), *filter(None, [shortage(scene, communicator)])], communicator)
    status = Status(directory, communicator)
    progress = Progress(scene.time.end, communicator, status)
    for note in scene.notes:
        progress.say(note)
    if communicator.rank == 0:
        for text in warnings(scene):
            progress.say(f"warning: {text}")
    threads = threads or threads_of_rank(communicator)
    device = gpu_of_rank(communicator, direct) if on_gpu else Cpu(threads)
    timers, costs = Timers(device), None
    performance = Performance(parts_of(scene), timers, communicator)
    journal = Journal(directory, scene, communicator, threads, performance.sums)
    with (
        requests,
        held(directory, communicator),
        threadpool_limits(1),
        closing(progress),
        compilation.announced(progress.compiling),
    ):
        requests.check_stop_file()
        origin: Restart | Handover | None = _origin(restart, scene, communicator)
        identity = ""
        with ExitStack() as noted:
            while True:
                simulation = Simulation.of(scene, communicator, threads, costs, device, resumed=origin is not None)
                simulation.requested, simulation.timers = requests.strongest, timers
                budget = Budget(simulation.fluid, simulation.solid, simulation.coupling)
                records = Records(simulation, budget, performance, files)
                kept = simulation.kept() | {"budget": budget, "records": records}
                if origin:
                    origin.restore(kept, simulation.blocks, communicator)
                if not identity:
                    # Nothing has been touched yet, and all that can be wrong with scene, device and files is known now.
                    if origin:
                        simulation.check_restored()
                        records.check(origin)
                    identity = _take_over(directory, origin is not None, communicator)
                    noted.enter_context(journal)
                    noted.enter_context(status)
                records.open(identity, origin)
                if not origin:
                    if simulation.fluid and simulation.fluid.mapping:
                        progress.say("\n".join(simulation.fluid.mapping.lines()))
                    simulation.watch()
                    records.write()
                costs = advance(simulation, records, kept, requests, progress)
                if costs is None:
                    if scene.domain.coordinates.radial:
                        records.write_restart(kept)  # another run may go on from it in more dimensions
                    break
                snapshots = {name: part.snapshot() for name, part in kept.items()}
                origin = Handover(simulation.time, simulation.steps, records.restart, snapshots)
                del simulation, budget, records, kept, snapshots  # before those of the new owners are built
        _report(simulation, budget, progress, clock.perf_counter() - started)
    return simulation


def _origin(restart: str | None, scene: Scene, communicator: Communicator) -> Restart | None:
    """Collective. The restart file to go on from, if any. Raises InputError on all ranks when there is none that fits
    the scene and the output directory, or when files are in the directory that the run would overwrite."""
    directory = Path(scene.output.directory)
    foreign = on_root(communicator, directory, lambda: in_the_way(directory, scene.gauges))
    text = "no run has made it, and this one would overwrite it; move it away or choose another output.directory"
    _refuse([f"{path}: {text}" for path in foreign], communicator)
    return find_restart(restart, directory, scene, communicator)


def _take_over(directory: Path, goes_on: bool, communicator: Communicator) -> str:
    """Collective. Make the directory this run's: go on with the results in it, or move those of an earlier run aside.

    Returns the run's identity. Raises OutputError on all ranks.
    """

    def take_over() -> str:
        if goes_on:
            return resume(directory)
        earlier = set_aside(directory)
        if earlier is not None:
            from distfsi.output.scales import format_bytes  # with matplotlib, which takes a while

            size = format_bytes(size_of(earlier))
            hint = f"distfsi clean {directory} removes what was set aside"
            print(f"the results of an earlier run are now in {earlier} ({size}); {hint}", flush=True)
        return begin(directory)

    return on_root(communicator, directory, take_over)


def _report(simulation: Simulation, budget: Budget, progress: Progress, seconds: float) -> None:
    """Collective. Say how the run has ended, and draw its picture; a failure is told, but the results are there."""
    communicator, directory = simulation.communicator, Path(simulation.scene.output.directory)
    done = f"done: t = {simulation.time:.6g} s after {simulation.steps} steps in {seconds:.1f} s."
    fluid = simulation.fluid
    rest = f" {100 * fluid.share_at_rest():.0f} % of the tile stages were at rest." if fluid else ""
    progress.finish(f"{done} {budget.summary(simulation)}{rest}")
    if communicator.rank > 0:
        return
    results = f"results in {directory}"
    try:
        from distfsi.output.picture import draw_summary

        claim(directory / "summary.png")
        results += f", picture in {draw_summary(directory)}"
    except Exception as error:  # whatever it is, it comes after the results
        progress.say(f"warning: no picture could be drawn: {type(error).__name__}: {error}")
    progress.say(results)


def advance(
    simulation: Simulation, records: Records, kept: Mapping[str, Any], requests: Requests, progress: Progress
) -> np.ndarray | None:
    """The loop over time: step, write what is due, do what was asked for. Raises Diverged and Stopped.

    None at the end of the run; before it the costs (count,) of the blocks, if they should change hands.
    """
    balance = Balance(simulation.parts, simulation.blocks)
    while not simulation.done:
        alone = simulation.alone
        try:
            simulation.step()
            request = simulation.last_step.request
            at_end = simulation.done and simulation.scene.output.restart_at_end
            saving = at_end or (request is not Request.NOTHING and not simulation.done)
            if saving:
                with simulation.timers("output"):
                    simulation.check()
        except Diverged as error:
            records.write_fields()
            if simulation.is_valid():
                records.write_restart(kept)
            raise Diverged(f"{error}\n{records.left_behind()}") from error
        if simulation.alone > alone:
            when = f"t = {simulation.time:.6g} s, after {simulation.steps} steps"
            why = f"its pressure on the solid is below {simulation.scene.coupling.drop_below:g} Pa everywhere"
            progress.say(f"the fluid is dropped at {when}: {why} (coupling.drop_below); the solid goes on alone")
        records.write(always=simulation.done)
        progress.update(simulation.steps, simulation.time, simulation.dt, simulation.limited_by)
        if saving:
            path = records.write_restart(kept)
            requests.saved()
            if request.stops and not simulation.done:
                requests.remove_stop_file()
                when = f"at t = {simulation.time:.6g} s after {simulation.steps} steps"
                remedy = "the same command with --restart auto goes on"
                raise Stopped(f"stopped {when} by {requests.words(request)}, state in {path}; {remedy}")
        if simulation.steps % STEPS_BETWEEN_DEALS == 0 and simulation.communicator.size > 1:
            costs = balance.watch(simulation.scene.performance.imbalance)
            records.write_balance(balance.imbalance, changes_hands=costs is not None)
            if costs is not None:
                return costs
    return None
