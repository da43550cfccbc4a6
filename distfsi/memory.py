"""Whether the cells of a run fit into memory, found before anything is allocated."""

from __future__ import annotations

import math
from pathlib import Path

import psutil

from distfsi.fluid.model import fluid_model
from distfsi.fluid.stages import SSP_RK3
from distfsi.mesh.communicator import Communicator
from distfsi.scene.description import Scene

CONTROL_GROUP = Path("/sys/fs/cgroup")
VALUE_BYTES = {"float64": 8, "float32": 4}


def shortage(scene: Scene, communicator: Communicator) -> str:
    """Why the ranks of this node have too little memory for their share of the cells' states; empty if they have it.

    That is the least that a run takes: `distfsi check` tells how much it is in all.
    """
    if scene.fluid is None:
        return ""
    cell = len(SSP_RK3) * fluid_model(scene).variables * VALUE_BYTES[scene.fluid.precision]
    needed = math.prod(scene.domain.cells) * cell * communicator.local_size / communicator.size
    available = available_memory()
    if needed <= available:
        return ""
    size = f"{math.prod(scene.domain.cells):.3g} cells take {needed / 1e9:,.3g} GB at the least"
    where = "" if communicator.size == communicator.local_size else " on each node"
    return f"domain.cells: {size}{where}, and {available / 1e9:,.3g} GB of memory are free; distfsi check tells more"


def available_memory(group: Path = CONTROL_GROUP) -> float:
    """Bytes that processes of this node can still take, of the machine or of the control group that they are in."""
    available = float(psutil.virtual_memory().available)
    try:
        limit, used = ((group / f"memory.{name}").read_text().strip() for name in ("max", "current"))
    except OSError:
        return available
    return available if limit == "max" else min(available, max(0.0, float(limit) - float(used)))
