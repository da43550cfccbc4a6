"""When each cell of a detonating explosive is lit."""

from __future__ import annotations

import numpy as np

from distfsi.mesh.blocks import Blocks
from distfsi.narrowing import present
from distfsi.scene.description import Detonation, Detonator, LineDetonator, PlaneDetonator, PointDetonator


def lighting_times(detonation: Detonation, blocks: Blocks) -> np.ndarray:
    """Times (local blocks, 1, Z, Y, X) [s] at the centers of the active cells, infinite elsewhere: that of the
    detonator whose front, at the speed of the detonation and straight, comes first.

    They are known in all cells, also where there is no explosive at the start, so that what flows there is lit.
    """
    times = np.full((blocks.local_count, 1, *blocks.shape), np.inf)
    speed, axes = present(detonation.burn.speed), blocks.grid.dimensions
    for block in range(blocks.local_count):
        centers = blocks.cell_centers(block)[:axes]
        points = np.stack(np.meshgrid(*centers, indexing="ij"), axis=-1).reshape(-1, axes)
        first = np.min([each.delay + distance(each, points) / speed for each in detonation.detonators], axis=0)
        cells = first.reshape([len(along) for along in centers]).T
        x, y, z = (slice(g, g + n) for g, n in zip(blocks.grid.ghosts, blocks.extent[block], strict=True))
        times[block, 0, z, y, x] = cells.reshape(blocks.extent[block][::-1])
    return times


def distance(detonator: Detonator, points: np.ndarray) -> np.ndarray:
    """Distance [m] of `points` (n, D) from a detonator -> (n,)."""
    match detonator:
        case PointDetonator(position):
            return np.asarray(np.linalg.norm(points - np.asarray(position), axis=1))
        case LineDetonator(start, end):
            along = np.subtract(end, start)
            share = np.clip((points - np.asarray(start)) @ along / (along @ along), 0.0, 1.0)
            return np.asarray(np.linalg.norm(points - np.asarray(start) - share[:, None] * along, axis=1))
        case PlaneDetonator(point, normal):
            return np.asarray(np.abs((points - np.asarray(point)) @ np.asarray(normal)) / np.linalg.norm(normal))
