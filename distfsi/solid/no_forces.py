"""The form of bodies whose points do not act on each other: rigid ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.mesh.particles import ParticleExchange
from distfsi.solid.neighbours import Near


class NoForces:
    """The form (solid/protocol.py) of bodies whose points do not act on each other."""

    def __init__(self, device: Device):
        self._device = device

    def bind(self, columns: Columns, exchange: ParticleExchange) -> None:
        """They need no columns."""

    def flags(self, columns: Columns) -> list[float]:
        """Nothing to tell."""
        return []

    def requested_keys(self, columns: Columns) -> np.ndarray | None:
        """Of no others."""
        return None

    def ghost_payload(self, columns: Columns) -> list[Any]:
        """Nothing."""
        return []

    def accelerate(self, columns: Columns, near: Near, acceleration: Any, limits: Any) -> None:
        """Not at all, and any step will do."""
        self._device.upload(limits, np.full(limits.shape, np.inf))

    def strain(self, columns: Columns, near: Near, dt: float, velocity: Any, gradient: Any) -> None:
        """Not at all."""

    def resume(self) -> None:
        """Nothing to find again."""

    def label_pieces(self, columns: Columns, exchange: ParticleExchange) -> None:
        """There are none."""
