"""Speed of this machine on standard work, as JSON: whole time loops without output, best of several runs.

cell_stages_per_second counts one Runge-Kutta stage of one cell; `share_of_kernel` is the loop's speed over that of its
bare stage kernel, timed in the same run. A complete bench is kept for `distfsi check`.
"""

from __future__ import annotations

import gc
import json
import os
import platform
import sys
import time as clock
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from distfsi import __version__
from distfsi.device.cpu import cache_directory
from distfsi.diagnostics.budget import Budget
from distfsi.fluid.fluid import Fluid
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.resources.works import COUPLED, FLUIDS, SIZES, SMALLEST, SOLID_SIZES, SOLIDS
from distfsi.scene.description import Scene
from distfsi.simulation import Simulation, threads_of_rank
from distfsi.step import COUPLING_PARTS

REPEATS = 5
RIPPLE = 1e-4  # relative
SHEAR_RATE = 10.0  # 1/s

Result = dict[str, float]


def start(work: Scene, communicator: Communicator, threads: int | None) -> Simulation:
    """The work before its first step, with waves everywhere, so that no part of a fluid is at rest, and bodies sheared
    where there are two dimensions, so that they yield."""
    simulation = Simulation.of(work, communicator, threads)
    if simulation.fluid:
        state, conserved = simulation.fluid.state, simulation.fluid.model.conserved
        ripple = 1.0 + RIPPLE * np.cos(np.arange(np.prod(state.shape[2:]))).reshape(state.shape[2:])
        state[:, :conserved] *= ripple.astype(state.dtype)
    if simulation.solid and work.domain.dimensions > 1:
        particles = simulation.solid.columns
        particles["velocity"][:, 0] += SHEAR_RATE * particles["position"][:, -1]
    return simulation


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
    steps: int = communicator.broadcast(max(2, int(seconds / (clock.perf_counter() - started))))
    best = np.inf
    for _ in range(REPEATS):
        communicator.barrier()
        started = clock.perf_counter()
        for _ in range(steps):
            simulation.step()
        communicator.barrier()
        best = min(best, (clock.perf_counter() - started) / steps)
    return first, best


def time_history(simulation: Simulation) -> float:
    """Best time [s] of one row of the history."""
    budget, best = Budget(simulation.fluid, simulation.solid, simulation.coupling), np.inf
    for _ in range(REPEATS):
        started = clock.perf_counter()
        budget.row(simulation)
        best = min(best, clock.perf_counter() - started)
    return best


def time_kernel(simulation: Simulation) -> float:
    """Best time [s] of one bare stage kernel on this rank's tiles."""
    fluid, best = present(simulation.fluid), np.inf
    tiles = np.arange(len(fluid.tiling.table))
    for _ in range(REPEATS * 3):
        simulation.communicator.barrier()
        started = clock.perf_counter()
        fluid.advance_tiles(tiles, fluid.stages[1], 0.1 * simulation.dt)
        simulation.communicator.barrier()
        best = min(best, clock.perf_counter() - started)
    return best


def stir(fluid: Fluid) -> None:
    """Make all cells differ a little, so that no tile is at rest."""
    cells = fluid.blocks.without_ghosts(fluid.state)
    noise = np.random.default_rng(0).standard_normal((len(cells), 1, *cells.shape[2:]))
    cells[:, : fluid.model.conserved] *= (1.0 + 1e-6 * noise).astype(cells.dtype)


def time_coupled_step(simulation: Simulation) -> tuple[float, float]:
    """(wall, step) [s]: what the coupling takes of the next step, and the step itself, on this rank."""
    simulation.timers.lap()
    started = clock.perf_counter()
    simulation.step()
    step = clock.perf_counter() - started
    seconds = simulation.timers.lap()
    return sum(seconds[part] for part in COUPLING_PARTS), step


def time_parts(simulation: Simulation) -> Result:
    """What the wall takes of a step of fluid and solid together, and of one of both alone; and how many cells are
    around it. Of the fastest step of several."""
    gather = simulation.communicator.allgather
    wall, step = min((time_coupled_step(simulation) for _ in range(REPEATS)), key=lambda times: times[1])
    cells, band = int(np.prod(simulation.scene.domain.cells)), int(present(simulation.coupling).workload().sum())
    return {
        "cells": cells,
        "band_cells": sum(gather(band)),
        "share_of_band": sum(gather(band)) / cells,
        "wall_seconds_per_step": max(gather(wall)),
        "wall_beside_both_alone": max(gather(wall / (step - wall))),
    }


def bench_fluid(work: Scene, communicator: Communicator, threads: int | None, seconds: float) -> Result:
    """Speed of the time loop of one fluid, none of it at rest."""
    simulation = start(work, communicator, threads)
    fluid = present(simulation.fluid)
    stir(fluid)
    first, step = time_loop(simulation, seconds)
    cells = int(np.prod(work.domain.cells))
    kernel = time_kernel(simulation)
    memory = communicator.allgather(fluid.memory())
    return {
        "cells": cells,
        "cell_stages_per_second": len(fluid.stages) * cells / step,
        "kernel_cell_stages_per_second": cells / kernel,
        "share_of_kernel": len(fluid.stages) * kernel / step,
        "history_row_seconds": time_history(simulation),
        "bytes_per_cell": sum(memory) / cells,
        "first_step_seconds": first,
    }


def bench_solid(work: Scene, communicator: Communicator, threads: int | None, seconds: float) -> Result:
    """Speed of the time loop of one solid, with a fluid around it or without; and what the wall between them costs."""
    simulation = start(work, communicator, threads)
    particles = sum(communicator.allgather(len(present(simulation.solid).columns["id"])))
    first, step = time_loop(simulation, seconds)
    if simulation.coupling:
        stir(present(simulation.fluid))
    coupled = time_parts(simulation) if simulation.coupling else {}
    return coupled | {
        "particles": particles,
        "particle_steps_per_second": particles / step,
        "first_step_seconds": first,
    }


def bench_smallest(work: Scene, communicator: Communicator, threads: int | None, seconds: float) -> Result:
    """What does not depend on the size of a run: time to start it with kernels compiled before, and time per step."""
    start(work, communicator, threads).step()
    _forget_kernels()
    started = clock.perf_counter()
    simulation = start(work, communicator, threads)
    simulation.step()
    communicator.barrier()
    seconds_to_start = clock.perf_counter() - started
    return {
        "start_seconds": seconds_to_start,
        "seconds_per_step": time_loop(simulation, seconds)[1],
        "history_row_seconds": time_history(simulation),
    }


def _forget_kernels() -> None:
    """The next build loads the compiled kernels from disk again."""
    for name in [name for name in sys.modules if name.startswith("distfsi_kernels.")]:
        del sys.modules[name]
    gc.collect()


def main(
    communicator: Communicator, threads: int | None, only: str | None = None, seconds: float = 0.5
) -> dict[str, Any]:
    """Run the benchmarks (those whose name holds `only`), print them as JSON on rank 0, and keep a complete bench.

    While it goes on standard error tells which is measured; each is kept at once, so that a bench that was interrupted
    goes on where it ended. SOLID_SIZES are for those who ask for them: they take much memory.
    """
    result: dict[str, Any] = {
        "distfsi": __version__,
        "machine": platform.processor() or platform.machine(),
        "ranks": communicator.size,
        "threads_per_rank": threads or threads_of_rank(communicator),
    }
    works: tuple[tuple[Mapping[str, Callable[[], Scene]], Callable[..., Result]], ...] = (
        ({f"smallest_{name}": work for name, work in SMALLEST.items()}, bench_smallest),
        (FLUIDS | SIZES, bench_fluid),
        (SOLIDS | COUPLED | (SOLID_SIZES if only else {}), bench_solid),
    )
    chosen = [(name, work, measure) for named, measure in works for name, work in named.items()]
    chosen = [each for each in chosen if only is None or only in each[0]]
    before = communicator.broadcast(_read(_partial_file()) if only is None else None) or {}
    done = {name: found for name, found in before.items() if before.items() >= result.items() and name not in result}
    for number, (name, work, measure) in enumerate(chosen, 1):
        if communicator.rank == 0:
            state = "was measured before" if name in done else "..."
            print(f"{number} of {len(chosen)}: {name} {state}", file=sys.stderr, flush=True)
        result[name] = done[name] if name in done else measure(work(), communicator, threads, seconds)
        if communicator.rank == 0 and only is None:
            _write(_partial_file(), result)
    if communicator.rank == 0:
        print(json.dumps(result, indent=2), flush=True)
        if only is None:
            _partial_file().replace(_kept_file())
    return result


def kept_bench() -> dict[str, Any] | None:
    """The last complete bench of this machine by this version, if there is one."""
    return _read(_kept_file())


def _read(path: Path) -> dict[str, Any] | None:
    """What a bench of this version left there, if one did."""
    try:
        result: dict[str, Any] = json.loads(path.read_text())
    except (OSError, ValueError):
        return None
    return result if result.get("distfsi") == __version__ else None


def _write(path: Path, result: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(result))
    os.replace(temporary, path)


def _partial_file() -> Path:
    """Where a bench that goes on keeps what it has measured."""
    return _kept_file().with_suffix(".partial")


def _kept_file() -> Path:
    return cache_directory() / f"bench-{platform.node()}.json"
