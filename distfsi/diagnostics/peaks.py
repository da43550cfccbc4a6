"""What cells remember of a blast."""

from __future__ import annotations

from math import prod

import numpy as np

from distfsi.coupling.protocol import Coupling
from distfsi.device.interface import DualArray
from distfsi.diagnostics.derived import padded
from distfsi.diagnostics.kernels import peaks as kernels
from distfsi.diagnostics.watched import Watched
from distfsi.fluid.fluid import Fluid
from distfsi.mesh.blocks import Snapshot
from distfsi.scene import description

NAMES = {
    kernels.OVERPRESSURE: "peak_overpressure",
    kernels.IMPULSE: "positive_impulse",
    kernels.ARRIVAL: "arrival_time",
    kernels.DYNAMIC_PRESSURE: "peak_dynamic_pressure",
}


class Peaks:
    """What each cell remembers: highest overpressure [Pa], its positive impulse [Pa s], the first arrival [s] (inf: not
    yet), highest dynamic pressure [Pa]. Time that a cell is covered by a solid does not count.

    fields: (local blocks, 4, Z, Y, X) float64 on host and device
    """

    name = "peaks"

    def __init__(self, peaks: description.Peaks, fluid: Fluid, coupling: Coupling | None):
        self.fluid = fluid
        model, blocks = fluid.model, fluid.blocks
        real = fluid.device_state.dtype.name
        self.kernels = fluid.device.build([kernels.remember_peaks], model.constants, model.bindings, real)
        fields = blocks.allocate(len(NAMES))
        fields[:, kernels.ARRIVAL] = np.inf
        self.fields = DualArray(fluid.device, fields)
        self._kind = coupling.kind if coupling else DualArray(fluid.device, blocks.allocate(1, np.uint8))
        self._limits = kernels.Limits(peaks.ambient_pressure, peaks.arrival_overpressure)
        self._grid, self._rows = blocks.grid_on(fluid.device), blocks.local_count * prod(blocks.shape[:2])

    def after_step(self, simulation: Watched) -> None:
        """Take in the step just made; before the first one the state at the start."""
        fluid = self.fluid
        before = fluid.previous if simulation.steps else fluid.device_state
        step = kernels.Step(before, fluid.device_state, simulation.time, simulation.dt)
        given = step, self.fields.device, self._kind.read, self._limits, self._grid
        fluid.device.run(self.kernels.remember_peaks, self._rows, *given)

    def outputs(self, covered: np.ndarray | None) -> dict[str, np.ndarray]:
        """Fields for the output files: (local blocks, bz, by, bx), NaN where covered or, for the arrival, too early."""
        fields = self.fields.host()
        return {
            name: padded(self.fluid, np.where(np.isinf(fields[:, v]), np.nan, fields[:, v]), covered)
            for v, name in NAMES.items()
        }

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        return {"cells": {"fields": self.fluid.blocks.without_ghosts(self.fields.host())}}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self.fluid.blocks.without_ghosts(self.fields.host())[:] = snapshot["cells"]["fields"]
        self.fields.changed()
