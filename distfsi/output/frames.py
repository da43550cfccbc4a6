"""What a picture shows of a run at one time: the plane through the middle of the domain, seen along z."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from distfsi.output.fields import read_cells, read_particles, series

Extent = tuple[float, float, float, float]  # left, right, bottom, top [m]; bottom = top in one dimension


@dataclass(frozen=True)
class Frame:
    """A run at one `time` [s]; `cells` or `particles` are empty where it has none.

    cells: fields (ny, nx) or (ny, nx, 3) over `extent`; particles: columns of those in the plane, typically `spacing`
    [m] apart.
    """

    time: float
    extent: Extent
    cells: Mapping[str, np.ndarray]
    particles: Mapping[str, np.ndarray]
    spacing: float

    @property
    def dimensions(self) -> int:
        """1 for a run along x only, else 2."""
        _, _, bottom, top = self.extent
        return 1 + (top > bottom)

    @property
    def aspect(self) -> float:
        """Height over width."""
        left, right, bottom, top = self.extent
        return (top - bottom) / (right - left)

    @property
    def cell_centers(self) -> np.ndarray:
        """Positions x (nx,) [m] of a row of cells."""
        left, right, _, _ = self.extent
        count = next(iter(self.cells.values())).shape[1]
        return left + (np.arange(count) + 0.5) * (right - left) / count


def load_frames(directory: Path, count: int) -> list[Frame]:
    """Up to `count` frames, evenly chosen from the field files in `directory`, the first and the last among them.

    Raises FileNotFoundError when there are no field files.
    """
    cells, particles = series(directory, "cells"), series(directory, "particles")
    # A run that died between the two kinds of a time has one file less of the second.
    available = min(len(files) for files in (cells, particles) if files) if cells or particles else 0
    if available == 0:
        raise FileNotFoundError(f"no field files in {directory}")
    chosen = sorted(set(np.linspace(0, available - 1, count).round().astype(int).tolist()))
    if cells:
        return [_load_both(cells[i][1], particles[i][1] if particles else None) for i in chosen]
    return _load_particles([particles[i][1] for i in chosen])


def _load_both(cells: Path, particles: Path | None) -> Frame:
    time, fields, origin, spacing = read_cells(cells)
    nz, ny, nx = next(iter(fields.values())).shape[:3]
    middle = origin[2] + spacing[2] * (nz // 2 + 0.5) * (nz > 1)
    extent = (origin[0], origin[0] + nx * spacing[0], origin[1], origin[1] + ny * spacing[1] * (ny > 1))
    near, distance = _near_plane(read_particles(particles)[1], middle) if particles else ({}, 0.0)
    return Frame(time, extent, {name: field[nz // 2] for name, field in fields.items()}, near, distance)


def _load_particles(paths: Sequence[Path]) -> list[Frame]:
    loaded = [read_particles(path) for path in paths]
    positions = np.concatenate([columns["position"] for _, columns in loaded])
    low, high = positions.min(axis=0), positions.max(axis=0)
    margin = 0.05 * (high - low).max() * (high > low)
    extent = tuple(np.stack([low - margin, high + margin])[:, :2].T.ravel().tolist())
    middle = 0.5 * (low[2] + high[2])
    return [Frame(time, extent, {}, *_near_plane(columns, middle)) for time, columns in loaded]


def _near_plane(columns: Mapping[str, np.ndarray], middle: float) -> tuple[dict[str, np.ndarray], float]:
    """The particles within half their spacing of the plane z = `middle`, and their spacing (median to the nearest)."""
    position = columns["position"]
    if len(position) < 2:
        return dict(columns), 0.0
    some = position[:: max(1, len(position) // 1000)]
    spacing = float(np.median(cKDTree(position).query(some, k=2)[0][:, 1]))
    near = np.abs(position[:, 2] - middle) <= 0.5 * spacing
    return {name: column[near] for name, column in columns.items()}, spacing
