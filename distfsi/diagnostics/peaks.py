"""Fields derived from the flow for the output: what cells remember of a blast, and the numerical schlieren picture."""

from __future__ import annotations

from math import prod

import numpy as np

from distfsi.coupling.protocol import Coupling
from distfsi.device.interface import DualArray
from distfsi.diagnostics.kernels import peaks as kernels
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
        self.peaks, self.fluid, self.coupling = peaks, fluid, coupling
        model, blocks = fluid.model, fluid.blocks
        real = fluid.device_state.dtype.name
        self.kernels = fluid.team.build([kernels.remember_peaks], model.constants, model.bindings, real)
        fields = blocks.allocate(len(NAMES))
        fields[:, kernels.ARRIVAL] = np.inf
        self.fields = DualArray(fluid.team, fields)
        self._kind = coupling.kind if coupling else DualArray(fluid.team, blocks.allocate(1, np.uint8))
        self._shape, self._extent = fluid.team.array(np.array(blocks.shape)), fluid.team.array(blocks.extent)
        self._layers = blocks.grid.ghost_layers
        self._rows = blocks.local_count * prod(blocks.shape[:2])

    def after_step(self, simulation) -> None:
        """Take in the step just made; before the first one the state at the start."""
        fluid, peaks = self.fluid, self.peaks
        before = fluid.previous if simulation.steps else fluid.device_state
        fluid.team.run(
            self.kernels.remember_peaks, self._rows, self._layers, fluid.device_state, before, self.fields.device,
            self._kind.read, self._shape, self._extent, peaks.ambient_pressure, peaks.arrival_overpressure,
            simulation.time, simulation.dt,
        )  # fmt: skip

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


def schlieren(fluid: Fluid, covered: np.ndarray | None) -> np.ndarray:
    """Collective. |grad rho| over its largest value in the domain, (local blocks, bz, by, bx), NaN where covered.

    A picture is exp(-k schlieren) with k about 15 (Quirk and Karni, J. Fluid Mech. 318, 1996, Eq. A1). Central
    differences; one-sided next to a covered cell.
    """
    fluid.exchange_ghosts(fluid.stages[0])
    density = fluid.state[:, : fluid.model.phases].astype(np.float64).sum(axis=1)
    usable = np.ones(density.shape, dtype=bool) if covered is None else ~covered
    squared = np.zeros_like(density)
    for axis, h in enumerate(fluid.blocks.grid.spacing[: fluid.model.dimensions]):
        squared += (_slope(density, usable, 3 - axis) / h) ** 2
    gradient = padded(fluid, np.sqrt(squared), covered)
    largest = fluid.blocks.communicator.maximum([np.nanmax(gradient, initial=0.0)])[0]
    return gradient / largest if largest > 0.0 else gradient


def _slope(values: np.ndarray, usable: np.ndarray, axis: int) -> np.ndarray:
    """Mean of the differences to the usable neighbours along `axis`; zero in the outermost layers."""
    values, usable = np.moveaxis(values, axis, -1), np.moveaxis(usable, axis, -1)
    slope = np.zeros_like(values)
    difference, both = values[..., 1:] - values[..., :-1], usable[..., 1:] & usable[..., :-1]
    difference, count = np.where(both, difference, 0.0), both[..., 1:].astype(int) + both[..., :-1]
    slope[..., 1:-1] = (difference[..., 1:] + difference[..., :-1]) / np.maximum(count, 1)
    return np.moveaxis(slope, -1, axis)


def padded(fluid: Fluid, field: np.ndarray, covered: np.ndarray | None) -> np.ndarray:
    """The active cells of `field` (local blocks, Z, Y, X), padded with zeros to whole blocks; NaN where covered."""
    blocks = fluid.blocks
    result = np.zeros((blocks.local_count, *blocks.block_cells[::-1]))
    for block in range(blocks.local_count):
        x, y, z = blocks.extent[block]
        part = result[block, :z, :y, :x]
        part[:] = fluid.active(field, block)
        if covered is not None:
            part[fluid.active(covered, block)] = np.nan
    return result
