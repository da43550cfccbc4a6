"""Values of the fluid at points, with the same bits on any number of ranks."""

from __future__ import annotations

from itertools import product

import numpy as np

from distfsi.coupling.kernels.cells import COVERED
from distfsi.coupling.protocol import Coupling
from distfsi.fluid import fields
from distfsi.fluid.fluid import Fluid
from distfsi.mesh.blocks import Grid
from distfsi.mesh.regions import source_cell


class FluidSampler:
    """The fluid at fixed points, linear between the centers of cells (along r: their centroids) in each coordinate.

    Covered cells do not count; a point in a covered cell has no value (NaN). Beyond the outermost centers the values
    are those that the boundary implies: at a wall the normal velocity goes to zero.

    columns: names and units of the values
    """

    def __init__(self, fluid: Fluid, coupling: Coupling | None, positions: np.ndarray):
        """`positions` (n, D) [m] inside the domain."""
        self.fluid, self.coupling = fluid, coupling
        self._primitives = fluid.model.formula("primitives")
        D, grid = fluid.model.dimensions, fluid.blocks.grid
        self.columns = ["pressure [Pa]", "density [kg/m3]", *(f"velocity_{a} [m/s]" for a in grid.coordinates.axes[:D])]
        self.columns += fields.fraction_names(fluid.model)
        scaled = (positions - np.array(grid.lower[:D])) / np.array(grid.spacing[:D]) - 0.5
        if grid.coordinates.radial:
            scaled[:, 0] = _along_r(grid, positions[:, 0])
        low = np.floor(scaled)
        corners = np.array(list(product((0, 1), repeat=D)))
        share = (scaled - low)[:, None]
        self._weight = np.where(corners == 1, share, 1.0 - share).prod(axis=2)
        self._home = self._weight.argmax(axis=1)  # the corner in whose cell the point is
        # the distinct cells at the corners (n, 2^D, D), numbered, and those on this rank
        corner, blocks = low.astype(np.int64)[:, None] + corners, fluid.blocks
        cell, self._sign = np.zeros((*corner.shape[:2], 3), dtype=np.int64), np.ones(corner.shape)
        for axis in range(corner.shape[2]):
            n = grid.cells[axis]
            sources = np.array([source_cell(i, n, grid.boundaries[axis]) for i in range(-1, n + 1)])
            cell[..., axis] = sources[corner[..., axis] + 1, 0]
            self._sign[..., axis] = 1 - 2 * sources[corner[..., axis] + 1, 1]
        cells, number = np.unique(cell.reshape(-1, 3), axis=0, return_inverse=True)
        self._number = number.reshape(corner.shape[:2])
        block = blocks.index_at(cells // blocks.block_cells) - blocks.first
        self._own = np.flatnonzero((block >= 0) & (block < blocks.local_count))
        block = block[self._own]
        x, y, z = (cells[self._own] - blocks.origin[block] + grid.ghosts).T
        self._index = (block, slice(None), z, y, x)

    def values(self) -> np.ndarray:
        """Collective. The values (n, columns) at the points, on every rank."""
        D, P, fluid = self.fluid.model.dimensions, self.fluid.model.phases, self.fluid
        covered = self.coupling.kind.host()[self._index] >= COVERED if self.coupling else np.zeros((len(self._own), 1))
        rows = np.hstack([self._own[:, None], fluid.state[self._index], covered], dtype=np.float64)
        rows = fluid.blocks.communicator.concatenate(rows)
        rows = rows[np.argsort(rows[:, 0])]
        U, covered = np.ascontiguousarray(rows[:, 1:-1].T), rows[:, -1] == 1.0
        W = self._primitives(U)
        fractions = fields.written_fractions(self.fluid.model, U)
        cells = np.stack([W[P + D], U[:P].sum(axis=0), *W[P : P + D], *fractions], axis=1)
        return self._interpolated(cells, covered)

    def _interpolated(self, cells: np.ndarray, covered: np.ndarray) -> np.ndarray:
        """Values (n, columns) at the points from those in the cells; a uniform state keeps its bits."""
        D, points = self._sign.shape[2], np.arange(len(self._number))
        around = cells[self._number]
        around[..., 2 : 2 + D] *= self._sign
        covered = covered[self._number]
        weight = np.where(covered, 0.0, self._weight)[..., None]
        home = around[points, self._home]
        with np.errstate(invalid="ignore"):
            values = home + (weight * (around - home[:, None])).sum(axis=1) / weight.sum(axis=1)
        values[covered[points, self._home]] = np.nan
        return values


def _along_r(grid: Grid, r: np.ndarray) -> np.ndarray:
    """Where points at r [m] lie between the centroids of cells, counted in cells."""
    faces = grid.lower[0] + grid.spacing[0] * np.arange(grid.cells[0] + 1)
    center = grid.coordinates.centroid(faces[:-1], faces[1:])
    center = np.concatenate([[2.0 * faces[0] - center[0]], center, [2.0 * faces[-1] - center[-1]]])
    return np.interp(r, center, np.arange(-1.0, grid.cells[0] + 1.0))
