"""When each cell of a detonating explosive is lit."""

from __future__ import annotations

import numpy as np

from distfsi.fluid.marching import march
from distfsi.mesh.blocks import Blocks
from distfsi.narrowing import present
from distfsi.scene.description import Detonation, Detonator, LineDetonator, PlaneDetonator, PointDetonator, Scene
from distfsi.scene.shapes import bounding_box, contains

AROUND_DETONATOR = 6  # cells, within which fronts run straight also where they march around obstacles
NEAREST = 8  # cells with explosive that may be as near to one without
ALIKE = 1e-6  # of a cell: distances that are one
SAMPLES = 4 * AROUND_DETONATOR  # of a line, for what is in its way


def lighting_times(scene: Scene, blocks: Blocks) -> np.ndarray:
    """Times (local blocks, 1, Z, Y, X) [s] at the centers of the active cells, infinite elsewhere: that of the
    detonator whose front comes first.

    They are known in all cells, also where there is no explosive at the start, so that what flows there is lit.
    """
    detonation = present(present(scene.fluid).detonation)
    charge = Charge(scene, detonation, blocks) if detonation.path == "around" else None
    times = np.full((blocks.local_count, 1, *blocks.shape), np.inf)
    for block in range(blocks.local_count):
        points = _points(blocks.cell_centers(block)[: blocks.grid.dimensions])
        found = charge.times(points) if charge else straight(detonation, points)
        x, y, z = (slice(g, g + n) for g, n in zip(blocks.grid.ghosts, blocks.extent[block], strict=True))
        times[block, 0, z, y, x] = found.reshape(blocks.extent[block]).T
    return times


def _points(centers: tuple[np.ndarray, ...] | list[np.ndarray]) -> np.ndarray:
    """Centers (n, D) of the cells with these centers along each axis, the first axis slowest."""
    return np.stack(np.meshgrid(*centers, indexing="ij"), axis=-1).reshape(-1, len(centers))


def straight(detonation: Detonation, points: np.ndarray) -> np.ndarray:
    """Times [s] at `points` (n, D) of fronts that run straight -> (n,)."""
    speed = present(detonation.burn.speed)
    fronts = [d.delay + np.linalg.norm(points - nearest(d, points), axis=1) / speed for d in detonation.detonators]
    return np.asarray(np.min(fronts, axis=0))


def nearest(detonator: Detonator, points: np.ndarray) -> np.ndarray:
    """The points (n, D) of a detonator that are nearest to `points` (n, D)."""
    match detonator:
        case PointDetonator(position):
            return np.broadcast_to(np.asarray(position), points.shape)
        case LineDetonator(start, end):
            along = np.subtract(end, start)
            share = np.clip((points - np.asarray(start)) @ along / (along @ along), 0.0, 1.0)
            return np.asarray(np.asarray(start) + share[:, None] * along)
        case PlaneDetonator(point, normal):
            unit = np.asarray(normal) / np.linalg.norm(normal)
            return np.asarray(points - ((points - np.asarray(point)) @ unit)[:, None] * unit)


class Charge:
    """The cells of the grid that hold the explosive at the start, and fronts that march through them alone: around
    solids and what else is in their way. All ranks find the same."""

    def __init__(self, scene: Scene, detonation: Detonation, blocks: Blocks):
        from scipy.spatial import cKDTree

        self.speed = present(detonation.burn.speed)
        axes = blocks.grid.dimensions
        self.lower, self.spacing = (np.array(v[:axes]) for v in (blocks.grid.lower, blocks.grid.spacing))
        self.first, self.cells = _extent(scene, detonation, self.lower, self.spacing)
        along = [
            self.lower[d] + (self.first[d] + np.arange(self.cells[d]) + 0.5) * self.spacing[d] for d in range(axes)
        ]
        points = _points(along)
        inside = _holds_explosive(scene, detonation, points)
        self.inside = inside.reshape(self.cells)
        lit = np.full(len(points), np.inf)
        for detonator in detonation.detonators:
            lit = np.minimum(lit, self._lit_by(detonator, points, inside))
        times = march(lit.reshape(self.cells), self.inside, self.spacing.tolist(), self.speed).ravel()
        reached = np.isfinite(times)
        self._times, self._tree = times[reached], cKDTree(points[reached])

    def _lit_by(self, detonator: Detonator, points: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """Times [s] (n,) where a detonator's front arrives straight, near it; infinite elsewhere."""
        origin = nearest(detonator, points)
        way = np.linalg.norm(points - origin, axis=1)
        reach = AROUND_DETONATOR * self.spacing.max()
        reach = max(reach, float(way[inside].min(initial=0.0)) + self.spacing.max())
        near = np.flatnonzero(inside & (way <= reach))
        shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
        free = np.ones(len(near), dtype=bool)
        for share in shares:
            free &= self._is_inside(points[near] + (1.0 - share) * (origin[near] - points[near])) | (way[near] == 0.0)
        free |= way[near] <= way[near].min(initial=np.inf) + 0.5 * self.spacing.max()
        times = np.full(len(points), np.inf)
        times[near[free]] = detonator.delay + way[near[free]] / self.speed
        return times

    def _is_inside(self, points: np.ndarray) -> np.ndarray:
        index = np.floor((points - self.lower) / self.spacing).astype(int) - self.first
        within = ((index >= 0) & (index < np.array(self.cells))).all(axis=1)
        found = np.zeros(len(points), dtype=bool)
        found[within] = self.inside[tuple(index[within].T)]
        return found

    def times(self, points: np.ndarray) -> np.ndarray:
        """Times [s] (n,) at the centers of cells (n, D): one without explosive is lit from the nearest that has some;
        of those that are as near from the first, so that no round-off chooses."""
        if not len(self._times):
            return np.full(len(points), np.inf)
        way, cell = self._tree.query(points, k=np.arange(1, min(NEAREST, len(self._times)) + 1))
        as_near = way <= way[:, :1] + ALIKE * self.spacing.min()
        way = np.where(way < ALIKE * self.spacing.min(), 0.0, way)[:, 0]
        return np.where(as_near, self._times[cell], np.inf).min(axis=1) + way / self.speed


def _extent(
    scene: Scene, detonation: Detonation, lower: np.ndarray, spacing: np.ndarray
) -> tuple[np.ndarray, tuple[int, ...]]:
    """First cell, and number of cells along each axis, of the part of the grid that regions of the explosive reach."""
    cells = np.array(scene.domain.cells)
    first, last = cells.copy(), np.zeros_like(cells)
    for region in present(scene.fluid).regions:
        if region.state.phase == detonation.phase:
            low, high = bounding_box(region.shape) if region.shape else (lower, lower + cells * spacing)
            ends = [np.clip((np.array(end) - lower) / spacing, 0, cells) for end in (low, high)]
            first = np.minimum(first, np.floor(ends[0]).astype(int))
            last = np.maximum(last, np.ceil(ends[1]).astype(int))
    return first, tuple(np.maximum(last - first, 0).tolist())


def _holds_explosive(scene: Scene, detonation: Detonation, points: np.ndarray) -> np.ndarray:
    """Whether each of `points` (n, D) is in the explosive, and in no body."""
    found = np.zeros(len(points), dtype=bool)
    for region in present(scene.fluid).regions:
        covered = contains(region.shape, points) if region.shape else np.ones(len(points), dtype=bool)
        found[covered] = region.state.phase == detonation.phase
    for body in scene.solid.bodies if scene.solid else ():
        found &= ~contains(body.shape, points)
    return found
