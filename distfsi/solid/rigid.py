"""A free rigid body: its motion by forces and torques.

Vectors have three components in any number of dimensions, those along axes that there are not are zero. A step keeps
the angular momentum and, without torque, the energy of a turning body to round-off: it turns about the axis of the mean
angular velocity, by which the end of the angular momentum in the body's axes goes round (Simo & Wong, Int. J. Numer.
Meth. Engng. 31, 1991).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from distfsi.scene.turns import rotation

STEP = 0.1  # [rad] of a turn, or of the swing of a support
ROUNDS = 100  # in search of the mean angular velocity
SETTLED = 1e-15


def across(a: np.ndarray) -> np.ndarray:
    """(3, 3) the matrix of the cross product with `a` from the left."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def moments_of(seconds: np.ndarray) -> np.ndarray:
    """(3, 3) moments of inertia, of the second moments (6,) xx, yy, zz, xy, xz, yz of a mass."""
    xx, yy, zz, xy, xz, yz = seconds
    return np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]])


def turned_by(angle: np.ndarray) -> np.ndarray:
    """(3, 3) the turn about the direction of `angle` [rad] by its length."""
    length = float(np.linalg.norm(angle))
    return rotation(3, length, angle.tolist()) if length > 0.0 else np.eye(3)


def swings(forces: np.ndarray, masses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The numbers (n,), ascending, and vectors, columns (n, n), with forces x = number masses x, of length 1 by the
    masses; both matrices (n, n) are symmetric."""
    root = np.linalg.inv(np.linalg.cholesky(masses))
    numbers, vectors = np.linalg.eigh(root @ forces @ root.T)
    return numbers, root.T @ vectors


@dataclass
class Anchor:
    """A support of a body (scene/motion.py): `lever` [m] from the center of mass, in the body's axes, to the point
    that was at `start` [m]."""

    lever: np.ndarray
    start: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    strength: float
    holds: bool = True


class RigidBody:
    """The state of a body, the same on all ranks.

    mass      [kg]
    inertia   (3, 3) [kg m2] in the axes of the body, which are those of space at the start; `seen` of it by its points
    anchors   its supports
    moves     (6,) along which axes it may go, and about which it may turn
    center, velocity, momentum  [m], [m/s], angular momentum about the center [N m s]
    turn      (4,) quaternion; `angle` [rad] what it has turned about each axis so far
    absorbed  [J] the energy that its supports hold, or have turned into heat
    """

    def __init__(self, mass: float, center: np.ndarray, inertia: np.ndarray, moves: np.ndarray, seen: np.ndarray):
        self.mass, self.moves = mass, moves
        self.anchors: list[Anchor] = []
        self._seen = seen
        turns = moves[3:]
        self.inertia = np.where(np.outer(turns, turns), inertia, np.diag(np.where(turns, 0.0, 1.0)))
        self._inverse = np.linalg.inv(self.inertia)
        self.center, self.velocity, self.momentum = center, np.zeros(3), np.zeros(3)
        self.turn, self.angle, self.absorbed = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), 0.0
        self._began = np.zeros(6)

    # ---- what it is --------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) the body's axes in space, its columns."""
        w, *v = self.turn
        cross = across(np.array(v))
        return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross

    @property
    def spin(self) -> np.ndarray:
        """Angular velocity [rad/s]."""
        axes = self.axes
        return axes @ (self._inverse @ (axes.T @ self.momentum))

    @property
    def kinetic(self) -> float:
        """Its kinetic energy [J]."""
        return 0.5 * float(self.mass * self.velocity @ self.velocity + self.momentum @ self.spin)

    @property
    def unseen(self) -> float:
        """What of it [J] the velocities of its points do not tell."""
        spin = self.axes.T @ self.spin
        return 0.5 * float(spin @ (self.inertia - self._seen) @ spin)

    def velocities(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) [m/s] of its `points` (n, 3) [m]."""
        return self.velocity + np.cross(self.spin, points - self.center)

    def positions(self, levers: np.ndarray) -> np.ndarray:
        """(n, 3) [m] where points are that were at `levers` (n, 3) [m] from the center at the start."""
        return self.center + levers @ self.axes.T

    def set_motion(self, velocity: np.ndarray, spin: np.ndarray) -> None:
        """From now on it moves with these [m/s, rad/s], as far as it may."""
        self.velocity = np.where(self.moves[:3], velocity, 0.0)
        axes = self.axes
        self.momentum = axes @ self.inertia @ axes.T @ np.where(self.moves[3:], spin, 0.0)

    def time_step(self) -> float:
        """The longest [s] in which it turns, and its supports swing, by STEP."""
        rate = float(np.linalg.norm(self.spin))
        stiffness = np.zeros((6, 6))
        for anchor in self._holding:
            at = self._reach(anchor)
            stiffness += at.T @ (anchor.stiffness[:, None] * at)
        if stiffness.any():
            rate = max(rate, math.sqrt(max(float(swings(stiffness, self._masses())[0][-1]), 0.0)))
        return STEP / rate if rate > 0.0 else math.inf

    # ---- how it moves ------------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """A step begins here."""
        self._began = self._momenta()

    def kick(self, dt: float, force: np.ndarray, torque: np.ndarray) -> None:
        """`dt` [s] of a force [N] and a torque about the center [N m], and of the supports, where they are now."""
        masses, before = self._masses(), np.concatenate([self.velocity, self.spin])
        pushed, damped, levers = np.zeros(6), np.zeros((6, 6)), []
        for anchor in self._holding:
            at = self._reach(anchor)
            pull = -anchor.stiffness * (self.positions(anchor.lever[None])[0] - anchor.start)
            pushed += at.T @ pull
            damped += at.T @ (anchor.damping[:, None] * at)
            levers.append((anchor, at, pull))
        self._gain(dt * force, dt * torque)
        if not levers:
            return
        # Dashpots act with the velocities after the step.
        free = np.flatnonzero(self.moves)
        gained = np.concatenate([self.mass * self.velocity, self.momentum]) + dt * pushed
        after = np.zeros(6)
        after[free] = np.linalg.solve((masses + dt * damped)[np.ix_(free, free)], gained[free])
        mean = 0.5 * (before + after)
        for anchor, at, pull in levers:
            pull = pull - anchor.damping * (at @ after)
            self._gain(dt * pull, dt * (at.T @ pull)[3:])
            self.absorbed -= dt * float(pull @ (at @ mean))
            anchor.holds = bool(np.linalg.norm(pull) <= anchor.strength)

    def go(self, dt: float) -> None:
        """`dt` [s] of its velocity and its angular momentum."""
        self.center = self.center + dt * self.velocity
        start = self.axes.T @ self.momentum
        spin = self._inverse @ start
        for _ in range(ROUNDS):
            mean = self._inverse @ (0.5 * (start + turned_by(-dt * spin) @ start))
            change = np.abs(mean - spin).max()
            spin = mean
            if change <= SETTLED * np.abs(spin).max():
                break
        self.angle = self.angle + dt * (self.axes @ spin)
        self.turn = _times(self.turn, _quaternion(dt * spin))

    def take(self, impulse: np.ndarray, torque: np.ndarray) -> None:
        """An impulse [N s] and its moment about the center [N m s]."""
        self._gain(impulse, torque)

    def share(self, impulse: np.ndarray, added: np.ndarray) -> np.ndarray:
        """The velocity and angular velocity (6,) that fluid gets which goes along, of an `impulse` and its moment (6,):
        `added` (6, 6) is its mass, as that of a body.

        Along motions in which the body has less mass than the fluid all that has changed its momentum since begin()
        accelerates the fluid's alone.
        """
        free = np.flatnonzero(self.moves)
        ratio, shapes = swings(added[np.ix_(free, free)], self._masses()[np.ix_(free, free)])
        moved = shapes.T @ (impulse + self._momenta() - self._began)[free]
        along = np.maximum(ratio, 1.0)
        found = np.zeros(6)
        found[free] = shapes @ (moved * (1.0 - 1.0 / along) / along)
        return found

    def _gain(self, impulse: np.ndarray, torque: np.ndarray) -> None:
        self.velocity = self.velocity + np.where(self.moves[:3], impulse, 0.0) / self.mass
        self.momentum = self.momentum + np.where(self.moves[3:], torque, 0.0)

    def _momenta(self) -> np.ndarray:
        return np.concatenate([self.mass * self.velocity, self.momentum])

    def _masses(self) -> np.ndarray:
        """(6, 6) what makes momenta of velocities."""
        masses, axes = self.mass * np.eye(6), self.axes
        masses[3:, 3:] = axes @ self.inertia @ axes.T
        return masses

    @property
    def _holding(self) -> list[Anchor]:
        return [anchor for anchor in self.anchors if anchor.holds]

    def _reach(self, anchor: Anchor) -> np.ndarray:
        """(3, 6) what makes the velocity of the anchor's point of those of the body."""
        return np.hstack([np.eye(3), -across(self.axes @ anchor.lever)])

    # ---- restart -----------------------------------------------------------------------------------------------------

    def state(self) -> np.ndarray:
        """All that changes, as numbers."""
        holds = [float(anchor.holds) for anchor in self.anchors]
        parts = (self.center, self.velocity, self.momentum, self.turn, self.angle, [self.absorbed], holds)
        return np.concatenate(parts)

    def restore(self, state: np.ndarray) -> None:
        """Go on from what state() gave."""
        ends = np.cumsum([3, 3, 3, 4, 3, 1])
        self.center, self.velocity, self.momentum, self.turn, self.angle, absorbed, holds = np.split(state, ends)
        self.absorbed = float(absorbed[0])
        for anchor, held in zip(self.anchors, holds, strict=True):
            anchor.holds = bool(held)


def _quaternion(angle: np.ndarray) -> np.ndarray:
    """(4,) of the turn about the direction of `angle` [rad] by its length."""
    length = float(np.linalg.norm(angle))
    return np.array([math.cos(0.5 * length), *(0.5 * np.sinc(0.5 * length / math.pi) * angle)])


def _times(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The product of two quaternions, of length 1."""
    a, b = first[1:], second[1:]
    found = np.array([first[0] * second[0] - a @ b, *(first[0] * b + second[0] * a + np.cross(a, b))])
    return found / np.linalg.norm(found)
