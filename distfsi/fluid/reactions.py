"""Detonation and afterburn: shares that a phase of the fluid carries along, and what lets them fall.

A share holds back an energy from the pressure: the unburnt share that of the detonation, the share that is left of the
products that of their afterburn. The energy is in the cells from the start, so that nothing is created on the way.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.device.interface import Device, DualArray
from distfsi.fluid.kernels.reactions import react
from distfsi.fluid.lighting import lighting_times
from distfsi.fluid.model import FluidModel
from distfsi.mesh.blocks import Blocks
from distfsi.narrowing import present
from distfsi.scene.description import Scene


class Reactions:
    """What reacts on this rank's blocks.

    lighting  (local blocks, 1, Z, Y, X) when each cell is lit [s]
    """

    def __init__(self, scene: Scene, model: FluidModel, blocks: Blocks, device: Device):
        self.blocks, self.device = blocks, device
        fluid = present(scene.fluid)
        self.kernels = device.build([react], model.constants, model.bindings, fluid.precision)
        times = lighting_times(scene, blocks) if fluid.detonation else blocks.allocate(1) - np.inf
        self.lighting = DualArray(device, times)
        self._changed = DualArray(device, np.zeros(blocks.local_count, np.int64))
        self._grid = blocks.grid_on(device)
        self._rows = blocks.local_count * int(np.prod(blocks.shape[:2]))

    def advance(self, state: Any, time: float, dt: float) -> np.ndarray:
        """Let shares of the `state` on the device fall in a step of `dt` [s] that ends at `time` [s]; which of the
        local blocks have changed (local blocks,)."""
        self._changed.host()[:] = 0
        self._changed.changed()
        given = state, self.lighting.read, self._changed.device, self._grid
        self.device.run(self.kernels.react, self._rows, *given, time, dt)
        return self._changed.host() > 0
