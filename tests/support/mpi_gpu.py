"""Run by test_gpu.py on 1 and 2 ranks: fluids and solids on the CPU and on CUDA C on the host have the same bits."""

from __future__ import annotations

import copy
import sys
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from distfsi.device import cuda
from distfsi.device.cpu import Cpu
from distfsi.device.gpu import Gpu, Queue
from distfsi.device.host import HostArray, HostRuntime
from distfsi.errors import Diverged
from distfsi.mesh.communicator import Communicator, install_abort_on_exception
from distfsi.scene import load
from distfsi.scene.description import Ball, FluidState, HalfSpace, Peaks, Performance, Region
from distfsi.simulation import Simulation
from fluids import MATERIALS
from launch import ROOT
from mpi_solid import bursting_ball, colliding_discs, step
from tubes import scene_of

SCENES = {
    "tube": (("air",), 1, {}),
    "bubble": (("air", "helium"), 2, {"riemann": "adaptive", "reconstruction": "weno5"}),
    "bubble, float32": (("air", "helium"), 2, {"precision": "float32"}),
}
STEPS = 4
COARSE = (
    "domain.cells=[32, 32]",
    "performance.block_cells=[8, 8]",
    "solid.bodies.tube.spacing=1 mm",
    "output.peaks=true",
)
WAYS = ((True, False), (False, True))  # as late as their order allows or as early; messages of the host or the device
MOVES = (colliding_discs, 2)
SOLIDS = {colliding_discs: (20, WAYS), bursting_ball: (62, ((True, True),))}  # steps, ways


def scene(names, dimensions, **method):
    """A shock that meets a bubble, between symmetry planes, an outflow and a wall."""
    D = dimensions
    still = FluidState(0, 1.0, 1.0, (0.0,) * D)
    shocked = FluidState(0, 2.0, 4.0, (1.0,) + (0.0,) * (D - 1))
    bubble = FluidState(len(names) - 1, 0.2, 1.0, (0.0,) * D)
    cells, performance = ((64,), ((16,), (16,))) if D == 1 else ((48, 20), ((16, 8), (8, 8)))
    flow = scene_of(
        tuple(MATERIALS[name] for name in names),
        (
            Region(still, None),
            Region(bubble, Ball((0.5,) * D, 0.2)),
            Region(shocked, HalfSpace((0.25,) + (0.0,) * (D - 1), (1.0,) + (0.0,) * (D - 1))),
        ),
        (0.0,) * D,
        tuple(0.05 * n for n in cells),
        cells,
        100.0,
        boundaries=(("outflow", "wall"), ("symmetry", "symmetry"))[:D],
        performance=Performance(*performance),
        **method,
    )
    return replace(flow, output=replace(flow.output, peaks=Peaks(1.0, 0.01)))


def result(name, device):
    """State, peaks, time and books after some steps; and the state that a restart brings back, one step later."""
    names, dimensions, method = SCENES[name]
    communicator = watched(Communicator(), device)
    simulation = Simulation.of(scene(names, dimensions, **method), communicator, device=device)
    fluid, peaks = simulation.fluid, simulation.watchers[0].fields
    for _ in range(STEPS):
        simulation.step()
        fluid.exchange_ghosts(fluid.stages[0])
        fluid.exchange_ghosts(fluid.stages[0])
    cells = [fluid.cells(block).copy() for block in range(simulation.blocks.local_count)]
    kept = {name: {k: v.copy() for k, v in values.items()} for name, values in fluid.snapshot().items()}
    books = [*fluid.totals(), fluid.left_domain(), np.array([simulation.time, fluid.share_at_rest()])]
    simulation.step()
    fluid.restore(kept)
    again = [fluid.cells(block).copy() for block in range(simulation.blocks.local_count)]
    return [*cells, *books, *again, peaks.host(), faults_of(communicator)]


def solid_result(case, steps, device):
    """All columns, books and bounds of the time step after some steps of a solid."""
    part, _ = case(device, watched(Communicator(), device))
    for _ in range(steps):
        step(part)
    part.prepare()
    books = [*part.totals().values(), part.boundary_impulse(), np.array([part.gravity_work(), part.time_step()[0]])]
    part.label_pieces()
    return [*part.columns.values(), *map(np.atleast_1d, books), faults_of(part.communicator)]


def coupled_result(device, scheme="cut_cells", steps=50):
    """Fluid, particles, books and peaks of a coarse steel tube after some steps, and one after a restart there."""
    changes = (*COARSE, f"coupling.scheme={scheme}")
    communicator = watched(Communicator(), device)
    simulation = Simulation.of(load(ROOT / "inputs/steel_tube.toml", changes), communicator, 1, device=device)
    for _ in range(steps):
        simulation.step()
    state, snapshots = coupled_state(simulation), {n: part.snapshot() for n, part in simulation.kept().items()}
    snapshots = copy.deepcopy(snapshots)
    simulation.step()
    for name, part in simulation.kept().items():
        part.restore(snapshots[name])
    simulation.step()
    return [*state, *coupled_state(simulation), faults_of(communicator)]


def coupled_state(simulation):
    """What there is of it."""
    fluid, coupling = simulation.fluid, simulation.coupling
    cells = [fluid.cells(block).copy() for block in range(simulation.blocks.local_count)]
    books = [*fluid.totals(coupling.volume), *coupling.budget_by_cause().values(), np.array([simulation.time])]
    peaks = simulation.watchers[0].snapshot()["cells"]["fields"]
    columns = [column.copy() for column in simulation.solid.columns.values()]
    return [*cells, peaks.copy(), *columns, *books]


def same(results, expected):
    """Whether all ranks have the same bits."""
    mine = all(a.tobytes() == b.tobytes() for a, b in zip(results, expected, strict=True))
    return all(Communicator().allgather(mine))


class Messenger:
    """In the place of MPI's communicator: it counts the messages that the device may still work on, and those of the
    device's memory where there should be none, or none where there should be."""

    def __init__(self, world, device):
        self._world, self._device, self.too_early, self.direct, self.staged = world, device, 0, 0, 0

    def __getattr__(self, name):
        return getattr(self._world, name)

    def Isend(self, *arguments):
        return self._watched(self._world.Isend, *arguments)

    def Irecv(self, *arguments):
        return self._watched(self._world.Irecv, *arguments)

    def _watched(self, message, values, rank):
        self.too_early += not self._device.runtime.is_idle(Queue.ASYNCHRONOUS)
        self.direct += isinstance(values, HostArray)
        self.staged += values.dtype != np.uint8 and not isinstance(values, HostArray)
        return message(values, rank)

    @property
    def faults(self):
        wrong, right = (self.staged, self.direct) if self._device.direct else (self.direct, self.staged)
        return self.too_early + wrong + (right == 0 and self._world.size > 1)


def watched(communicator, device):
    """A communicator whose messages are watched, if the host stands in for a GPU."""
    if isinstance(device, Gpu) and isinstance(device.runtime, HostRuntime):
        communicator.world = Messenger(communicator.world, device)
    return communicator


def faults_of(communicator):
    """What was wrong with messages."""
    return np.array([getattr(communicator.world, "faults", 0)])


def check_scenes():
    """Every scene."""
    for name in SCENES:
        expected = result(name, Cpu(1))
        for late, direct in WAYS:
            assert same(result(name, Gpu(HostRuntime(late), direct)), expected), (name, late, direct)
        print(f"{name}: same bits")


def check_solids():
    """Collisions and a ball that bursts."""
    for case, (steps, ways) in SOLIDS.items():
        expected = solid_result(case, steps, Cpu(1))
        for way in ways:
            late, direct = way
            assert same(solid_result(case, steps, Gpu(HostRuntime(late), direct)), expected), (case.__name__, way)
        print(f"{case.__name__}: same bits")


def check_coupled():
    """A coupled scene with peaks, as late as the order allows, with messages of the device."""
    for case in (("cut_cells", 50), ("immersed_boundary", 20)):
        assert same(coupled_result(Gpu(HostRuntime(), True), *case), coupled_result(Cpu(1), *case)), case
        print(f"coupled by {case[0]}: same bits")


def nothing(*_, **__):
    """In the place of something that is needed."""


def check_gpu():
    """Every scene on the GPUs of this node."""
    gpu, name_of_gpu = partial(cuda.gpu_of, Communicator().local_rank), cuda.gpu_name(0)
    for name in SCENES:
        assert same(result(name, gpu()), result(name, Cpu(1))), name
        print(f"{name}: same bits on {name_of_gpu}")
    others = [partial(solid_result, case, steps) for case, (steps, _) in SOLIDS.items()] + [coupled_result]
    for other in others:
        assert close(other(gpu()), other(Cpu(1)))
        print(f"solid: close on {name_of_gpu}")


def close(results, expected):
    """Whether all ranks have nearly the same; the last bits of powers and logarithms are the library's."""
    pairs = [(a.astype(float), b.astype(float)) for a, b in zip(results, expected, strict=True)]
    mine = all(np.allclose(a, b, rtol=0.0, atol=1e-8 * np.abs(b).max(initial=0.0)) for a, b in pairs)
    return all(Communicator().allgather(mine))


def check_mutants():
    """Without one of the waits, copies and orders something comes out otherwise, or a message goes too early."""
    cases = (("", partial(result, "bubble"), MUTANTS), ("particles ", partial(solid_result, *MOVES), SOLID_MUTANTS))
    for what, case, mutants in cases:
        expected = case(Cpu(1))
        for (name, take_away), direct in product(mutants.items(), (False, True)):
            if not (direct and "copy" in name):
                assert is_found(case, expected, take_away, direct), (what, name, direct)
                print(f"{what}without {name}{', direct' if direct else ''}: found")


def is_found(case, expected, take_away, direct):
    """Whether a case comes out otherwise when something is taken away."""
    gpu = Gpu(HostRuntime(), direct)
    gpu.with_own_clock = lambda: gpu
    take_away(gpu)
    try:
        return not same(case(gpu), expected)
    except Diverged:  # on all ranks
        return True


def check_fatal():
    """Without the order before packing rows are packed that are not there yet; what comes of that may kill."""
    case = partial(solid_result, *MOVES)
    expected = case(Cpu(1))
    assert same(case(Gpu(HostRuntime())), expected)
    print("begun", flush=True)
    assert not is_found(case, expected, without_order(Queue.ASYNCHRONOUS), False)


def without(name):
    """Takes a method of the device away."""
    return lambda gpu: setattr(gpu, name, lambda *_: None)


def without_order(queue):
    """Takes the waits of a queue for the other one away."""

    def take_away(gpu):
        order = gpu.runtime.order
        gpu.runtime.order = lambda first, then: None if then is queue else order(first, then)

    return take_away


def without_wait_of_get(gpu):
    """The host looks at once."""
    gpu._wait = lambda queue: gpu.runtime.synchronise(queue) if queue is Queue.ASYNCHRONOUS else None


MUTANTS = {
    "the wait before messages": without("finish_asynchronous"),
    "the copy of what is sent": without("download_to"),
    "the copy of what came": without("upload"),
    "the wait for the ghosts": without_order(Queue.MAIN),
    "the wait for the cells": without_order(Queue.ASYNCHRONOUS),
    "the wait before looking": without_wait_of_get,
}
SOLID_MUTANTS = {
    "the wait before messages": without("finish_asynchronous"),
    "the copy of what is sent": without("download_to"),
    "the copy of what came": without("upload"),
    "the wait for the ghosts": without_order(Queue.MAIN),
}


if __name__ == "__main__":
    install_abort_on_exception(Communicator())
    checks = {"scenes": check_scenes, "solids": check_solids, "coupled": check_coupled, "mutants": check_mutants}
    (checks | {"gpu": check_gpu, "fatal": check_fatal})[sys.argv[1]]()
