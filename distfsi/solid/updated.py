"""The updated Lagrangian form: particles act on those that are near them now (paper, Sec. 2.1, corrected)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.mesh.particles import ParticleExchange
from distfsi.solid.kernels import pairs as kernels
from distfsi.solid.neighbours import Near, NeighbourSearch

DRIVERS = (kernels.correct, kernels.accelerate, kernels.heat, kernels.press)


class UpdatedLagrangian:
    """Forces and strain of the particles that are near each other; of those without neighbours nothing changes.

    velocity_gradient  (n, D D) that of the last step [1/s], by rows: a column of the solid
    """

    def __init__(
        self, kernels: SimpleNamespace, device: Device, search: NeighbourSearch, dimensions: int, repels: bool = False
    ):
        """`repels`: the kernels hold an artificial stress."""
        self._kernels, self._device, self._search, self._dimensions = kernels, device, search, dimensions
        self._repels = repels
        self._viscous = device.empty((0, 0))  # kept, as fresh memory costs more than what is put into it

    def bind(self, columns: Columns, exchange: ParticleExchange) -> None:
        """Add the column."""
        columns["velocity_gradient"] = np.zeros((len(columns["id"]), self._dimensions**2))

    def label_pieces(self, columns: Columns, exchange: ParticleExchange) -> None:
        """There are no bonds that make pieces."""

    def requested_keys(self, columns: Columns) -> np.ndarray | None:
        """Keys of particles and images that are needed wherever they are."""
        return None

    def flags(self, columns: Columns) -> list[float]:
        """What a rank must know of all others."""
        return []

    def ghost_payload(self, columns: Columns) -> list:
        """What ghosts and images must have besides the state, with parities: the velocity gradient."""
        axes = range(self._dimensions)
        return [(*columns.read("velocity_gradient"), tuple((a, b) for a in axes for b in axes))]

    def accelerate(self, columns: Columns, near: Near, acceleration: Any, limits: Any) -> None:
        """Collective. Write the `acceleration` (own, D) of the forces and the time steps (own, 2) that they allow."""
        self._search.find(near.own, near.position, near.state, near.plan.key.device, near.support)
        self._act(near, *near.ghost_payload, *columns.read("pressure", "deviator"), acceleration, limits)

    def push_debris(self, columns: Columns, near: Near, debris: Any, acceleration: Any, limits: Any) -> None:
        """As accelerate(), of the particles `debris` (ascending rows) alone, which carry nothing but pressure, and
        whose every approach is damped."""
        self._search.find_among(debris, near.own, near.position, near.state, near.plan.key.device, near.support)
        pressure, deviator = columns.read("pressure", "deviator")
        pushed = self._device.empty(near.own)
        self._device.run(self._kernels.press, near.own, pressure, pushed)
        rates = self._device.zeros((near.plan.count, self._dimensions**2))
        no_shear = self._device.zeros(deviator.shape)
        self._act(near, rates, pushed, no_shear, acceleration, limits)

    def _act(self, near: Near, rates: Any, pressure: Any, deviator: Any, acceleration: Any, limits: Any) -> None:
        D, own, run = self._dimensions, near.own, self._device.run
        self._pairs = (near.position, near.state, self._search.table, self._search.count)
        tension = near.tensor if self._repels else ()
        self._correction, stress = (self._device.empty((own, width)) for width in (D * D, D * D + len(tension)))
        run(self._kernels.correct, own, *self._pairs, pressure, deviator, self._correction, stress)
        (self._stress,) = near.plan.exchange([(stress, near.matrix + tension)])
        if self._viscous.shape != self._search.table.shape:
            self._viscous = self._device.empty(self._search.table.shape)
        run(self._kernels.accelerate, own, *self._pairs, rates, self._stress, acceleration, limits, self._viscous)

    def strain(self, columns: Columns, near: Near, dt: float, velocity: Any, gradient: Any) -> None:
        """Advance the energy by `dt` [s] with the old and the new `velocity` (count, D), and write the velocity
        gradient (own, D D) [1/s]; after accelerate()."""
        self.strain_debris(columns, near, dt, velocity, gradient)
        columns.adopt("velocity_gradient", gradient)

    def strain_debris(self, columns: Columns, near: Near, dt: float, velocity: Any, gradient: Any) -> None:
        """As strain(), after push_debris()."""
        given = (self._viscous, dt, self._stress, self._correction, velocity, *columns.write("energy"), gradient)
        self._device.run(self._kernels.heat, near.own, *self._pairs, *given)
