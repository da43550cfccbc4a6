"""Where the wall of a solid made of particles cuts the fluid's cells."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations, product
from math import prod, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.kernels import band, wall_distance
from distfsi.coupling.cut_cells.kernels import geometry as kernels
from distfsi.device.interface import Device, DualArray
from distfsi.mesh import search
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.kernels.rows import count_marked, list_marked, take_rows
from distfsi.mesh.rows import Rows
from distfsi.mesh.search import SearchCells

SMOOTHING_RADIUS = 1.5  # in cells, of the kernel whose sum gives the distance
COARSEST = 3.0  # particle spacings that this radius spans at least
MARGIN = 0.15  # of a cell, on each side: what thin bodies are thicker than must be, as they move in a step
THIN, THICK = 0.1, 0.45  # of a cell, beyond its diagonal: the thickness up to which a body is thin, and from which not
REACHES, AWAY, ASIDE = 0.2, 0.6, 0.9  # half cells or spacings: gaps to the domain's ends, width of a column of a body
PROFILE_POINTS = 1025
NEAR_LANES = 8  # points that are computed side by side: more would lie farther apart
DRIVERS = (
    *search.DRIVERS,
    take_rows,
    wall_distance.fill_kernel,
    wall_distance.thicken,
    wall_distance.find_near,
    wall_distance.mark_balls,
    wall_distance.mark_corners,
    wall_distance.find_distances,
    wall_distance.add_balls,
    kernels.open_up,
    kernels.mark_cut_blocks,
    kernels.find_masters,
    kernels.find_refuges,
    kernels.cover_evicted,
    band.find_whole,
    band.find_band,
    band.list_band,
    band.mark_band,
    count_marked,
    list_marked,
)
STAIRS = (kernels.round_parts, kernels.close_stairs)


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


def plate_share(dimensions: int, thickness: float) -> float:
    """Share of the broad kernel (coupling/formulas/immersed.py) of radius 1 that a plate of a `thickness` around it
    fills."""
    s = np.linspace(-1.0, 1.0, 4001)
    density = (1.0 - s**2) ** (2.0 + 0.5 * (dimensions - 1))
    return float(density[np.abs(s) < 0.5 * thickness].sum() / density.sum())


def _columns(values: Any) -> tuple[Any, int]:
    """Values (n, k) as they lie in memory, and k."""
    return values.reshape(-1), values.shape[1]


def least_alone(spacing: Sequence[float], cfl: float) -> float:
    """The narrowest gap, in cells of a `spacing` [m], in which fluid between two walls is stable by itself.

    What the walls take of its momentum in a step is 2 c dt / gap, of which Runge-Kutta methods bear 2; the CFL number
    bounds the sum of c dt / h over the axes.
    """
    rates = [1.0 / h for h in spacing]
    return cfl * max(rates) / sum(rates)


class WallGeometry:
    """Open parts of cells and faces, before and after a step; arrays are the device's.

    fractions  (old, new) fields (local blocks, 1, Z, Y, X): the part of each cell that is open, ghosts included
    apertures  (old, new) fields (local blocks, D, Z, Y, X): the same of each cell's low face along every axis
    near       (local blocks,) which blocks had particles near them or cells that were not whole
    mark       field (local blocks, 1, Z, Y, X): what cells are to the coupling (coupling/cut_cells/kernels/band.py), no
               ghosts included
    shape, steps, offsets, origin, extent, spacing, cells: of blocks, of ways to neighbours, of the grid
    lanes      how many points that lie near each other are computed side by side
    images     [m]: how far from an end of the domain particles may be that have images there; touching (3,) [m]: how
               far from it their body may be for these to count in full, and not at all; how wide its columns are
    radius     [m] of the kernel; seen [m]: how far from a cell's center particles may be that make its wall
    """

    def __init__(self, blocks: Blocks, team: Device, spacing: float, real: type, cfl: float, stairs: bool):
        """`spacing` [m] of the coarsest particles; `stairs`: cells are open as a whole or not at all."""
        self._stairs = stairs
        self.blocks, self.team, D = blocks, team, blocks.grid.dimensions
        self.lanes = min(team.lanes, NEAR_LANES)
        constants = {"DIMENSIONS": D, "LANES": self.lanes, "LEAST_ALONE": least_alone(blocks.grid.spacing[:D], cfl)}
        self.kernels: SimpleNamespace = team.build((*DRIVERS, *(STAIRS if stairs else ())), constants)
        grid, h = blocks.grid, max(blocks.grid.spacing[: blocks.grid.dimensions])
        self.radius = max(SMOOTHING_RADIUS * h, COARSEST * spacing)
        self.ball = sqrt(D * (0.5 * h) ** 2 + (D - 1) * (0.5 * spacing) ** 2) + MARGIN * h
        self._thickness = tuple(plate_share(D, (sqrt(D) + more) * h / self.radius) for more in (THIN, THICK))
        self.search = max(self.radius, self.ball + 1.05 * h)
        off = 0.75 * h if stairs else 0.25 * h  # how far particles may be from where cells are closed
        self.seen = min(1.1 * (0.5 * sqrt(D) * h + max(spacing, self.ball) + off), 2.25 * h)
        self.reach = 2.5 * h + self.search  # two ghost cells, and half a cell that the wall may go in a step
        self.images = self.search + 0.5 * h
        self.touching = tuple(part * max(0.5 * h, spacing) for part in (REACHES, AWAY, ASIDE))
        self._allocate(real)
        self._rows = Rows(team, self.kernels)
        self._cells = search.CellSort(self.kernels, team, grid.lower[:D], grid.upper[:D])
        self._search_cell = 0.5 * min(grid.spacing[:D])
        steps = (1, blocks.shape[2], blocks.shape[2] * blocks.shape[1])
        around = sorted((o for o in product((-1, 0, 1), repeat=D) if any(o)), key=lambda o: (sum(map(abs, o)), o))
        self._profile, self.spacing = team.array(plane_profile(D)), team.array(np.array(grid.spacing))
        self.shape, self.cells, self.steps, self.offsets, self._sequences = (
            team.array(np.array(a)) for a in (blocks.shape, grid.cells, steps, around, list(permutations(range(D))))
        )
        self.origin, self.extent = team.array(blocks.origin), team.array(blocks.extent)
        self._grid = (self.spacing, self.origin, self.extent, self.cells)

    def _allocate(self, real: type) -> None:
        """The fields, of cells that are all open."""
        blocks, team, D = self.blocks, self.team, self.blocks.grid.dimensions
        count = blocks.local_count
        self.fractions = tuple(DualArray(team, np.ones((count, 1, *blocks.shape), real)) for _ in range(2))
        self.apertures = tuple(DualArray(team, np.ones((count, D, *blocks.shape), real)) for _ in range(2))
        self.near = DualArray(team, np.ones(count, dtype=np.uint8))
        self.mark = team.array(blocks.allocate(1, np.int8))
        self._whole, self._plain = (team.array(blocks.allocate(1, np.uint8)).reshape(-1) for _ in range(2))
        corners = tuple(n + (1 if axis < D else 0) for n, axis in zip(blocks.shape, (2, 1, 0), strict=True))
        self._distance = DualArray(team, np.full((count, *corners), self.radius))
        self._count = count * prod(blocks.shape[:2])  # of rows of cells along x
        self._corner_rows = count * prod(corners[:2])

    def sort(self, position: Any, key: Any) -> SearchCells:
        """Particles by the cells of the grid they are in."""
        return self._cells.sort(position, key, self._search_cell)[1]

    def coarse_order(self, position: Any, key: Any) -> Any:
        """Particles so that those near each other, a few in a cell, follow each other."""
        return self._cells.sort(position, key, 2.0 * self._search_cell)[1].order

    def near_order(self, values: Any, at: Any, shape: tuple[int, ...]) -> Any:
        """`values` (n,) of what lies `at` (n,) in the memory of a field of a `shape` (Z, Y, X) per block, so that those
        near each other follow each other. Where one is computed at a time the order does not matter."""
        if self.lanes == 1:
            return values
        row, x = np.divmod(self.team.download(at), shape[2])
        layer, y = np.divmod(row, shape[1])
        brick = (layer // 2 * shape[1] + y // 2) * shape[2] + x // 2
        return self.team.array(self.team.download(values)[np.argsort(brick, kind="stable")])

    def fill(self, own: int, chosen: Any, position: Any, volume: Any, bins: SearchCells) -> Any:
        """Share of the broad kernel around each of the first `own` particles that is filled, and the mean way [m] to
        what fills it, (own, 1 + D). `chosen` (m,): all own particles and maybe others, as of coarse_order()."""
        filled = self.team.empty((own, 1 + self.blocks.grid.dimensions))
        boxes = -(-chosen.shape[0] // self.lanes)
        self.team.run(self.kernels.fill_kernel, boxes, filled, chosen, self.radius, *_columns(volume), position, *bins)
        return filled

    def thicken(self, own: int, filled: Any, chosen: Any, position: Any, volume: Any, bins: SearchCells) -> Any:
        """Balls (own, 2 + D) as which particles of thin bodies count (coupling/cut_cells/kernels/wall_distance.py);
        `filled` of all, `chosen` as for fill()."""
        ball = self.team.empty((own, 2 + self.blocks.grid.dimensions))
        boxes, sizes = -(-chosen.shape[0] // self.lanes), (self.radius, self.ball, *self._thickness)
        around = (chosen, *sizes, *_columns(volume), position, *bins)
        self.team.run(self.kernels.thicken, boxes, ball, filled.reshape(-1), *around)
        return ball

    def cut(self, position: Any, volume: Any, ball: Any, key: Any, bins: SearchCells) -> None:
        """The new geometry becomes the old one, and that of these particles the new one."""
        self.fractions, self.apertures = self.fractions[::-1], self.apertures[::-1]
        run, k, count, near = self.team.run, self.kernels, self.blocks.local_count, self.near.device
        mark = self.team.empty(position.shape[0], np.int8)
        run(k.mark_balls, position.shape[0], ball, volume, mark)
        balls, rows = self._rows.marked(mark)
        reach = self.search if balls else self.radius
        run(k.find_near, count, near, reach, bins.start, *bins[2:], *self._grid[:3])
        corners = self._corners_near(reach, bins)
        boxes, grid = -(-corners.shape[0] // self.lanes), (self.shape, self.spacing, self.origin, self.cells)
        particles = (*_columns(volume), self._profile, position, *bins)
        run(k.find_distances, boxes, corners, self._corners, self.radius, *particles, *grid)
        if balls:
            self.add_balls(corners, *(self._rows.taken(array, rows) for array in (position, ball, key)))
        before, after = self.parts
        is_cut = self.team.empty(self._count, np.int8)
        run(
            k.open_up, self._count, near, self._corners, before, after, self.faces[1], self.shape, self.extent, is_cut
        )  # fmt: skip
        if self._stairs:
            run(k.round_parts, self._count, near, after, self.shape)
            run(k.close_stairs, self._count, near, after, self.faces[1], self.shape, self.steps)
        run(k.mark_cut_blocks, count, near, is_cut, prod(self.blocks.shape[:2]))

    def _corners_near(self, reach: float, bins: SearchCells) -> Any:
        """The corners (n,) that may have particles within `reach` [m]; the others are open."""
        mark = self.team.zeros(self._corners.shape[0], np.int8)
        self.team.run(
            self.kernels.mark_corners, self._corner_rows, self.near.device, self._corners, mark, self.radius, reach,
            bins.start, *bins[2:], self.shape, *self._grid,
        )  # fmt: skip
        corners = self._rows.marked(mark)[1]
        return self.near_order(corners, corners, self._distance.device.shape[1:])

    def add_balls(self, corners: Any, position: Any, ball: Any, key: Any) -> None:
        """Distances at the `corners` become those to these particles' balls where they are nearer."""
        bins, boxes = self._cells.sort(position, key, 2.0 * self._search_cell)[1], -(-corners.shape[0] // self.lanes)
        self.team.run(
            self.kernels.add_balls, boxes, corners, self._corners, self.ball, self.search, ball, position, *bins,
            self.shape, self.spacing, self.origin, self.cells,
        )  # fmt: skip

    @property
    def _corners(self) -> Any:
        """Flat distances."""
        return self._distance.device.reshape(-1)

    @property
    def parts(self) -> tuple[Any, Any]:
        """Flat fractions, old and new."""
        return tuple(field.device.reshape(-1) for field in self.fractions)

    @property
    def faces(self) -> tuple[Any, Any]:
        """Flat apertures, old and new."""
        return tuple(field.device.reshape(-1) for field in self.apertures)

    def cut_cells(self, block: int) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, D) [x first] in memory of a block's cells that are cut, and the middles (n, D) [m] of their open
        corners, each by its distance from the wall."""
        D, blocks, grid = self.blocks.grid.dimensions, self.blocks, self.blocks.grid
        part, extent = self.fractions[1].host()[block, 0], blocks.extent[block]
        inner = tuple(slice(g, g + n) for g, n in zip(grid.ghosts[::-1], extent[::-1], strict=True))
        place = np.argwhere((part[inner] > 0.0) & (part[inner] < 1.0))[:, ::-1] + grid.ghosts
        weight, middle = np.zeros(len(place)), np.zeros((len(place), D))
        for corner in product((0, 1), repeat=D):
            at = place + np.pad(corner, (0, 3 - D))
            free = np.maximum(self._distance.host()[block][tuple(at.T[::-1])], 0.0)
            x = np.array(grid.lower[:D]) + (blocks.origin[block] - grid.ghosts + at)[:, :D] * grid.spacing[:D]
            weight, middle = weight + free, middle + free[:, None] * x
        return place, middle / weight[:, None]

    def find_masters(self, kind: Any, master: Any, swept: Any, fields: int) -> None:
        """Which cells join which: flat kind (local blocks, 1, …), master (local blocks, D, …), swept (…, fields, …)."""
        self.team.run(
            self.kernels.find_masters, self._count, self.near.read, kind, master, *self.parts, swept, fields,
            *self.faces, self.offsets, self._sequences, self.steps, self.shape, self.origin, self.extent, self.cells,
        )  # fmt: skip

    def find_refuges(self, kind: Any, master: Any) -> None:
        """Where the fluid of cells that are shut can go; after the ghosts of `kind` are known."""
        self.team.run(
            self.kernels.find_refuges, self._count, self.near.read, kind, master, self.parts[1], *self.faces,
            self.steps, self.shape, self.origin, self.extent, self.cells,
        )  # fmt: skip

    def cover_evicted(self, kind: Any, master: Any) -> None:
        """Cover the cells that are shut and have handed their fluid to a refuge."""
        self.team.run(self.kernels.cover_evicted, self._count, kind, master, self.shape)

    def band_rows(self, cells: Any) -> Any:
        """The rows of those of the `cells` (n,), numbered as they lie in memory, that are in the band or covered."""
        chosen = self.team.empty(cells.shape[0], np.int8)
        self.team.run(self.kernels.mark_band, cells.shape[0], cells, self.mark.reshape(-1), chosen)
        return self._rows.marked(chosen)[1]

    def lists(self, kind: Any, swept: Any, fields: int) -> tuple[list[Any], np.ndarray]:
        """The cells of the band around the wall, the covered and the loose ones (coupling/cut_cells/kernels/band.py),
        and how many of them there are in each block (local blocks, 3); a block without them is not near."""
        near, k, run, rows = self.near, self.kernels, self.team.run, self._count
        whole, mark, share = self._whole, self.mark.reshape(-1), (swept, fields)
        run(k.find_whole, rows, near.read, whole, kind, *self.parts, *share, self.shape)
        found = self.team.empty((rows, 3), np.int64)
        run(
            k.find_band, rows, near.read, self._plain, mark, whole, kind, *share, self.offsets, self.steps, self.shape,
            self.extent, found,
        )  # fmt: skip
        counts = self.team.download(found)
        in_blocks = counts.reshape(self.blocks.local_count, prod(self.blocks.shape[:2]), 3).sum(axis=1)
        near.host()[(near.host() != wall_distance.CUT) & (in_blocks.sum(axis=1) == 0)] = 0
        near.changed()
        first = self.team.array(np.cumsum(counts, axis=0) - counts)
        lists = [self.team.empty(n, np.int64) for n in in_blocks.sum(axis=0)]
        run(k.list_band, rows, near.read, mark, self.shape, self.extent, first, *lists)
        return lists, in_blocks
