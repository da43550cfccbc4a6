"""What a run on several ranks costs beside its work, as JSON: messages, waiting for them, uneven shares.

The standard flow, none of it at rest. Of an exchange, `packing` is done before the cells that need no other rank are
computed, and `exposed` is the wait after them, ghosts unpacked; what the same exchange takes longer to arrive when
nothing is computed meanwhile is `hidden`.
"""

from __future__ import annotations

import json
import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from distfsi.fluid.fluid import Fluid
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.resources.bench import start, stir
from distfsi.resources.works import FLUIDS
from distfsi.scene.description import Scene
from distfsi.simulation import Simulation

WORK = "shock_bubble_2d"
STEPS, REPEATS = 5, 5


@dataclass
class Stopwatch:
    """Calls a function and adds up the time it takes [s]."""

    function: Callable[..., Any]
    seconds: float = 0.0

    def __call__(self, *arguments: Any) -> Any:
        started = clock.perf_counter()
        result = self.function(*arguments)
        self.seconds += clock.perf_counter() - started
        return result


def time_steps(simulation: Simulation) -> dict[str, float]:
    """Seconds per step of this rank: the whole, packing, exposed, computing; of the fastest run of several."""
    fluid, best = present(simulation.fluid), {"step": np.inf}
    watched = (fluid.exchange, "start"), (fluid.exchange, "finish"), (fluid, "advance_tiles")
    plain = [getattr(part, name) for part, name in watched]
    for _ in range(REPEATS):
        packing, exposed, computing = watches = [Stopwatch(function) for function in plain]
        for (part, name), watch in zip(watched, watches, strict=True):
            setattr(part, name, watch)
        simulation.communicator.barrier()
        started = clock.perf_counter()
        for _ in range(STEPS):
            simulation.step()
        simulation.communicator.barrier()
        seconds = (clock.perf_counter() - started) / STEPS
        slowest, before = simulation.communicator.maximum(np.array([seconds, best["step"]]))
        if slowest < before:
            parts = {"packing": packing, "exposed": exposed, "computing": computing}
            best = {"step": seconds} | {name: watch.seconds / STEPS for name, watch in parts.items()}
    for part, name in watched:
        delattr(part, name)
    return best


def time_arrival(fluid: Fluid, communicator: Communicator) -> float:
    """Best time [s] that this rank waits for an exchange per step when nothing is computed meanwhile."""
    best = np.inf
    for _ in range(REPEATS * STEPS):
        communicator.barrier()
        waiting = 0.0
        for stage in fluid.stages:
            fluid.exchange.start(fluid.input_of(stage), fluid.model.mirror, fluid.inflow)
            started = clock.perf_counter()
            fluid.exchange.finish()
            waiting += clock.perf_counter() - started
        best = min(best, waiting)
    return best


def measure(work: Scene, communicator: Communicator, threads: int | None) -> dict[str, float]:
    """Collective. Bytes, times and imbalance of a step of the work on these ranks."""
    simulation = start(work, communicator, threads)
    fluid = present(simulation.fluid)
    stir(fluid)
    simulation.step()
    seconds = time_steps(simulation)
    arrival = time_arrival(fluid, communicator)
    sent, messages = fluid.exchange.traffic(fluid.state)
    mine = {
        "bytes": len(fluid.stages) * sent,
        "messages": len(fluid.stages) * messages,
        "cells": int(fluid.blocks.extent.prod(axis=1).sum()),
        "hidden": max(0.0, arrival - seconds["exposed"]),
        **seconds,
    }
    every = communicator.allgather(mine)
    column = {name: np.array([rank[name] for rank in every]) for name in mine}
    return {
        "cells": int(column["cells"].sum()),
        "bytes_sent_per_step": int(column["bytes"].sum()),
        "bytes_sent_per_step_most_of_a_rank": int(column["bytes"].max()),
        "messages_per_step": int(column["messages"].sum()),
        "step_seconds": float(column["step"].max()),
        "packing_seconds_per_step": float(column["packing"].max()),
        "exchange_exposed_seconds_per_step": float(column["exposed"].max()),
        "exchange_hidden_seconds_per_step": float(column["hidden"].max()),
        "imbalance_of_cells": float(column["cells"].max() / column["cells"].mean() - 1.0),
        "imbalance_of_computing": float(column["computing"].max() / column["computing"].mean() - 1.0),
    }


def main(communicator: Communicator, threads: int | None) -> dict[str, Any]:
    """Measure on the ranks this was started on; rank 0 prints JSON."""
    result = {"ranks": communicator.size, WORK: measure(FLUIDS[WORK](), communicator, threads)}
    if communicator.rank == 0:
        print(json.dumps(result, indent=2), flush=True)
    return result
