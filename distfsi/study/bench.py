"""Speed of this machine on standard work, as JSON: whole time loops without output, best of several runs.

cell_stages_per_second counts one Runge-Kutta stage of one cell; `share_of_kernel` is the loop's speed over that of its
bare stage kernel, timed in the same run.
"""

from __future__ import annotations

import json
import platform
import time as clock

import numpy as np

from distfsi import __version__
from distfsi.mesh.communicator import Communicator
from distfsi.parts.fluid import SSP_RK3
from distfsi.scene import description as scene
from distfsi.simulation import Simulation, threads_of_rank

REPEATS = 5
AIR, HELIUM, WATER = scene.IdealGas(1.4), scene.IdealGas(1.67), scene.StiffenedGas(4.4, 6e8)
TNT = scene.Jwl(1630.0, 3.712e11, 3.21e9, 4.15, 0.95, 0.3)
COPPER = scene.MieGrueneisen(3940.0, 1.489, 0.0, 0.0, 1.99, 0.0)
COPPER_STRENGTH = scene.JohnsonCook(46e9, 90e6, 292e6, 0.31, 0.025, 1.09, 1.0, 293.0, 1356.0, 383.0, 0.9)


def two_gases(
    cells: tuple[int, ...], eos: tuple, inner: tuple[float, float], outer: tuple[float, float], precision="float64"
):
    """A ball of one material (density, pressure) in another, in a closed box; the standard fluid work."""
    D = len(cells)
    rest = (0.0,) * D
    phases = tuple(scene.Phase(f"phase {k}", e) for k, e in enumerate(eos))
    outside = scene.FluidState(len(eos) - 1, *outer, rest)
    inside = scene.FluidState(0, *inner, rest)
    shape = scene.Ball(tuple(0.5 * n for n in cells), 0.25 * min(cells))
    return empty_scene(
        scene.Domain(rest, tuple(float(n) for n in cells), cells, (("wall", "wall"),) * D),
        fluid=scene.Fluid(
            phases,
            (scene.Region(outside, None), scene.Region(inside, shape)),
            "minmod",
            1e-6,
            ((None, None),) * D,
            precision,
        ),
    )


def copper_block(particles: int) -> scene.Scene:
    """A cube of elastic-plastic copper moving freely; the standard solid work, in 3D."""
    side = float(particles)
    strength = COPPER_STRENGTH
    body = scene.Body("cube", scene.Box((0.0,) * 3, (side,) * 3), 1.0, 8930.0, (10.0, 0.0, 0.0), COPPER, strength, None)
    cells = (max(4, particles // 2),) * 3
    domain = scene.Domain((-0.5 * side,) * 3, (1.5 * side,) * 3, cells, (("outflow", "outflow"),) * 3)
    return empty_scene(domain, solid=scene.Solid((body,), 1.3, 1.0, 2.0))


def empty_scene(domain: scene.Domain, fluid=None, solid=None) -> scene.Scene:
    """A scene without end, with the default blocks."""
    D = domain.dimensions
    block = {1: (512,), 2: (128, 64), 3: (64, 32, 32)}[D]
    tile = {1: (512,), 2: (128, 32), 3: (64, 8, 8)}[D]
    return scene.Scene(
        "bench",
        domain,
        scene.Time(np.inf, 0.5, None),
        (0.0,) * D,
        fluid,
        solid,
        scene.Output("", 0.0, 1),
        scene.Performance(block, tile),
    )


FLUID_WORK = {
    "shock_bubble_2d": lambda: two_gases((1300, 356), (HELIUM, AIR), (0.138, 1.0), (1.0, 2.0)),
    "shock_bubble_2d_float32": lambda: two_gases((1300, 356), (HELIUM, AIR), (0.138, 1.0), (1.0, 2.0), "float32"),
    "water_air_2d": lambda: two_gases((1024, 512), (WATER, AIR), (1000.0, 1e8), (1.2, 1e5)),
    "tnt_air_2d": lambda: two_gases((1024, 512), (TNT, AIR), (1630.0, 8.376e9), (1.225, 101325.0)),
    "euler_2d": lambda: two_gases((1024, 512), (AIR,), (1.0, 10.0), (1.0, 1.0)),
    "shock_bubble_3d": lambda: two_gases((128, 96, 96), (HELIUM, AIR), (0.138, 1.0), (1.0, 2.0)),
}


def time_loop(simulation: Simulation, seconds: float) -> tuple[float, float]:
    """(first step [s], best time per step [s]) of a run that has just been built."""
    communicator = simulation.communicator
    communicator.barrier()
    started = clock.perf_counter()
    simulation.step()
    communicator.barrier()
    first = clock.perf_counter() - started
    started = clock.perf_counter()
    simulation.step()
    steps = communicator.broadcast(max(2, int(seconds / (clock.perf_counter() - started))))
    best = np.inf
    for _ in range(REPEATS):
        communicator.barrier()
        started = clock.perf_counter()
        for _ in range(steps):
            simulation.step()
        communicator.barrier()
        best = min(best, (clock.perf_counter() - started) / steps)
    return first, best


def time_kernel(simulation: Simulation) -> float:
    """Best time [s] of one bare stage kernel on this rank's tiles."""
    fluid, best = simulation.fluid, np.inf
    tiles = np.arange(len(fluid.tiles))
    for _ in range(REPEATS * 3):
        simulation.communicator.barrier()
        started = clock.perf_counter()
        fluid.advance_tiles(tiles, SSP_RK3[1], 0.1 * simulation.dt)
        simulation.communicator.barrier()
        best = min(best, clock.perf_counter() - started)
    return best


def bench_fluid(work: scene.Scene, communicator: Communicator, threads: int | None, seconds: float) -> dict[str, float]:
    """Speed of the time loop of one fluid."""
    simulation = Simulation.of(work, communicator, threads)
    first, step = time_loop(simulation, seconds)
    cells = int(np.prod(work.domain.cells))
    kernel = time_kernel(simulation)
    memory = communicator.allgather(simulation.fluid.memory())
    return {
        "cells": cells,
        "cell_stages_per_second": len(SSP_RK3) * cells / step,
        "kernel_cell_stages_per_second": cells / kernel,
        "share_of_kernel": len(SSP_RK3) * kernel / step,
        "bytes_per_cell": sum(memory) / cells,
        "first_step_seconds": first,
    }


def bench_solid(work: scene.Scene, communicator: Communicator, threads: int | None, seconds: float) -> dict[str, float]:
    """Speed of the time loop of one solid."""
    simulation = Simulation.of(work, communicator, threads)
    particles = sum(communicator.allgather(len(simulation.solid.columns["id"])))
    first, step = time_loop(simulation, seconds)
    return {"particles": particles, "particle_steps_per_second": particles / step, "first_step_seconds": first}


def main(communicator: Communicator, threads: int | None, only: str | None = None, seconds: float = 0.5) -> dict:
    """Run the benchmarks (those whose name holds `only`) and print them as JSON on rank 0."""
    result = {
        "distfsi": __version__,
        "machine": platform.processor() or platform.machine(),
        "ranks": communicator.size,
        "threads_per_rank": threads or threads_of_rank(communicator),
    }
    for name, work in FLUID_WORK.items():
        if only is None or only in name:
            result[name] = bench_fluid(work(), communicator, threads, seconds)
    if only is None or only in "copper_block_3d":
        result["copper_block_3d"] = bench_solid(copper_block(32), communicator, threads, seconds)
    if communicator.rank == 0:
        print(json.dumps(result, indent=2), flush=True)
    return result
