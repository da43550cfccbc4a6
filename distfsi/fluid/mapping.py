"""A run that goes on from the end of another in radial coordinates: `[fluid.map]`.

The other run's cells are shells, rings or layers of rings. Of each the part that lies in a cell of this run is known
exactly (scene/overlaps.py), so masses, volumes of phases and energy are conserved. A cell gets the momentum away from
the centre, or the axis, of all that it holds, in the direction of its own centroid: that conserves radial momentum, and
what motion a cell loses where it mixes what has different velocities becomes heat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from distfsi.coordinates import Coordinates
from distfsi.coordinates.axisymmetric import Axisymmetric
from distfsi.coordinates.cylindrical import Cylindrical
from distfsi.coordinates.planar import Planar
from distfsi.coordinates.spherical import Spherical
from distfsi.errors import InputError
from distfsi.fluid.finished import FinishedRun
from distfsi.mesh.blocks import Blocks
from distfsi.scene import overlaps
from distfsi.scene.description import Map, Scene

WHOLE = 1e-9  # part of a cell that counts as nothing: rounding leaves as much of a small one far from the centre


@dataclass(frozen=True)
class Shells:
    """How the shells or rings of one coordinate system lie in the cells of another.

    volume  of a ball or disc from its centre to a corner of a cell (scene/overlaps.py)
    across  axes of the cells in which its radius lies
    along   axis of the cells along which nothing varies, or layers lie; None: there is none
    """

    volume: overlaps.CornerVolume
    across: tuple[int, ...]
    along: int | None = None


def shells_of(source: Coordinates, target: Coordinates, dimensions: int, axis: int) -> Shells | None:
    """How one system lies in another of so many dimensions, its axis along the other's `axis`; None: it does not."""
    around_point = isinstance(source, Spherical)
    match target, dimensions:
        case Planar(), 3 if around_point:
            return Shells(overlaps.ball_to_corner, (0, 1, 2))
        case Planar(), 3:
            return Shells(overlaps.disc_to_corner, tuple(d for d in range(3) if d != axis), axis)
        case Planar(), 2 if not around_point and not isinstance(source, Axisymmetric):
            return Shells(overlaps.disc_to_corner, (0, 1))
        case Axisymmetric(), _ if around_point:
            return Shells(overlaps.ball_to_ring, (0, 1))
        case Axisymmetric(), _:
            return Shells(overlaps.disc_to_circle, (0,), 1)
        case Spherical(), _ if around_point:
            return Shells(overlaps.ball_to_shell, (0,))
        case Cylindrical(), _ if type(source) is Cylindrical:
            return Shells(overlaps.disc_to_circle, (0,))
    return None


class Mapping:
    """What the cells of this rank get from a finished run.

    time    when that run has ended [s]
    before  masses, momentum away from the centre (and along the axis), energy of what of it lies in the domain
    after   the same of what the cells of all ranks have got, once `sum_up` was called
    """

    def __init__(self, given: Map, scene: Scene, blocks: Blocks):
        """Collective. Raises InputError when the run is not there or does not fit."""
        self._blocks, self._given = blocks, given
        self._run = run = FinishedRun(given.run, scene)
        self.time = run.time
        coordinates, D = blocks.grid.coordinates, blocks.grid.dimensions
        shells = shells_of(run.coordinates, coordinates, D, given.axis)
        if shells is None:
            kinds = type(run.coordinates).__name__.lower(), type(coordinates).__name__.lower()
            raise InputError([f"fluid.map.run: {kinds[0]} in {given.run}; that does not fit into {D}D, {kinds[1]}"])
        self._shells = shells
        self._sums = np.zeros((blocks.local_count, run.rows - run.extra))
        low, high = np.array([blocks.grid.lower[:D]]), np.array([blocks.grid.upper[:D]])
        contents = self._contents(*(corner - np.array(given.center) for corner in (low, high)))
        self.before = contents[: run.rows - run.extra, 0]
        self.after = np.zeros_like(self.before)

    def apply(self, block: int, cells: np.ndarray) -> None:
        """Write into the `cells` (variables, z, y, x) of a local block what lies in them; the rest stays as it is."""
        run, D = self._run, self._blocks.grid.dimensions
        low, high, center, volume = self._geometry(block)
        contents = self._contents(low, high)
        share = contents[-1] / volume
        share[np.abs(1.0 - share) < WHOLE] = 1.0
        touched = share > WHOLE
        given = contents[:-1, touched] / volume[touched]
        shape = cells.shape[1:]
        old = cells.reshape(len(cells), -1)[:, touched]
        rest = (1.0 - share[touched]) * old.astype(np.float64)
        new = rest.copy()
        P = run.phases
        distance = np.sqrt((center[touched][:, self._shells.across] ** 2).sum(axis=1))
        directions = center[touched] / np.where(distance > 0.0, distance, 1.0)[:, None]
        new[:P] += given[:P]
        for axis in self._shells.across:
            new[P + axis] += given[P] * directions[:, axis]
        if run.layers is not None:
            new[P + self._along] += given[P + 1]
        new[P + D] += given[run.rows - run.extra - 1]
        new[P + D + 1 :] += given[run.rows - run.extra :]
        flat = cells.reshape(len(cells), -1)
        flat[:, touched] = new
        cells[:] = flat.reshape(len(cells), *shape)
        # what has arrived, from the new states as they are kept
        got = (flat[:, touched].astype(np.float64) - rest) * volume[touched]
        across = list(self._shells.across)
        radial = (got[[P + axis for axis in across]] * directions[:, across].T).sum(axis=0)
        axial = [got[P + self._along].sum()] if run.layers is not None else []
        self._sums[block] = [*got[:P].sum(axis=1), radial.sum(), *axial, got[P + D].sum()]

    def sum_up(self) -> None:
        """Collective, after all blocks."""
        self.after = self._blocks.sum(self._sums)

    def lines(self) -> list[str]:
        """What was mapped, in words: totals before and after."""
        names = [*(f"mass of {name} [kg]" for name in self._run.names), "radial momentum [N s]"]
        names += ["axial momentum [N s]"] if self._run.layers is not None else []
        lines = [f"mapped from {self._run.path} at t = {self.time:.6g} s: before, after, relative difference"]
        for name, before, after in zip([*names, "energy [J]"], self.before, self.after, strict=True):
            lines.append(f"  {name:<24}{before:>22.15g}{after:>22.15g}{self.difference(before, after):>10.1e}")
        return lines

    @staticmethod
    def difference(before: float, after: float) -> float:
        """Of two totals, relative to the first."""
        return (after - before) / abs(before) if before else after

    @property
    def _along(self) -> int:
        """The axis of the cells along which layers lie."""
        assert self._shells.along is not None
        return self._shells.along

    def _geometry(self, block: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Corners and centroids (cells, D) of a block's cells, from the centre of the map, and volumes (cells,)."""
        grid, blocks, D = self._blocks.grid, self._blocks, self._blocks.grid.dimensions
        edges = [
            grid.lower[d] + grid.spacing[d] * (blocks.origin[block, d] + np.arange(blocks.extent[block, d] + 1))
            for d in range(D)
        ]
        lows, highs = [edge[:-1] for edge in edges], [edge[1:] for edge in edges]
        centers = [0.5 * (a + b) for a, b in zip(lows, highs, strict=True)]
        sizes = [b - a for a, b in zip(lows, highs, strict=True)]
        if grid.coordinates.radial:
            centers[0] = grid.coordinates.centroid(lows[0], highs[0])
            sizes[0] = grid.coordinates.volume(lows[0], highs[0])
        volume = np.prod(_points(sizes), axis=1)
        center = np.array(self._given.center)
        return _points(lows) - center, _points(highs) - center, _points(centers) - center, volume

    def _contents(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """What of the run lies in cells between corners (cells, D): its rows, and its volume (rows + 1, cells)."""
        run, shells = self._run, self._shells
        across = list(shells.across)
        parts = shell_parts(shells.volume, low[:, across], high[:, across], run.edges)
        if shells.along is None:
            return (parts @ run.contents[:, 0].T).T
        along = shells.along
        if run.layers is None:
            return (parts @ run.contents[:, 0].T).T * (high - low)[:, along]
        found = np.zeros((len(run.contents), len(low)))
        for layer, (bottom, top) in enumerate(zip(run.layers[:-1], run.layers[1:], strict=True)):
            height = np.minimum(high[:, along], top) - np.maximum(low[:, along], bottom)
            inside = np.flatnonzero(height > 0.0)
            found[:, inside] += (parts[inside] @ run.contents[:, layer].T).T * height[inside]
        return found


def shell_parts(volume: overlaps.CornerVolume, low: np.ndarray, high: np.ndarray, edges: np.ndarray) -> Any:
    """The part of each shell between `edges` (shells + 1,) in cells between corners (cells, axes): a sparse
    array (cells, shells)."""
    from scipy.sparse import csr_array

    nearest = np.sqrt((np.maximum(np.maximum(low, -high), 0.0) ** 2).sum(axis=1))
    farthest = np.sqrt((np.maximum(np.abs(low), np.abs(high)) ** 2).sum(axis=1))
    full = overlaps.in_cells(volume, low.T, high.T, 4.0 * (farthest.max() + edges[-1]))
    inside = np.zeros(len(low))
    cells, shells, parts = [], [], []
    for shell, radius in enumerate(edges):
        before, inside = inside, np.where(farthest <= radius, full, 0.0)
        cut = np.flatnonzero((nearest < radius) & (farthest > radius))
        inside[cut] = overlaps.in_cells(volume, low[cut].T, high[cut].T, radius)
        if shell == 0:
            continue
        part = inside - before
        found = np.flatnonzero(part)
        cells.append(found)
        shells.append(np.full(len(found), shell - 1))
        parts.append(part[found])
    where = np.concatenate(cells), np.concatenate(shells)
    return csr_array((np.concatenate(parts), where), shape=(len(low), len(edges) - 1))


def _points(along: list[np.ndarray]) -> np.ndarray:
    """Values along each axis -> (cells, D) of all cells, x fastest."""
    grids = np.meshgrid(*along[::-1], indexing="ij")
    return np.stack([grid.ravel() for grid in grids[::-1]], axis=1)
