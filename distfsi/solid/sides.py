"""Sides: what holds together is one side, and different sides meet in contact."""

from __future__ import annotations

import numpy as np

from distfsi.device.interface import Columns, DualArray
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.kernels.particles import IMAGES
from distfsi.mesh.particles import Key, ParticleExchange
from distfsi.narrowing import present
from distfsi.scene.description import Solid

ON_THE_PLANE = 0.75  # spacings: a body whose particles come so close to a symmetry plane goes on behind it


class Sides:
    """A body is a side, with all that are tied to it, and its image is another one behind a symmetry plane or periodic
    end that it does not go through. What no bonds hold together is not told from its image beyond a periodic end.

    bodies  how many there are: a side is the number of its first body, for an image behind such a plane so many more
    meet    whether there are different sides
    continued  (bodies,) the axes, as bits, whose symmetry planes or periodic ends a body goes through
    """

    def __init__(self, scene: Solid, columns: Columns, exchange: ParticleExchange, communicator: Communicator):
        """Collective. From where the particles are at the start, with ids that ascend from body to body."""
        c, self.bodies = columns, len(scene.bodies)
        counts = communicator.allgather(np.bincount(c["body"], minlength=self.bodies))
        self._end = np.cumsum(np.sum(counts, axis=0))  # of the ids of each body
        spacing, planes = np.array([body.spacing for body in scene.bodies]), exchange.planes()
        touching = np.zeros((self.bodies, c["position"].shape[1]))
        unbonded = [scene.form_of(body) == "updated_lagrangian" for body in scene.bodies]
        for plane in planes:
            close = np.abs(c["position"][:, plane.axis] - plane.end) < ON_THE_PLANE * spacing[c["body"]]
            touching[c["body"][close], plane.axis] = 1.0
            if plane.shift:
                touching[unbonded, plane.axis] = 1.0
        touching = communicator.maximum(touching.ravel()).reshape(touching.shape)
        self.continued = (touching.astype(np.int64) << np.arange(touching.shape[1])).sum(axis=1)
        self._first = np.array(scene.first_tied)
        self.meet = bool(self._first.any() or any(not touching[:, plane.axis].all() for plane in planes))
        self._device = exchange.device
        self._key: Key | None = None
        self._side: DualArray | None = None

    def of(self, key: Key) -> DualArray:
        """The side (count,) of particles, ghosts and images with these keys."""
        if key is not self._key:
            body = self.body_of(key.host)
            beyond = key.host % IMAGES & ~self.continued[body] > 0
            self._key, self._side = key, DualArray(self._device, self._first[body] + self.bodies * beyond)
        return present(self._side)

    def body_of(self, key: np.ndarray) -> np.ndarray:
        """The body (n,) of the particles and images with the keys (n,)."""
        return np.searchsorted(self._end, key // IMAGES, side="right")
