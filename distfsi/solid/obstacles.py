"""Obstacles: bodies that no force moves. They stand, or go as their scene says; the fluid meets their wall."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from distfsi.mesh.blocks import Snapshot
from distfsi.narrowing import present
from distfsi.scene.description import Scene
from distfsi.scene.motion import Motion
from distfsi.solid.contact import Contact
from distfsi.solid.no_forces import NoForces
from distfsi.solid.protocol import SolidForm
from distfsi.solid.solid import Solid
from distfsi.solid.walls import Walls

REFERENCE = "reference"  # [m] of the points at the start


class Obstacles(Solid):
    """Points of walls that stand or move as their scene says: a structure without forces, neighbours and materials.

    stands  whether none of them ever moves: then their wall is found once
    """

    def __init__(self, scene: Scene, *parts: Any):
        motions = [body.motion for body in present(scene.solid).bodies]
        self._motions = {
            b: motion for b, motion in enumerate(motions) if isinstance(motion, Motion) and not motion.stands
        }
        self.stands = not self._motions
        self._time = 0.0
        super().__init__(scene, *parts)

    def _begin(self, scene: Scene) -> tuple[SolidForm, Sequence[Contact | Walls]]:
        self.columns["fixed"] = np.ones(self.count, dtype=bool)
        if not self.stands:
            self.columns[REFERENCE] = self.columns["position"].copy()
        self._hold()
        return NoForces(self.device), ()

    def _hold(self) -> None:
        """The step begins here."""
        self.start, self.before = self.columns.read("position", "velocity")
        self.carried = self.before

    def prepare(self, reach: float = 0.0, stray: float = 0.0, goes_on: bool = False) -> None:
        """A step begins. Nothing is exchanged: points do not act on each other."""
        self.sub_steps = 0
        if not self.stands:
            self._go_at(self._each(lambda motion, points: motion.velocities(points, self._time)))
            self._hold()

    def time_step(self) -> tuple[float, str]:
        """To the next row of a motion's table."""
        rows = [motion.next_row(self._time) for motion in self._motions.values()]
        return min(rows, default=math.inf), "motion of the obstacles"

    def advance(self, dt: float) -> None:
        """The points go on by `dt` [s] of their motions."""
        self.sub_steps, self._time = 1, self._time + dt
        if not self.stands:
            position = self._each(lambda motion, points: motion.positions(points, self._time))
            self._go_at((position - self.columns["position"]) / dt)
            self.columns["position"] = position
            (self.carried,) = self.columns.read("velocity")

    def _each(self, found: Callable[[Motion, np.ndarray], np.ndarray]) -> np.ndarray:
        """(own, D) what is `found` for the points of each motion, from it and where they were at the start; of points
        that stand the velocity 0, and their reference."""
        c, D = self.columns, self.dimensions
        values = found(Motion((0.0,), ((0.0,) * D,), (0.0,), (0.0,) * D), c[REFERENCE])
        for b, motion in self._motions.items():
            own = c["body"] == b
            values[own] = found(motion, c[REFERENCE][own])
        return values

    def _go_at(self, velocity: np.ndarray) -> None:
        """The points have a `velocity` (own, D) [m/s] from now on, which costs what moves them impulse and work."""
        before, mass = self.columns["velocity"], self.columns["mass"][:, None]
        given = mass * (velocity - before)
        work = (0.5 * given * (velocity + before)).sum(axis=1, keepdims=True)
        sums = self._per_body(self.device.array(np.hstack([work, given]))).sum(axis=1)
        self._gravity_work += sums[:, 0]
        self._boundary_impulse += sums[:, 1:]
        self.columns["velocity"] = velocity

    def migrate(self) -> None:
        """Collective. Points that go may change owners."""
        if self._home is None or not self.stands:
            super().migrate()

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        return {**super().snapshot(), "values": {"time": np.array(self._time)}}

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, whose points may be on any rank."""
        super().restore(snapshot)
        self._time = float(snapshot["values"]["time"])
        self._hold()
