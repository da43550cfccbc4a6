"""The metrics of a rank's blocks: areas, volumes and centroids of a coordinate system along its first axis."""

from __future__ import annotations

import numpy as np

from distfsi.fluid.kernels import records
from distfsi.mesh.blocks import Blocks


class Metrics:
    """Of the columns of cells of each block, one number for all cells of a column.

    table    (local blocks, METRICS, X) as fluid/kernels/records.py names the rows; (1, 1, 1) in planar coordinates,
             where no kernel looks at it
    """

    def __init__(self, blocks: Blocks, real: str):
        self._blocks, self._coordinates = blocks, blocks.grid.coordinates
        self._volume = np.ones(0)
        if not self._coordinates.radial:
            self.table = np.ones((1, 1, 1), real)
            return
        columns = _columns(blocks)
        self._volume = columns[records.VOLUME]
        ghosts, size = blocks.grid.ghosts[0], blocks.shape[2]
        padded = np.pad(columns, ((0, 0), (0, size)), mode="edge")  # a block that is partly filled has unused columns
        self.table = np.array([padded[:, x : x + size] for x in blocks.origin[:, 0]], real)
        self.table = self.table.reshape(blocks.local_count, len(columns), size)
        self._volume = self._volume[ghosts:]

    def weighted(self, cells: np.ndarray, block: int) -> np.ndarray:
        """Contents (…, x) of the active cells of a local block, per volume of a planar cell."""
        if not self._coordinates.radial:
            return cells
        first, n = self._blocks.origin[block, 0], self._blocks.extent[block, 0]
        return cells * self._volume[first : first + n]


def _columns(blocks: Blocks) -> np.ndarray:
    """The metrics (METRICS, cells and ghosts along x) of the whole grid. Ghosts are mirrored: their values come from
    there, or are the same all along."""
    grid = blocks.grid
    n, h, g, coordinates = grid.cells[0], grid.spacing[0], grid.ghosts[0], grid.coordinates
    faces = grid.lower[0] + h * np.arange(n + 1)
    low, high = faces[:-1], faces[1:]
    volume, center = coordinates.volume(low, high), coordinates.centroid(low, high)
    center = np.concatenate([2.0 * faces[0] - center[g - 1 :: -1], center, 2.0 * faces[-1] - center[: -g - 1 : -1]])
    columns = np.ones((records.METRICS, n + 2 * g))
    inner = slice(g, g + n)
    columns[records.LOW, inner] = coordinates.area(low) * h / volume
    columns[records.HIGH, inner] = coordinates.area(high) * h / volume
    columns[records.VOLUME, inner] = volume / h
    columns[records.NEARNESS, 1:] = h / np.diff(center)
    columns[records.TO_LOW, inner] = (center[inner] - low) / h
    columns[records.TO_LOW, :g] = 1.0 - columns[records.TO_LOW, 2 * g - 1 : g - 1 : -1]
    columns[records.TO_LOW, g + n :] = 1.0 - columns[records.TO_LOW, g + n - 1 : n - 1 : -1]
    above, below = np.append(columns[records.LOW, inner], 0.0), np.append(0.0, columns[records.HIGH, inner])
    columns[records.STRETCH, g : g + n + 1] = np.maximum(below, above)
    return columns
