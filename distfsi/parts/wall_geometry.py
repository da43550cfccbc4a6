"""Where the wall of a solid made of particles cuts the fluid's cells."""

from __future__ import annotations

from itertools import permutations, product
from math import prod, sqrt
from types import SimpleNamespace

import numpy as np

from distfsi.device.seam import Device
from distfsi.kernels import band
from distfsi.kernels import cut_geometry as kernels
from distfsi.mesh.blocks import Blocks
from distfsi.parts import search
from distfsi.parts.search import SearchCells

SMOOTHING_RADIUS = 1.5  # in cells, of the kernel whose sum gives the distance
COARSEST = 3.0  # particle spacings that this radius spans at least
PROFILE_POINTS = 1025
DRIVERS = (
    *search.DRIVERS,
    kernels.fill_kernel,
    kernels.thicken,
    kernels.find_distances,
    kernels.open_up,
    kernels.find_masters,
    kernels.find_refuges,
    band.find_whole,
    band.find_band,
    band.list_band,
)


def plane_profile(dimensions: int, points: int = PROFILE_POINTS) -> np.ndarray:
    """Share (points,) of the Wendland C2 kernel of radius 1 on one side of a plane, from -1 to 1 across it."""
    s = np.linspace(-1.0, 1.0, 8 * (points - 1) + 1)
    if dimensions == 1:
        density = (1.0 - np.abs(s)) ** 3 * (1.0 + 3.0 * np.abs(s))
    else:
        part = (np.arange(400) + 0.5) / 400
        half = np.sqrt(1.0 - s**2)[:, None]
        r = np.minimum(np.sqrt(s[:, None] ** 2 + (half * part) ** 2), 1.0)
        density = (half * (1.0 - r) ** 4 * (1.0 + 4.0 * r) * (half * part) ** (dimensions - 2)).sum(axis=1)
    share = np.append(0.0, np.cumsum(density[1:] + density[:-1]))
    return 0.5 + 0.5 * (share - share[::-1])[::8] / share[-1]


class WallGeometry:
    """Open parts of cells and faces, before and after a step.

    fractions  (old, new) fields (local blocks, 1, Z, Y, X): the part of each cell that is open, ghosts included
    apertures  (old, new) fields (local blocks, D, Z, Y, X): the same of each cell's low face along every axis
    near       (local blocks,) which blocks had particles near them or cells that were not whole
    radius     [m] of the kernel; seen [m]: how far from a cell's center particles may be that make its wall
    """

    def __init__(self, blocks: Blocks, team: Device, spacing: float, real: type):
        """`spacing` [m] of the coarsest particles."""
        self.blocks, self.team, D = blocks, team, blocks.grid.dimensions
        self.kernels: SimpleNamespace = team.build(DRIVERS, {"DIMENSIONS": D})
        grid, h = blocks.grid, max(blocks.grid.spacing[: blocks.grid.dimensions])
        self.radius = max(SMOOTHING_RADIUS * h, COARSEST * spacing)
        self.ball = sqrt(D * (0.5 * h) ** 2 + (D - 1) * (0.5 * spacing) ** 2) + 0.05 * h
        self.search = max(self.radius, self.ball + 1.05 * h)
        self.seen = min(1.1 * (0.5 * sqrt(D) * h + max(spacing, self.ball) + 0.5 * h), 2.5 * h)
        self.reach = 2.5 * h + self.search  # two ghost cells, and half a cell that the wall may go in a step
        self.fractions = tuple(np.ones((blocks.local_count, 1, *blocks.shape), real) for _ in range(2))
        self.apertures = tuple(np.ones((blocks.local_count, D, *blocks.shape), real) for _ in range(2))
        self.near = np.ones(blocks.local_count, dtype=np.uint8)
        self._whole, self._plain = blocks.allocate(1, np.uint8), blocks.allocate(1, np.uint8)
        corners = tuple(n + (1 if axis < D else 0) for n, axis in zip(blocks.shape, (2, 1, 0), strict=True))
        self._distance = np.full((blocks.local_count, *corners), self.radius)
        self._profile = plane_profile(D)
        self._lower, self._upper, self._spacing = (np.array(a) for a in (grid.lower, grid.upper, grid.spacing))
        self._cells = search.CellSort(self.kernels, team, self._lower[:D], self._upper[:D])
        self.shape, self.cells = np.array(blocks.shape), np.array(grid.cells)
        self.steps = np.array([1, self.shape[2], self.shape[2] * self.shape[1]])
        around = sorted((o for o in product((-1, 0, 1), repeat=D) if any(o)), key=lambda o: (sum(map(abs, o)), o))
        self.offsets = np.array(around)
        self._sequences = np.array(list(permutations(range(D))))

    def sort(self, position: np.ndarray, key: np.ndarray) -> SearchCells:
        """Particles by the cells of the grid they are in."""
        return self._cells.sort(position, key, float(self._spacing[: self.blocks.grid.dimensions].min()))[1]

    def fill(self, own: int, position: np.ndarray, volume: np.ndarray, bins: SearchCells) -> np.ndarray:
        """Share (own,) of the kernel around each of the first `own` particles that is filled."""
        filled = np.empty(own)
        self.team.run(self.kernels.fill_kernel, own, filled, self.radius, volume, position, *bins)
        return filled

    def thicken(self, own, filled, position, volume, bins) -> np.ndarray:
        """Radius (own,) [m] of the balls as which particles of thin bodies count; `filled` of all particles."""
        ball = np.empty(own)
        self.team.run(
            self.kernels.thicken, own, ball, filled, self.radius, self.ball, volume, position, *bins
        )  # fmt: skip
        return ball

    def cut(self, position: np.ndarray, volume: np.ndarray, ball: np.ndarray, bins: SearchCells) -> None:
        """The new geometry becomes the old one, and that of these particles the new one."""
        self.fractions, self.apertures = self.fractions[::-1], self.apertures[::-1]
        blocks, count = self.blocks, self.blocks.local_count
        self.team.run(
            self.kernels.find_distances, count, self.near, self._distance.reshape(-1), self.radius,
            self.search if ball.any() else self.radius, volume, ball, self._profile, position, *bins,
            self.shape, self._spacing, blocks.origin, blocks.extent, self.cells,
        )  # fmt: skip
        before, after = self.parts
        self.team.run(
            self.kernels.open_up, count, self.near, self._distance.reshape(-1), before, after, self.faces[1],
            self.shape, blocks.extent,
        )  # fmt: skip

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Flat fractions, old and new."""
        return tuple(field.reshape(-1) for field in self.fractions)

    @property
    def faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Flat apertures, old and new."""
        return tuple(field.reshape(-1) for field in self.apertures)

    def cut_cells(self, block: int) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, D) [x first] in memory of a block's cells that are cut, and the middles (n, D) [m] of their open
        corners, each by its distance from the wall."""
        D, blocks, grid = self.blocks.grid.dimensions, self.blocks, self.blocks.grid
        part, extent = self.fractions[1][block, 0], blocks.extent[block]
        inner = tuple(slice(g, g + n) for g, n in zip(grid.ghosts[::-1], extent[::-1], strict=True))
        place = np.argwhere((part[inner] > 0.0) & (part[inner] < 1.0))[:, ::-1] + grid.ghosts
        weight, middle = np.zeros(len(place)), np.zeros((len(place), D))
        for corner in product((0, 1), repeat=D):
            at = place + np.pad(corner, (0, 3 - D))
            free = np.maximum(self._distance[block][tuple(at.T[::-1])], 0.0)
            x = self._lower[:D] + (blocks.origin[block] - grid.ghosts + at)[:, :D] * self._spacing[:D]
            weight, middle = weight + free, middle + free[:, None] * x
        return place, middle / weight[:, None]

    def find_masters(self, kind: np.ndarray, master: np.ndarray, swept: np.ndarray) -> None:
        """Which cells join which: kind (local blocks, 1, …) and master (local blocks, D, …); swept (…, k, …)."""
        blocks = self.blocks
        self.team.run(
            self.kernels.find_masters, blocks.local_count, self.near, kind.reshape(-1), master.reshape(-1),
            *self.parts, swept.reshape(-1), swept.shape[1], *self.faces, self.offsets, self._sequences, self.steps,
            self.shape, blocks.origin, blocks.extent, self.cells,
        )  # fmt: skip

    def find_refuges(self, kind: np.ndarray, master: np.ndarray) -> None:
        """Where the fluid of cells that are shut can go; after the ghosts of `kind` are known."""
        blocks = self.blocks
        self.team.run(
            self.kernels.find_refuges, blocks.local_count, self.near, kind.reshape(-1), master.reshape(-1),
            self.parts[1], *self.faces, self.steps, self.shape, blocks.origin, blocks.extent, self.cells,
        )  # fmt: skip

    def is_band(self, cells: np.ndarray) -> np.ndarray:
        """Which of these cells, numbered as they lie in memory, are in the band or covered."""
        blocks = cells // int(self.shape.prod())
        return (self.near[blocks] > 0) & (self._plain.reshape(-1)[cells] == 0)

    def lists(self, kind: np.ndarray, swept: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The cells of the band around the wall, the covered and the loose ones (kernels/band.py); a block without them
        is not near."""
        near, extent, k = self.near, self.blocks.extent, self.kernels
        whole, plain, kind = self._whole.reshape(-1), self._plain.reshape(-1), kind.reshape(-1)
        share = (swept.reshape(-1), swept.shape[1])
        blocks, rows = self.blocks.local_count, prod(self.blocks.shape[:2])
        self.team.run(k.find_whole, blocks * rows, near, whole, kind, *self.parts, *share, self.shape)
        counts = np.empty((blocks * rows, 3), dtype=np.int64)
        self.team.run(
            k.find_band, blocks * rows, near, plain, whole, kind, *share, self.offsets, self.steps, self.shape, extent,
            counts,
        )  # fmt: skip
        in_blocks = counts.reshape(blocks, rows, 3).sum(axis=(1, 2))
        near[(near != kernels.CUT) & (in_blocks == 0)] = 0
        first = np.cumsum(counts, axis=0) - counts
        lists = tuple(np.empty(n, dtype=np.int64) for n in counts.sum(axis=0))
        self.team.run(k.list_band, blocks * rows, near, plain, kind, *share, self.shape, extent, first, *lists)
        return lists
