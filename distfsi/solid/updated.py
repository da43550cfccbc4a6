"""The updated Lagrangian form: particles act on those that are near them now (paper, Sec. 2.1, corrected)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.mesh.particles import Parity, ParticleExchange
from distfsi.solid.kernels import pairs as kernels
from distfsi.solid.kernels.records import Interaction, Neighbours
from distfsi.solid.neighbours import Near, NeighbourSearch
from distfsi.solid.sides import Sides

DRIVERS = (kernels.keep_own_side, kernels.correct_gradients, kernels.accelerate_pairs, kernels.strain_pairs)


class Carried(NamedTuple):
    """What particles act on each other with: velocity gradients of all, pressure and deviator of the own."""

    rates: Any
    pressure: Any
    deviator: Any


class UpdatedLagrangian:
    """Forces and strain of particles of one side that are near each other; of those without nothing changes.

    velocity_gradient  (n, D D) that of the last step [1/s], by rows: a column of the solid
    """

    def __init__(
        self,
        kernels: SimpleNamespace,
        device: Device,
        search: NeighbourSearch,
        sides: Sides,
        dimensions: int,
        repels: bool = False,
    ):
        """`repels`: the kernels hold an artificial stress."""
        self._kernels, self._device, self._search = kernels, device, search
        self._sides, self._dimensions, self._repels = sides, dimensions, repels
        self._viscous = device.empty((0, 0))  # kept, as fresh memory costs more than what is put into it
        self._pairs: Interaction | None = None  # of the last accelerate()

    def bind(self, columns: Columns, exchange: ParticleExchange) -> None:
        """Add the column."""
        columns["velocity_gradient"] = np.zeros((len(columns["id"]), self._dimensions**2))

    def resume(self) -> None:
        """Nothing else is kept."""

    def label_pieces(self, columns: Columns, exchange: ParticleExchange) -> None:
        """There are no bonds that make pieces."""

    def requested_keys(self, columns: Columns) -> np.ndarray | None:
        """None: only particles that are near are needed."""
        return None

    def flags(self, columns: Columns) -> list[float]:
        """None."""
        return []

    def ghost_payload(self, columns: Columns) -> list[tuple[Any, Parity]]:
        """The velocity gradient."""
        axes = range(self._dimensions)
        return [(*columns.read("velocity_gradient"), tuple((a, b) for a in axes for b in axes))]

    def accelerate(self, columns: Columns, near: Near, acceleration: Any, limits: Any) -> None:
        """Collective. Add the `acceleration` (own, D) of the forces to that of contact, and write the time steps
        (own, 2) that they allow."""
        neighbours = self._search.find(near.own, near.particles, near.plan.key.device, near.support)
        (rates,) = near.payload
        carried = Carried(rates, *columns.read("pressure", "deviator"))
        self._act(near, neighbours, carried, acceleration, limits)

    def accelerate_among(self, near: Near, chosen: Any, carried: Carried, acceleration: Any, limits: Any) -> None:
        """As accelerate(), of the particles `chosen` (ascending rows) alone, with what they have `carried`."""
        among = (chosen, near.own, near.particles, near.plan.key.device, near.support)
        self._act(near, self._search.find_among(*among), carried, acceleration, limits)

    def _act(self, near: Near, neighbours: Neighbours, carried: Carried, acceleration: Any, limits: Any) -> None:
        D, own, run, pairs = self._dimensions, near.own, self._device.run, (near.particles, neighbours)
        if self._sides.meet:
            run(self._kernels.keep_own_side, own, self._sides.of(near.plan.key).read, neighbours)
        parity = near.matrix + (near.tensor if self._repels else ())
        correction, stress = (self._device.empty((own, width)) for width in (D * D, len(parity)))
        run(self._kernels.correct_gradients, own, *pairs, carried.pressure, carried.deviator, correction, stress)
        (stress,) = near.plan.exchange([(stress, parity)])
        if self._viscous.shape != neighbours.table.shape:
            self._viscous = self._device.empty(neighbours.table.shape)
        run(self._kernels.accelerate_pairs, own, *pairs, carried.rates, stress, acceleration, limits, self._viscous)
        self._pairs = Interaction(neighbours, self._viscous, stress, correction)

    def strain(self, columns: Columns, near: Near, dt: float, velocity: Any, gradient: Any) -> None:
        """Advance the energy by `dt` [s] with the old and the new `velocity` (count, D), and write the velocity
        gradient (own, D D) [1/s]; after accelerate()."""
        self.strain_among(columns, near, dt, velocity, gradient)
        columns.adopt("velocity_gradient", gradient)

    def strain_among(self, columns: Columns, near: Near, dt: float, velocity: Any, gradient: Any) -> None:
        """As strain(), after accelerate_among()."""
        given = (dt, near.particles, self._pairs, velocity, *columns.write("energy"), gradient)
        self._device.run(self._kernels.strain_pairs, near.own, *given)
