"""Where the wall of a solid made of particles cuts the fluid's cells: volume fractions of cells, apertures of faces."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import prod, sqrt
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from distfsi.coupling.cut_cells.exact_surface import ExactSurface
from distfsi.coupling.cut_cells.kernels import fractions, inflation, nodal_distance
from distfsi.coupling.cut_cells.kernels.images import ImageRange
from distfsi.coupling.cut_cells.kernels.inflation import Inflation
from distfsi.coupling.kernels.interpolation import Cloud
from distfsi.device.interface import Device, DualArray
from distfsi.mesh import search
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.kernels.rows import count_marked, list_marked, take_rows
from distfsi.mesh.kernels.search import Bins
from distfsi.mesh.rows import Rows

SMOOTHING_RADIUS = 1.5  # in cells, of the kernel whose sum gives the distance
COARSEST = 3.0  # particle spacings that this radius spans at least
MARGIN = 0.15  # of a cell, on each side: what thin bodies are thicker than must be, as they move in a step
THIN, THICK = 0.1, 0.45  # of a cell, beyond its diagonal: the thickness up to which a body is thin, and from which not
TOUCHING, APART, ASIDE = 0.2, 0.6, 0.9  # half cells or spacings: gaps to the domain's ends, width of a column of a body
PROFILE_POINTS = 1025
NEAR_LANES = 8  # points that are computed side by side: more would lie farther apart
DRIVERS = (
    *search.DRIVERS,
    take_rows,
    inflation.fill_kernel,
    inflation.inflate,
    inflation.mark_inflated,
    nodal_distance.find_near,
    nodal_distance.mark_nodes,
    nodal_distance.find_distances,
    nodal_distance.add_spheres,
    fractions.find_fractions,
    fractions.mark_cut_blocks,
    count_marked,
    list_marked,
)
EXACT = (nodal_distance.node_positions, nodal_distance.put_distances)
STAIRCASE = (fractions.round_fractions, fractions.round_apertures)


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


def neighbour_offsets(dimensions: int) -> np.ndarray:
    """Offsets (m, D) to all neighbours of a cell, those across a face first."""
    around = (o for o in product((-1, 0, 1), repeat=dimensions) if any(o))
    return np.array(sorted(around, key=lambda o: (sum(map(abs, o)), o)))


class Lengths(NamedTuple):
    """How far particles reach among cells [m].

    radius, seen, reach, ranges  as those of WallGeometry
    search       how far particles change the distances of nodes
    search_cell  width of the cells of the search grid
    inflation    of thin bodies
    """

    radius: float
    seen: float
    reach: float
    ranges: ImageRange
    search: float
    search_cell: float
    inflation: Inflation


def lengths_of(cell: Sequence[float], spacing: float, layers: int, staircase: bool) -> Lengths:
    """The lengths of particles of a `spacing` [m] among cells of the sizes `cell` [m] with so many ghost layers."""
    h, D = max(cell), len(cell)
    radius = max(SMOOTHING_RADIUS * h, COARSEST * spacing)
    sphere = sqrt(D * (0.5 * h) ** 2 + (D - 1) * (0.5 * spacing) ** 2) + MARGIN * h
    shares = (plate_share(D, (sqrt(D) + more) * h / radius) for more in (THIN, THICK))
    search = max(radius, sphere + 1.05 * h)
    off = 0.75 * h if staircase else 0.25 * h  # how far particles may be from where cells are closed
    touching, apart, aside = (part * max(0.5 * h, spacing) for part in (TOUCHING, APART, ASIDE))
    return Lengths(
        radius=radius,
        seen=min(1.1 * (0.5 * sqrt(D) * h + max(spacing, sphere) + off), (layers + 0.25) * h),
        reach=(layers + 0.5) * h + search,  # half a cell that the wall may go in a step
        ranges=ImageRange(touching, apart, aside, search + 0.5 * h),
        search=search,
        search_cell=0.5 * min(cell),
        inflation=Inflation(radius, sphere, *shares),
    )


class WallGeometry:
    """Volume fractions and apertures, before and after a step; arrays are the device's.

    fractions  (old, new) fields (local blocks, 1, Z, Y, X): volume fraction of each cell that is open, with ghosts
    apertures  (old, new) fields (local blocks, D, Z, Y, X): the same of each cell's low face along every axis
    near       (local blocks,) which blocks had particles near them or cells that were not whole
    grid       what kernels know of the blocks
    lanes      how many points that lie near each other are computed side by side
    ranges     which images of particles count
    radius     [m] of the kernel; seen [m]: how far from a cell's center particles may be that make its wall
    reach      [m]: how far from this rank's blocks particles change them
    """

    def __init__(
        self, blocks: Blocks, device: Device, spacing: float, real: type, staircase: bool, surface: ExactSurface | None
    ):
        """`spacing` [m] of the coarsest particles; `staircase`: cells are open as a whole or not at all; `surface`: of
        the bodies in the place of what the particles tell."""
        self._surface = surface
        self._nodes, self._distances = np.empty(0, dtype=np.int64), device.empty(0)  # that were found from the surface
        self.blocks, self.device, self.grid, D = blocks, device, blocks.grid_on(device), blocks.grid.dimensions
        self.lanes, self._staircase = min(device.lanes, NEAR_LANES), staircase
        constants = {"DIMENSIONS": D, "LANES": self.lanes, "GHOSTS": blocks.grid.ghost_layers}
        self.kernels: SimpleNamespace = device.build((*DRIVERS, *EXACT, *(STAIRCASE if staircase else ())), constants)
        self._rows = Rows(device, self.kernels)
        self._cells = search.CellSort(self.kernels, device, blocks.grid.lower[:D], blocks.grid.upper[:D])
        self._lengths = lengths = lengths_of(blocks.grid.spacing[:D], spacing, blocks.grid.ghost_layers, staircase)
        self.radius, self.seen, self.reach, self.ranges = lengths.radius, lengths.seen, lengths.reach, lengths.ranges
        self._profile = device.array(plane_profile(D))
        # the fields, of cells that are all open
        count = blocks.local_count
        old, new = (DualArray(device, np.ones((count, 1, *blocks.shape), real)) for _ in ("old", "new"))
        self.fractions = (old, new)
        old, new = (DualArray(device, np.ones((count, D, *blocks.shape), real)) for _ in ("old", "new"))
        self.apertures = (old, new)
        self.near = DualArray(device, np.ones(count, dtype=np.uint8))
        nodes = tuple(n + (1 if axis < D else 0) for n, axis in zip(blocks.shape, (2, 1, 0), strict=True))
        self._distance = DualArray(device, np.full((count, *nodes), self.radius))
        self._node_rows = count * prod(nodes[:2])
        self.rows_per_block = prod(blocks.shape[:2])  # of cells along x

    # ---- particles in order -----------------------------------------------------------------------------------------

    def sort(self, position: Any, key: Any) -> Bins:
        """Particles by the cells of the search grid that they are in."""
        return self._cells.sort(position, key, self._lengths.search_cell)[1]

    def coarse_order(self, position: Any, key: Any) -> Any:
        """Particles so that those near each other, a few in a cell, follow each other."""
        return self._cells.sort(position, key, 2.0 * self._lengths.search_cell)[1].order

    def near_order(self, values: Any, at: Any, shape: tuple[int, ...]) -> Any:
        """`values` (n,) of what lies `at` (n,) in the memory of a field of a `shape` (Z, Y, X) per block, so that those
        near each other follow each other. Where one is computed at a time the order does not matter."""
        if self.lanes == 1:
            return values
        row, x = np.divmod(self.device.download(at), shape[2])
        layer, y = np.divmod(row, shape[1])
        brick = (layer // 2 * shape[1] + y // 2) * shape[2] + x // 2
        return self.device.array(self.device.download(values)[np.argsort(brick, kind="stable")])

    # ---- thin bodies ------------------------------------------------------------------------------------------------

    def fill(self, own: int, chosen: Any, points: Cloud) -> Any:
        """Share of the broad kernel around each of the first `own` points that is filled, and the mean way [m] to what
        fills it, (own, 1 + D). `chosen` (m,): all own points and maybe others, as of coarse_order()."""
        filled, boxes = self.device.empty((own, 1 + self.blocks.grid.dimensions)), -(-chosen.shape[0] // self.lanes)
        self.device.run(self.kernels.fill_kernel, boxes, filled, chosen, self.radius, points)
        return filled

    def inflate(self, own: int, filled: Any, chosen: Any, points: Cloud) -> Any:
        """Spheres (own, 2 + D) as which points of thin bodies count (coupling/cut_cells/kernels/inflation.py); `filled`
        of all, `chosen` as for fill()."""
        sphere, boxes = self.device.empty((own, 2 + self.blocks.grid.dimensions)), -(-chosen.shape[0] // self.lanes)
        given = sphere, filled.reshape(-1), chosen, self._lengths.inflation, points
        self.device.run(self.kernels.inflate, boxes, *given)
        return sphere

    # ---- cutting ----------------------------------------------------------------------------------------------------

    def cut(self, points: Cloud, sphere: Any, key: Any) -> None:
        """The new fractions and apertures become the old ones, and those of the wall that these points make the new
        ones; their spheres (n, 2 + D) and keys (n,)."""
        self.fractions, self.apertures = self.fractions[::-1], self.apertures[::-1]
        run, k, count = self.device.run, self.kernels, points.position.shape[0]
        distance = self._distance.device.reshape(-1)
        mark = self.device.empty(count, np.int8)
        run(k.mark_inflated, count, sphere, points.values, mark)
        inflated, rows = self._rows.marked(mark)
        nodes = self._nodes_near(self._lengths.search if inflated else self.radius, points.bins)
        if self._surface:
            self._take_distances(self._surface, nodes)
        else:
            boxes = -(-nodes.shape[0] // self.lanes)
            run(k.find_distances, boxes, nodes, distance, self.radius, self._profile, points, self.grid)
        if inflated:
            self.add_spheres(nodes, *(self._rows.taken(array, rows) for array in (points.position, sphere, key)))
        self._open()

    def _take_distances(self, surface: ExactSurface, nodes: Any) -> None:
        """Distances at the `nodes` become those of the `surface`, which are found once."""
        run, k, number, known = self.device.run, self.kernels, nodes.shape[0], self.device.download(nodes)
        if not np.array_equal(known, self._nodes):
            position = self.device.empty((number, self.blocks.grid.dimensions))
            run(k.node_positions, number, nodes, position, self.grid)
            self._nodes, found = known, surface.distance(self.device.download(position))
            self._distances = self.device.array(found)
        run(k.put_distances, number, nodes, self._distances, self._distance.device.reshape(-1), self.radius, self.grid)

    def spare_thick(self, position: Any, sphere: Any) -> Any:
        """The spheres (own, 2 + D) of the first points at a `position` (n, D), less those in bodies of a known surface
        that are not thin."""
        if self._surface is None:
            return sphere
        own = self.device.download(position)[: sphere.shape[0]]
        thick = self._surface.is_thick(own, 2.0 * self._lengths.inflation.largest)
        return self.device.array(np.where(thick[:, None], 0.0, self.device.download(sphere)))

    def _nodes_near(self, reach: float, bins: Bins) -> Any:
        """The nodes (n,) that may have particles within `reach` [m]; the others are open."""
        near, distance = self.near.device, self._distance.device.reshape(-1)
        self.device.run(self.kernels.find_near, self.blocks.local_count, near, reach, bins, self.grid)
        mark, rows = self.device.zeros(distance.shape[0], np.int8), self._node_rows
        self.device.run(self.kernels.mark_nodes, rows, near, distance, mark, self.radius, reach, bins, self.grid)
        nodes = self._rows.marked(mark)[1]
        return self.near_order(nodes, nodes, self._distance.device.shape[1:])

    def add_spheres(self, nodes: Any, position: Any, sphere: Any, key: Any) -> None:
        """Distances at the `nodes` become those to these particles' spheres where they are nearer."""
        lengths, boxes = self._lengths, -(-nodes.shape[0] // self.lanes)
        bins = self._cells.sort(position, key, 2.0 * lengths.search_cell)[1]
        distance, largest = self._distance.device.reshape(-1), lengths.inflation.largest
        given = nodes, distance, largest, lengths.search, Cloud(position, sphere, bins), self.grid
        self.device.run(self.kernels.add_spheres, boxes, *given)

    def _open(self) -> None:
        """Find the new fractions and apertures from the distances."""
        run, k, near, blocks = self.device.run, self.kernels, self.near.device, self.blocks.local_count
        (before, after), (_, aperture) = self.flat_fractions, self.flat_apertures
        rows = blocks * self.rows_per_block
        is_cut = self.device.empty(rows, np.int8)
        distance = self._distance.device.reshape(-1)
        run(k.find_fractions, rows, near, distance, before, after, aperture, is_cut, self.grid)
        if self._staircase:
            run(k.round_fractions, rows, near, after, self.grid)
            run(k.round_apertures, rows, near, after, aperture, self.grid)
        run(k.mark_cut_blocks, blocks, near, is_cut, self.rows_per_block)

    # ---- looking at it ----------------------------------------------------------------------------------------------

    @property
    def flat_fractions(self) -> tuple[Any, ...]:
        """Old and new."""
        return tuple(field.device.reshape(-1) for field in self.fractions)

    @property
    def flat_apertures(self) -> tuple[Any, ...]:
        """Old and new."""
        return tuple(field.device.reshape(-1) for field in self.apertures)

    def cut_cells(self, block: int) -> tuple[np.ndarray, np.ndarray]:
        """Indices (n, D) [x first] in memory of a block's cells that are cut, and the middles (n, D) [m] of their open
        nodes, each by its distance from the wall."""
        D, blocks, grid = self.blocks.grid.dimensions, self.blocks, self.blocks.grid
        part, extent = self.fractions[1].host()[block, 0], blocks.extent[block]
        inner = tuple(slice(g, g + n) for g, n in zip(grid.ghosts[::-1], extent[::-1], strict=True))
        index = np.argwhere((part[inner] > 0.0) & (part[inner] < 1.0))[:, ::-1] + grid.ghosts
        weight, middle = np.zeros(len(index)), np.zeros((len(index), D))
        for node in product((0, 1), repeat=D):
            at = index + np.pad(node, (0, 3 - D))
            free = np.maximum(self._distance.host()[block][tuple(at.T[::-1])], 0.0)
            x = np.array(grid.lower[:D]) + (blocks.origin[block] - grid.ghosts + at)[:, :D] * grid.spacing[:D]
            weight, middle = weight + free, middle + free[:, None] * x
        return index, middle / weight[:, None]
