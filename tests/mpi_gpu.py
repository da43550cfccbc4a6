"""Run by test_gpu.py on 1 and 2 ranks: fluids and solids on the CPU and on CUDA C on the host have the same bits."""

from __future__ import annotations

import copy
import sys
from functools import partial
from itertools import cycle

import numpy as np

from distfsi.device import cuda
from distfsi.device.cpu import Team
from distfsi.device.gpu import Gpu, Queue
from distfsi.device.host import HostRuntime
from distfsi.errors import Diverged
from distfsi.mesh.communicator import Communicator, install_abort_on_exception
from distfsi.scene import load
from distfsi.scene.description import Ball, FluidState, HalfSpace, Performance, Region
from distfsi.simulation import Simulation
from fluids import MATERIALS
from launch import ROOT
from mpi_solid import bursting_ball, colliding_discs, step
from tubes import scene_of

SCENES = {
    "tube": (("air",), 1, {}),
    "bubble": (("air", "helium"), 2, {"riemann": "adaptive"}),
    "bubble, float32": (("air", "helium"), 2, {"precision": "float32"}),
}
STEPS = 4
COARSE = (
    "domain.cells=[32, 32]",
    "performance.block_cells=[8, 8]",
    "solid.bodies.tube.spacing=1 mm",
    "output.peaks=true",
)
SOLIDS = {colliding_discs: (20, (True, False)), bursting_ball: (62, (True,))}  # steps, late or not


def scene(names, dimensions, **method):
    """A shock that meets a bubble, between symmetry planes, an outflow and a wall."""
    D = dimensions
    still = FluidState(0, 1.0, 1.0, (0.0,) * D)
    shocked = FluidState(0, 2.0, 4.0, (1.0,) + (0.0,) * (D - 1))
    bubble = FluidState(len(names) - 1, 0.2, 1.0, (0.0,) * D)
    cells, performance = ((64,), ((16,), (16,))) if D == 1 else ((48, 20), ((16, 8), (8, 8)))
    return scene_of(
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


def result(name, device):
    """State, time and books after some steps; and the state that a restart brings back, one step later."""
    names, dimensions, method = SCENES[name]
    simulation = Simulation.of(scene(names, dimensions, **method), Communicator(), device=device)
    fluid, messenger = simulation.fluid, None
    if isinstance(device, Gpu) and isinstance(device.runtime, HostRuntime):
        fluid.exchange._world = messenger = Messenger(fluid.exchange._world, device.runtime)
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
    return [*cells, *books, *again, np.array([messenger.too_early if messenger else 0])]


def solid_result(case, steps, device):
    """All columns, books and bounds of the time step after some steps of a solid."""
    part, _ = case(device)
    for _ in range(steps):
        step(part)
    part.prepare()
    books = [*part.totals().values(), part.boundary_impulse(), np.array([part.gravity_work(), part.time_step()[0]])]
    part.label_pieces()
    return [*part.columns.values(), *map(np.atleast_1d, books)]


def coupled_result(device):
    """Fluid, particles, books and peaks of a coarse steel tube after 50 steps, and one step after a restart there."""
    simulation = Simulation.of(load(ROOT / "inputs/steel_tube.toml", COARSE), Communicator(), 1, device=device)
    for _ in range(50):
        simulation.step()
    state, snapshots = coupled_state(simulation), {n: part.snapshot() for n, part in simulation.kept().items()}
    snapshots = copy.deepcopy(snapshots)
    simulation.step()
    for name, part in simulation.kept().items():
        part.restore(snapshots[name])
    simulation.step()
    return state + coupled_state(simulation)


def coupled_state(simulation):
    """What there is of it."""
    fluid, coupling = simulation.fluid, simulation.coupling
    cells = [fluid.cells(block).copy() for block in range(simulation.blocks.local_count)]
    books = [*fluid.totals(coupling.volume), *coupling.ledger().values(), np.array([simulation.time])]
    peaks = simulation.watchers[0].snapshot()["cells"]["fields"]
    columns = [column.copy() for column in simulation.solid.columns.values()]
    return [*cells, peaks.copy(), *columns, *books]


def same(results, expected):
    """Whether all ranks have the same bits."""
    mine = all(a.tobytes() == b.tobytes() for a, b in zip(results, expected, strict=True))
    return all(Communicator().allgather(mine))


class Messenger:
    """The communicator of a ghost exchange: it counts the messages that the device may still work on."""

    def __init__(self, world, runtime):
        self._world, self._runtime, self.too_early = world, runtime, 0

    def Isend(self, *arguments):
        return self._watched(self._world.Isend, arguments)

    def Irecv(self, *arguments):
        return self._watched(self._world.Irecv, arguments)

    def _watched(self, message, arguments):
        self.too_early += not self._runtime.is_idle(Queue.BESIDE)
        return message(*arguments)


def check_scenes():
    """Every scene, with everything done as late as its order allows, and as early."""
    for name in SCENES:
        expected = result(name, Team(1))
        for late in (True, False):
            assert same(result(name, Gpu(HostRuntime(late))), expected), (name, late)
        print(f"{name}: same bits")


def check_solids():
    """Collisions and a ball that bursts, as late and as early as their order allows."""
    for case, (steps, orders) in SOLIDS.items():
        expected = solid_result(case, steps, Team(1))
        for late in orders:
            assert same(solid_result(case, steps, Gpu(HostRuntime(late))), expected), (case.__name__, late)
        print(f"{case.__name__}: same bits")


def check_coupled():
    """A coupled scene with peaks, as late as the order allows."""
    assert same(coupled_result(Gpu(HostRuntime())), coupled_result(Team(1)))
    print("coupled: same bits")


def nothing(*_, **__):
    """In the place of something that is needed."""


def check_gpu():
    """Every scene on the GPUs of this node."""
    gpu, name_of_gpu = partial(cuda.gpu_of, Communicator().local_rank), cuda.gpu_name(0)
    for name in SCENES:
        assert same(result(name, gpu()), result(name, Team(1))), name
        print(f"{name}: same bits on {name_of_gpu}")
    others = [partial(solid_result, case, steps) for case, (steps, _) in SOLIDS.items()] + [coupled_result]
    for other in others:
        assert close(other(gpu()), other(Team(1)))
        print(f"solid: close on {name_of_gpu}")


def close(results, expected):
    """Whether all ranks have nearly the same; the last bits of powers and logarithms are the library's."""
    pairs = [(a.astype(float), b.astype(float)) for a, b in zip(results, expected, strict=True)]
    mine = all(np.allclose(a, b, rtol=0.0, atol=1e-8 * np.abs(b).max(initial=0.0)) for a, b in pairs)
    return all(Communicator().allgather(mine))


def check_mutants():
    """Without one of the waits, copies and orders something comes out otherwise, or a message goes too early."""
    expected = result("bubble", Team(1))
    for name, take_away in MUTANTS.items():
        gpu = Gpu(HostRuntime())
        gpu.with_own_clock = lambda gpu=gpu: gpu
        take_away(gpu)
        try:
            found = not same(result("bubble", gpu), expected)
        except Diverged:  # on all ranks
            found = True
        assert found, name
        print(f"without {name}: found")
    expected = solid_result(colliding_discs, 2, Team(1))
    for name, take_away in SOLID_MUTANTS.items():
        gpu = Gpu(HostRuntime())
        take_away(gpu)
        try:
            found = not same(solid_result(colliding_discs, 2, gpu), expected)
        except Diverged:  # on all ranks
            found = True
        assert found, name
        print(f"particles without {name}: found")


def without(name):
    """Takes a method of the device away."""
    return lambda gpu: setattr(gpu, name, lambda *_: None)


def without_wait(turn):
    """Takes every other wait away."""

    def take_away(gpu):
        wait, turns = gpu.finish_beside, cycle((turn == 0, turn == 1))
        gpu.finish_beside = lambda: None if next(turns) else wait()

    return take_away


def without_order(queue):
    """Takes the waits of a queue for the other one away."""

    def take_away(gpu):
        order = gpu.runtime.order
        gpu.runtime.order = lambda first, then: None if then is queue else order(first, then)

    return take_away


def without_wait_of_get(gpu):
    """The host looks at once."""
    gpu._wait = lambda queue: gpu.runtime.synchronise(queue) if queue is Queue.BESIDE else None


MUTANTS = {
    "the wait before receiving": without_wait(0),
    "the wait before sending": without_wait(1),
    "the copy of what is sent": without("take"),
    "the copy of what came": without("put"),
    "the wait for the ghosts": without_order(Queue.MAIN),
    "the wait for the cells": without_order(Queue.BESIDE),
    "the wait before looking": without_wait_of_get,
}
SOLID_MUTANTS = {  # without the wait for the rows to pack there is no result at all
    "the wait before sending": without("finish_beside"),
    "the copy of what is sent": without("take"),
    "the copy of what came": without("put"),
    "the wait for the ghosts": without_order(Queue.MAIN),
}


if __name__ == "__main__":
    install_abort_on_exception(Communicator())
    checks = {"scenes": check_scenes, "solids": check_solids, "coupled": check_coupled, "mutants": check_mutants}
    (checks | {"gpu": check_gpu})[sys.argv[1]]()
