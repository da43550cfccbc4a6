"""The surface of bodies that stand, as their shapes have it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.scene.description import Scene, Shape
from distfsi.scene.motion import Motion
from distfsi.scene.shapes import distance
from distfsi.solid.protocol import Structure


class ExactSurface:
    """Distances from the shapes of all bodies, none of which ever moves."""

    def __init__(self, shapes: Sequence[Shape]):
        self._shapes = shapes

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance (n,) [m] of `points` (n, D), negative in a body."""
        return np.minimum.reduce([distance(shape, points) for shape in self._shapes])

    def is_thick(self, points: np.ndarray, width: float) -> np.ndarray:
        """Whether a body around `points` (n, D) in it is as thick as `width` [m]: (n,)."""
        deepest = -self.distance(points)
        ways = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=points.shape[1]) if any(way)])
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        for way in np.concatenate([0.5 * width * ways, width * ways]):
            deepest = np.maximum(deepest, -self.distance(points + way))
        return deepest >= 0.45 * width


def exact_surface(scene: Scene, solid: Structure, communicator: Communicator) -> ExactSurface | None:
    """Collective. That of the scene's bodies, if all of them stand for ever: obstacles, and what is fixed as a
    whole."""
    bodies, c = present(scene.solid).bodies, solid.columns
    standing = [isinstance(body.motion, Motion) and body.motion.stands for body in bodies]
    fixed = [body.motion is None and body.fixed is not None and not body.fixed_velocity for body in bodies]
    goes = not all(a or b for a, b in zip(standing, fixed, strict=True)) or not c["fixed"].all()
    if communicator.maximum(np.array([float(goes)]))[0]:
        return None
    return ExactSurface([body.shape for body in bodies])
