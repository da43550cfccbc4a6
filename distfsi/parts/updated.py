"""The updated Lagrangian form: particles act on those that are near them now (paper, Sec. 2.1, corrected)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from distfsi.device.cpu import Team
from distfsi.kernels import solid as kernels
from distfsi.mesh.particles import ParticleExchange
from distfsi.parts.neighbours import Near, NeighbourSearch

DRIVERS = (kernels.correct, kernels.accelerate, kernels.heat)


class UpdatedLagrangian:
    """Forces and strain of the particles that are near each other; of those without neighbours nothing changes."""

    def __init__(self, kernels: SimpleNamespace, team: Team, search: NeighbourSearch, dimensions: int):
        self._kernels, self._team, self._search, self._dimensions = kernels, team, search, dimensions

    def bind(self, columns: dict[str, np.ndarray], exchange: ParticleExchange) -> None:
        """The reference state is of no concern."""

    def label_pieces(self, columns: dict[str, np.ndarray], exchange: ParticleExchange) -> None:
        """There are no bonds that make pieces."""

    def asked(self, columns: dict[str, np.ndarray]) -> np.ndarray | None:
        """Keys of particles and images that are needed wherever they are."""
        return None

    def flags(self, columns: dict[str, np.ndarray]) -> list[float]:
        """What a rank must know of all others."""
        return []

    def told(self, columns: dict[str, np.ndarray]) -> list:
        """What ghosts and images must have besides the state, with parities."""
        return []

    def accelerate(
        self, columns: dict[str, np.ndarray], near: Near, acceleration: np.ndarray, limits: np.ndarray
    ) -> None:
        """Collective. Write the `acceleration` (own, D) of the forces and the time steps (own, 2) that they allow."""
        self._search.find(near.own, near.position, near.state, near.plan.key, near.support)
        self._act(near, columns["pressure"], columns["deviator"], acceleration, limits)

    def push_debris(
        self,
        columns: dict[str, np.ndarray],
        near: Near,
        debris: np.ndarray,
        acceleration: np.ndarray,
        limits: np.ndarray,
    ) -> None:
        """As accelerate(), of the particles `debris` (ascending rows) alone, which carry nothing but pressure."""
        self._search.find_among(debris, near.own, near.position, near.state, near.plan.key, near.support)
        pressure = np.maximum(columns["pressure"], 0.0)
        self._act(near, pressure, np.zeros_like(columns["deviator"]), acceleration, limits)

    def _act(
        self,
        near: Near,
        pressure: np.ndarray,
        deviator: np.ndarray,
        acceleration: np.ndarray,
        limits: np.ndarray,
    ) -> None:
        D, own = self._dimensions, near.own
        self._pairs = (near.position, near.state, self._search.table, self._search.count)
        self._correction, stress = np.empty((2, own, D * D))
        self._team.run(self._kernels.correct, own, *self._pairs, pressure, deviator, self._correction, stress)
        (self._stress,) = near.plan.exchange([(stress, near.matrix)])
        self._team.run(self._kernels.accelerate, own, *self._pairs, self._stress, acceleration, limits)

    def strain(
        self, columns: dict[str, np.ndarray], near: Near, dt: float, velocity: np.ndarray, gradient: np.ndarray
    ) -> None:
        """Advance the energy by `dt` [s] with the old and the new `velocity` (count, D), and write the velocity
        gradient (own, D D) [1/s]; after accelerate()."""
        given = (dt, self._stress, self._correction, velocity, columns["energy"], gradient)
        self._team.run(self._kernels.heat, len(gradient), *self._pairs, *given)
