"""What a body force has given to the fluid: a part of the conservation budget."""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.device.interface import Device, DualArray
from distfsi.fluid.kernels.force import account_force
from distfsi.fluid.metrics import Metrics
from distfsi.fluid.model import FluidModel
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.kernels.grid import BlockGrid


class GivenByForce:
    """Momentum and work of the body force on this rank's cells.

    sums  (rows of cells, D + 1) [N s, J] on host and device
    """

    def __init__(self, blocks: Blocks, device: Device, model: FluidModel, metrics: Metrics, real: str):
        self._blocks, self._device, self._model = blocks, device, model
        self._kernel = device.build([account_force], model.constants, model.bindings, real).account_force
        self._metrics = device.array(metrics.table)
        _, self._rows, planes = blocks.block_cells
        self._shape = blocks.local_count, self._rows * planes, model.dimensions + 1
        self.sums = DualArray(device, np.zeros((self._shape[0] * self._shape[1], self._shape[2])))

    def account(self, state: Any, volumes: Any, grid: BlockGrid, time: float) -> None:
        """The force acts on the fluid of a `state` for `time` [s]."""
        given = (state, volumes, self._metrics, self.sums.device, self._rows, time, grid)
        self._device.run(self._kernel, self.sums.read.shape[0], *given)

    def totals(self) -> np.ndarray:
        """Collective. Masses, which are none, momentum and energy (conserved,) of all ranks so far."""
        blocks, model = self._blocks, self._model
        sums = self.sums.host().reshape(self._shape).sum(axis=1)
        return np.concatenate([np.zeros(model.phases), blocks.sum(sums)])
