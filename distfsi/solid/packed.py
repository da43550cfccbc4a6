"""The particles of all bodies before anything happens."""

from __future__ import annotations

import numpy as np

from distfsi.narrowing import present
from distfsi.scene.description import Body, Scene
from distfsi.scene.packing import initial_velocity, pack
from distfsi.scene.shapes import contains


def packed(scene: Scene) -> dict[str, np.ndarray]:
    """Columns of all particles, body by body: id, body, fixed (n,), position [m], velocity [m/s] (n, D), mass [kg],
    density [kg/m3], h [m], energy [J/kg]."""
    bodies = [_packed(scene, b, body) for b, body in enumerate(present(scene.solid).bodies)]
    columns = {name: np.concatenate([c[name] for c in bodies]) for name in bodies[0]}
    return columns | {"id": np.arange(len(columns["body"]))}


def _packed(scene: Scene, b: int, body: Body) -> dict[str, np.ndarray]:
    position, volume = pack(body, scene.domain.lower, scene.domain.upper)
    n = len(position)
    fixed = np.zeros(n, dtype=bool) if body.fixed is None else contains(body.fixed, position)
    return {
        "body": np.full(n, b),
        "position": position,
        "velocity": np.where(fixed[:, None], body.fixed_velocity or 0.0, initial_velocity(body, position)),
        "fixed": fixed,
        "mass": body.density * volume,
        "density": np.full(n, body.density),
        "h": np.full(n, present(scene.solid).smoothing * body.spacing),
        "energy": np.zeros(n),
    }
