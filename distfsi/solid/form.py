"""What a solid asks of its form: how particles act on each other (updated.py, total_lagrangian.py)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from distfsi.device.interface import Columns
from distfsi.mesh.particles import Parity, ParticleExchange
from distfsi.solid.neighbours import Near


class SolidForm(Protocol):
    """Forces and strain of particles. A step calls requested_keys(), flags() and ghost_payload(), then accelerate(),
    and strain() when the velocities are the new ones."""

    def bind(self, columns: Columns, exchange: ParticleExchange) -> None:
        """Collective. Add the form's columns to those of particles at rest."""

    def resume(self) -> None:
        """The columns are those of a restart."""

    def label_pieces(self, columns: Columns, exchange: ParticleExchange) -> None:
        """Collective. Bring the column `piece` up to date, if there are bonds that make pieces."""

    def requested_keys(self, columns: Columns) -> np.ndarray | None:
        """Keys of particles and images of others that are needed wherever they are; None, on all ranks: there are no
        such."""

    def flags(self, columns: Columns) -> list[float]:
        """Numbers of which all ranks must know the largest, in `near.flags`."""

    def ghost_payload(self, columns: Columns) -> Sequence[tuple[Any, Parity]]:
        """What ghosts and images must have besides the state: arrays (own, ...) of the device with their parities."""

    def accelerate(self, columns: Columns, near: Near, acceleration: Any, limits: Any) -> None:
        """Collective. Write the `acceleration` (own, D) [m/s2] of the forces, where it is not 0, and the time steps
        (own, 2) [s] that they allow."""

    def strain(self, columns: Columns, near: Near, dt: float, velocity: Any, gradient: Any) -> None:
        """Advance the energy by `dt` [s] with the old and the new `velocity` (count, D) [m/s], and write the velocity
        gradient (own, D D) [1/s], where it is not 0; after accelerate()."""
