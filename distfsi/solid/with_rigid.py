"""A solid some of whose bodies are rigid: their particles are points of a wall, and of surfaces in contact, that get
the velocities of their bodies in the place of their own.

Where forces accelerate points, or the fluid pushes them, the sums over a body's points move it (solid/rigid.py), and
what points get instead leaves these sums as they are. So momentum and energy close as those of particles do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from distfsi.device.interface import DualArray
from distfsi.gauges import AXES, per_extent
from distfsi.mesh.blocks import Snapshot
from distfsi.narrowing import present
from distfsi.scene.description import Scene
from distfsi.scene.motion import Free, Motion
from distfsi.solid.contact import Contact
from distfsi.solid.protocol import SolidForm
from distfsi.solid.rigid import Anchor, RigidBody, across, moments_of
from distfsi.solid.solid import Solid
from distfsi.solid.walls import Walls

REFERENCE = "reference"  # [m] of points at the start, as of bonded particles
SAFETY = 0.3  # of the time in which a signal passes a smoothing length
BITS, MINIMUM_EXPONENT = 30, -900  # of the whole numbers that make a sum, and the exponent of the smallest values
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of the components of a symmetric matrix


class SolidWithRigid(Solid):
    """Bodies that deform, or none, beside rigid ones: obstacles, which stand or go as told, and free ones."""

    def _begin(self, scene: Scene) -> tuple[SolidForm, Sequence[Contact | Walls]]:
        c, bodies = self.columns, present(scene.solid).bodies
        self._time, self._elapsed, self._longest = 0.0, 0.0, scene.time.end
        self._prescribed = {b: body.motion for b, body in enumerate(bodies) if isinstance(body.motion, Motion)}
        free = {b: body.motion for b, body in enumerate(bodies) if isinstance(body.motion, Free)}
        self._free: dict[int, RigidBody] = {}
        self._centers = np.zeros((len(bodies), 3))  # at the start
        sound = [body.eos.reference_sound_speed(body.density) if body.motion else 0.0 for body in bodies]
        c[REFERENCE], c["sound_speed"] = c["position"].copy(), np.array(sound)[c["body"]]
        c["fixed"] = c["fixed"] | np.isin(c["body"], list(self._prescribed))
        for b, motion in free.items():
            if motion.mass is not None:
                share = np.where(c["body"] == b, motion.mass / self._sums(c["mass"][:, None])[b, 0], 1.0)
                c["mass"], c["density"] = share * c["mass"], share * c["density"]
        form, contacts = super()._begin(scene)
        self._meets = bool(contacts)
        for b, motion in free.items():
            self._free[b] = self._rigid_body(b, motion, bodies[b].velocity)
            self._centers[b] = self._free[b].center
        self._follow()
        return form, contacts

    def _rigid_body(self, b: int, motion: Free, velocity: tuple[float, ...]) -> RigidBody:
        """Collective. A free body as its points tell. Each is a cube; what they move beyond their middles only the body
        knows."""
        c, D = self.columns, self.dimensions
        mass, positions = c["mass"][:, None], _padded(c["position"])
        total, *moment = self._sums(np.hstack([mass, mass * positions]))[b]
        arms = positions - np.array(moment) / total
        products = np.stack([arms[:, i] * arms[:, k] for i, k in PAIRS], axis=1)
        size2 = (c["mass"] / c["density"])[:, None] ** (2.0 / D)
        *seconds, unseen = self._sums(mass * np.hstack([products, size2 / 6.0]))[b]
        seen = moments_of(np.array(seconds))
        inertia = seen + unseen * np.eye(3)
        if motion.inertia:
            inertia = np.diag([total, total, *motion.inertia][-3:])
        moves = np.zeros(6, dtype=bool)
        moves[:D] = True
        moves[3:] = [D == 3, D == 3, D > 1]
        for axis in range(D):
            if self.sides.continued[b] >> axis & 1:  # half of a body whose mirror image moves along
                moves[axis] = False
                moves[3:] &= np.arange(3) == axis
        center = np.array(moment) / total
        body = RigidBody(float(total), center, inertia, moves, seen)
        for support in motion.supports:
            at = center if support.at is None else _padded(support.at)
            springs = (_padded(support.stiffness), _padded(support.damping))
            body.anchors.append(Anchor(at - center, at, *springs, support.strength or math.inf))
        spin = (0.0, 0.0, *motion.spin)[-3:] if motion.spin else (0.0,) * 3
        body.set_motion(_padded(velocity), np.array(spin))
        return body

    # ---- the step ---------------------------------------------------------------------------------------------------

    def prepare(self, reach: float = 0.0, stray: float = 0.0, goes_on: bool = False) -> None:
        """Collective. As of any solid; obstacles go on as told."""
        c = self.columns
        if self._prescribed:
            velocity = np.array(c["velocity"])
            for b, motion in self._prescribed.items():
                rows = self._rows[b]
                velocity[rows] = motion.velocities(c[REFERENCE][rows], self._time)
            self._go_at(velocity)
        if not goes_on:
            self._elapsed = 0.0
            for body in self._free.values():
                body.begin()
        super().prepare(reach, stray, goes_on)
        if not (self._prescribed or self._free):
            return
        limits, rows = np.array(self.device.download(self._limits)), self._rigid_rows
        limits[rows] = (SAFETY * c["h"] / c["sound_speed"])[rows, None] if self._meets else math.inf
        self._limits = self.device.array(limits)

    def _go_at(self, velocity: np.ndarray) -> None:
        """Particles have a `velocity` (own, D) [m/s] from now on, which costs what moves them impulse and work."""
        before, mass = self.columns["velocity"], self.columns["mass"][:, None]
        given = mass * (velocity - before)
        work = (0.5 * given * (velocity + before)).sum(axis=1, keepdims=True)
        sums = self._per_body(self.device.array(np.hstack([work, given]))).sum(axis=1)
        self._gravity_work += sums[:, 0]
        self._boundary_impulse += sums[:, 1:]
        self.columns["velocity"] = velocity

    def time_step(self) -> tuple[float, str]:
        """As of any solid; and to the next row of a motion's table, and a tenth of a radian of a turn or a swing."""
        limits = [super().time_step(), (self._longest, "solid")]
        limits += [(motion.next_row(self._time), "motion of the obstacles") for motion in self._prescribed.values()]
        for b, body in self._free.items():
            limits.append((body.time_step(), f"turn or supports of rigid body '{self._scene.bodies[b].name}'"))
        return min(limits, key=lambda limit: limit[0] if limit[0] == limit[0] else -1.0)

    def kick(self, dt: float) -> None:
        """After prepare(). As of any solid; points get the acceleration of their body."""
        if not self._free:
            super().kick(dt)
            return
        c, D = self.columns, self.dimensions
        acceleration, gravity = np.array(self.device.download(self._acceleration)), self._gravity()
        pushes = self._pushes(c["mass"][:, None] * acceleration)
        for b, body in self._free.items():
            body.kick(dt, pushes[b, :3] + body.mass * gravity, pushes[b, 3:])
            rows = self._rows[b]
            after = body.velocities(_padded(c["position"][rows]))[:, :D]
            acceleration[rows] = (after - c["velocity"][rows]) / dt - gravity[:D]
        self._acceleration = self.device.array(acceleration)
        super().kick(dt)

    def drift(self, dt: float) -> None:
        """Collective, after kick(). As of any solid; rigid bodies go and turn."""
        super().drift(dt)
        self._elapsed += dt
        self._follow()

    def _going(self, dt: float) -> Any:
        """The velocity (own, D) [m/s] with which particles go on for `dt` [s]: of rigid bodies straight to where these
        are then."""
        self._time += dt
        if not (self._prescribed or self._free):
            return super()._going(dt)
        c, D = self.columns, self.dimensions
        going, position = np.array(c["velocity"]), c["position"]
        for b, rows in enumerate(self._rows):
            if b in self._free:
                self._free[b].go(dt)
                there = self._free[b].positions(_padded(c[REFERENCE][rows]) - self._centers[b])[:, :D]
            elif b in self._prescribed:
                there = self._prescribed[b].positions(c[REFERENCE][rows], self._time)
            else:
                continue
            going[rows] = (there - position[rows]) / dt
        return self.device.array(going)

    def _follow(self) -> None:
        """Points of free bodies get their velocities."""
        if not self._free:
            return
        c = self.columns
        velocity = np.array(c["velocity"])
        for b, body in self._free.items():
            velocity[self._rows[b]] = body.velocities(_padded(c["position"][self._rows[b]]))[:, : self.dimensions]
        c["velocity"] = velocity

    def share_push(self, mass: Any, gained: Any, impulse: Any, shared: Any) -> tuple[Any, Any]:
        """Collective, after advance(). See solid/protocol.py: bodies share as wholes."""
        if not self._free:
            return impulse, shared
        D, download = self.dimensions, self.device.download
        mass, gained, impulse, shared = (np.array(download(array)) for array in (mass, gained, impulse, shared))
        given, added = mass[:, None] * gained[:, :D], mass * gained[:, D]
        pushes, arms = self._pushes(given), self._arms()
        seconds = np.stack([arms[:, i] * arms[:, k] for i, k in PAIRS], axis=1)
        sums = self._sums(added[:, None] * np.hstack([np.ones((self.count, 1)), arms, seconds]))
        for b, body in self._free.items():
            total, first = sums[b, 0], across(sums[b, 1:4])
            along = np.block([[total * np.eye(3), -first], [first, moments_of(sums[b, 4:])]])
            gains, rows = body.share(pushes[b], along), self._rows[b]
            shared[rows] = (gains[:3] + np.cross(gains[3:], arms[rows]))[:, :D]
            impulse[rows] = given[rows] - added[rows, None] * shared[rows]
        return self.device.array(impulse), self.device.array(shared)

    def apply_impulse(self, impulse: Any) -> Any:
        """After advance() and before migrate(). As of any solid; points get the velocity that their body gains."""
        if not self._free:
            return super().apply_impulse(impulse)
        c, D, device = self.columns, self.dimensions, self.device
        given = device.download(impulse)
        pushes, felt, mass = self._pushes(given), np.array(given), c["mass"][:, None]
        work = np.zeros((self.count, 1))
        for b, body in self._free.items():
            rows = self._rows[b]
            body.take(pushes[b, :3], pushes[b, 3:])
            before, after = c["velocity"][rows], body.velocities(_padded(c["position"][rows]))[:, :D]
            felt[rows] = mass[rows] * (after - before)
            work[rows, 0] = (0.5 * (given - felt)[rows] * (before + after)).sum(axis=1)
        excess = super().apply_impulse(device.array(felt))
        # What bodies feel is all that is given, but for what symmetry planes hold.
        sums = self._per_body(device.array(np.hstack([work, given - felt])))
        self.given = self.given + sums[:, :, 1:]
        self.work = self.work + sums[:, :, 0].sum(axis=1)
        self._boundary_impulse -= sums[:, :, 1:].sum(axis=1)
        return excess

    def _settle(self, home: DualArray) -> None:
        """As of any solid; where the points of each body are."""
        super()._settle(home)
        body = self.columns["body"]
        self._rows = [np.flatnonzero(body == b) for b in range(self.given.shape[1])]
        self._rigid_rows = np.flatnonzero(self._rigid[body])

    # ---- sums over bodies -------------------------------------------------------------------------------------------

    def _sums(self, values: np.ndarray) -> np.ndarray:
        """Collective. Sums (bodies, k) of `values` (own, k) over the points of rigid bodies of all ranks, the same to
        the bit however blocks cut a body: each value as two whole numbers of BITS bits, whose sums are exact."""
        bodies, k = len(self._rows), values.shape[1]
        of_bodies = [values[rows] if self._scene.bodies[b].motion else values[:0] for b, rows in enumerate(self._rows)]
        largest = np.array([np.abs(each).max(axis=0, initial=0.0) for each in of_bodies])
        largest = self.communicator.maximum(largest.ravel()).reshape(bodies, k)
        size = np.maximum(np.frexp(largest)[1], MINIMUM_EXPONENT)
        units = np.ldexp(1.0, np.stack([size - BITS, size - 2 * BITS]))
        sums = np.zeros((2, bodies, k))
        for b, each in enumerate(of_bodies):
            whole = np.rint(each / units[0, b])
            sums[0, b] = whole.sum(axis=0)
            sums[1, b] = np.rint((each - whole * units[0, b]) / units[1, b]).sum(axis=0)
        return (np.sum(self.communicator.allgather(sums), axis=0) * units).sum(axis=0)

    def _pushes(self, force: np.ndarray) -> np.ndarray:
        """Collective. Sums (bodies, 6) of a `force` (own, D) on points and its moment about the center of free
        bodies."""
        force = _padded(force)
        return self._sums(np.hstack([force, np.cross(self._arms(), force)]))

    def _arms(self) -> np.ndarray:
        """(own, 3) [m] of points from the centers of their bodies, 0 where these are not free."""
        positions, arms = _padded(self.columns["position"]), np.zeros((self.count, 3))
        for b, body in self._free.items():
            arms[self._rows[b]] = positions[self._rows[b]] - body.center
        return arms

    def _gravity(self) -> np.ndarray:
        """(3,) [m/s2] of the sources."""
        return _padded(self.body_force.now)

    # ---- totals and output ------------------------------------------------------------------------------------------

    def totals(self) -> dict[str, np.ndarray]:
        """Collective. As of any solid; supports hold internal energy."""
        found = super().totals()
        for body in self._free.values():
            found["kinetic"] = found["kinetic"] + body.unseen
            found["internal"] = found["internal"] + body.absorbed
        return found

    def reported(self) -> dict[str, float]:
        """Collective. As of any solid; place, velocity and angle of the free bodies, and the fluid's mean force in the
        last step."""
        D, found = self.dimensions, super().reported()
        newton = per_extent("N", D)
        blocks, bodies, axes = self.given.shape
        forces = self.blocks.sum(self.given.reshape(blocks, bodies * axes)).reshape(bodies, axes)
        forces = forces / self._elapsed if self._elapsed > 0.0 else np.zeros_like(forces)
        for b, body in self._free.items():
            name = self._scene.bodies[b].name
            along = {"{} [m]": body.center, "velocity_{} [m/s]": body.velocity, f"force_{{}} [{newton}]": forces[b]}
            for words, vector in along.items():
                found |= {f"{name} {words.format(AXES[d])}": float(vector[d]) for d in range(D)}
            turns = {3: [(f"angle_{axis}", d) for d, axis in enumerate(AXES)], 2: [("angle", 2)]}.get(D, [])
            found |= {f"{name} {turn} [rad]": float(body.angle[d]) for turn, d in turns}
        return found

    # ---- restart ----------------------------------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        states = {f"rigid_{b}": body.state() for b, body in self._free.items()}
        return {**super().snapshot(), "values": {"time": np.array(self._time), **states}}

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, whose particles may be on any rank."""
        super().restore(snapshot)
        self._time = float(snapshot["values"]["time"])
        for b, body in self._free.items():
            body.restore(snapshot["values"][f"rigid_{b}"])


def _padded(vectors: Any) -> np.ndarray:
    """(..., 3) of vectors (..., D): 0 along the axes that there are not."""
    vectors = np.asarray(vectors, dtype=float)
    missing = 3 - vectors.shape[-1]
    return np.pad(vectors, [(0, 0)] * (vectors.ndim - 1) + [(0, missing)])
