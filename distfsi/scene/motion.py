"""How rigid parts move: as a table prescribes, or freely, by the forces on them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from distfsi.scene.turns import rotation


@dataclass(frozen=True)
class Motion:
    """A rigid motion. At `times` [s], the first of which is 0, it has gone by `displacements` (D,) [m] and turned by
    `angles` [rad] about a line through `about` (D,) [m] along `axis` (3D), which goes along; at constant speeds
    between, and at rest after the last."""

    times: tuple[float, ...]
    displacements: tuple[tuple[float, ...], ...]
    angles: tuple[float, ...]
    about: tuple[float, ...]
    axis: tuple[float, ...] = ()

    @property
    def stands(self) -> bool:
        """Whether it is none."""
        return len(self.times) == 1

    def positions(self, reference: np.ndarray, time: float) -> np.ndarray:
        """Where points are at `time` [s] that were at `reference` (n, D) [m] at the start."""
        gone = [np.interp(time, self.times, way) for way in zip(*self.displacements, strict=True)]
        about = np.asarray(self.about)
        return (reference - about) @ self._turn(time).T + about + np.array(gone)

    def velocities(self, reference: np.ndarray, time: float) -> np.ndarray:
        """(n, D) [m/s] from `time` [s] on."""
        row = int(np.searchsorted(self.times, time, side="right")) - 1
        if row >= len(self.times) - 1:
            return np.zeros(reference.shape)
        length = self.times[row + 1] - self.times[row]
        going = (np.asarray(self.displacements[row + 1]) - np.asarray(self.displacements[row])) / length
        rate = (self.angles[row + 1] - self.angles[row]) / length
        arm = (reference - np.asarray(self.about)) @ self._turn(time).T
        if reference.shape[1] == 2:
            return going + rate * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        if reference.shape[1] == 3 and rate != 0.0:
            return going + np.cross(rate * np.asarray(self.axis) / math.hypot(*self.axis), arm)
        return np.broadcast_to(going, reference.shape).copy()

    def next_row(self, time: float) -> float:
        """[s] from `time` to the next row of the table; inf after the last."""
        return next((row - time for row in self.times if row > time * (1.0 + 1e-12)), math.inf)

    def _turn(self, time: float) -> np.ndarray:
        D = len(self.about)
        if not any(self.angles):
            return np.eye(D)
        return rotation(D, float(np.interp(time, self.times, self.angles)), self.axis)


@dataclass(frozen=True)
class Support:
    """A spring and a dashpot between the ground and the point `at` (D,) [m] of a rigid body, where it is at the start
    (None: its center of mass): along each axis the force -stiffness * displacement - damping * velocity, in N/m and
    N s/m, per metre of what is not computed. One of a `strength` [N] is gone once its force has exceeded that."""

    at: tuple[float, ...] | None
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    strength: float | None = None


@dataclass(frozen=True)
class Free:
    """A rigid body that forces move. At first it turns by `spin` [rad/s]: in 2D one number, in 3D a vector.

    mass [kg], None: as its density tells; inertia [kg m2]: in 2D one number, in 3D about x, y and z through the center
    of mass, None: as of its shape; per metre of what is not computed.
    """

    spin: tuple[float, ...] = ()
    mass: float | None = None
    inertia: tuple[float, ...] = ()
    supports: tuple[Support, ...] = ()
