"""Particles from a file, CSV or VTK, as a shape: the cubes around them."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from distfsi.scene.description import Composed
from distfsi.scene.surface import in_metres
from distfsi.scene.units import length_factor

VTK_SUFFIXES = (".vtk", ".vtu", ".vtp", ".vtkhdf")
AXES = ("x", "y", "z")
VOLUME = "volume"  # name of a column or array: of each particle, in the file's unit to the power of the dimensions


@dataclass(frozen=True)
class Cloud(Composed):
    """Particles in `file`, whose lengths are in `unit`, with so many `coordinates` each. As a shape they are cubes
    `spacing` [m] wide; its distance is a bound.

    spacing  None: the middle one of the particles' distances to their nearest neighbours
    """

    file: str
    unit: str
    spacing: float | None
    coordinates: int

    @property
    def dimensions(self) -> int:
        return self.coordinates

    @property
    def exact(self) -> bool:
        return False

    @property
    def positions(self) -> np.ndarray:
        """(n, D) [m]"""
        return self._read[0]

    @property
    def volumes(self) -> np.ndarray:
        """(n,) [m^D]: what the file says, or cubes."""
        return self._read[1]

    @property
    def _read(self) -> tuple[np.ndarray, np.ndarray, float]:
        return read_particles(self.file, self.unit, self.spacing, self.coordinates)

    def distance(self, points: np.ndarray) -> np.ndarray:
        from scipy.spatial import cKDTree

        positions, _, spacing = self._read
        gap, _ = cKDTree(positions).query(points, p=np.inf)
        return gap - 0.5 * spacing

    def support(self, normal: np.ndarray) -> float:
        positions, _, spacing = self._read
        return float((positions @ normal).max() + 0.5 * spacing * np.abs(normal).sum())

    def volume(self) -> float:
        return math.fsum(self.volumes)


@lru_cache(maxsize=16)
def read_particles(
    file: str, unit: str, spacing: float | None, dimensions: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Positions (n, D) [m], volumes (n,) [m^D] and spacing [m]. Raises ValueError where a file does not hold them."""
    from scipy.spatial import cKDTree

    path, factor = Path(file), length_factor(unit)
    if not path.is_file():
        raise ValueError(f"does not exist ({path})")
    suffix = path.suffix.lower()
    if suffix not in (".csv", *VTK_SUFFIXES):
        raise ValueError(f"is none of {', '.join(('.csv', *VTK_SUFFIXES))}")
    lengths, sizes = (_from_csv if suffix == ".csv" else _from_vtk)(path, dimensions)
    if len(lengths) == 0 or not np.isfinite(lengths).all():
        raise ValueError("holds no particles" if len(lengths) == 0 else "holds coordinates that are not finite")
    positions = in_metres(lengths, factor)
    if len(positions) > 1:
        gaps, _ = cKDTree(positions).query(positions, k=2)
        if gaps[:, 1].min() == 0.0:
            raise ValueError("holds two particles at one place")
        spacing = spacing or float(np.median(gaps[:, 1]))
    if spacing is None:
        raise ValueError("holds one particle; give its spacing")
    volumes = np.full(len(positions), spacing**dimensions) if sizes is None else sizes * float(factor) ** dimensions
    if not np.all(volumes > 0.0):
        raise ValueError("holds volumes that are not positive")
    return positions, volumes, spacing


def _from_csv(path: Path, dimensions: int) -> tuple[np.ndarray, np.ndarray | None]:
    """Columns x, y, z and, if it is there, volume, by the names in the first line, or in this order without names."""
    with path.open(newline="") as lines:
        rows = [row for row in csv.reader(lines) if row]
    if not rows:
        raise ValueError("is empty")
    names = [entry.strip().lower() for entry in rows[0]]
    wanted = list(AXES[:dimensions])
    if any(_is_number(name) for name in names):
        names = (wanted if len(names) == dimensions else [*wanted, VOLUME])[: len(names)]
    else:
        rows = rows[1:]
    if missing := [name for name in wanted if name not in names]:
        raise ValueError(f"has no column {', '.join(missing)}")
    try:
        table = np.array([[float(entry) for entry in row] for row in rows]).reshape(len(rows), -1)
    except ValueError as error:
        raise ValueError(f"holds rows that are no numbers, or of different length: {error}") from error
    columns = dict(zip(names, table.T, strict=False))
    if len(columns) < len(wanted):
        raise ValueError("has rows that are too short")
    return np.stack([columns[name] for name in wanted], axis=1), columns.get(VOLUME)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _from_vtk(path: Path, dimensions: int) -> tuple[np.ndarray, np.ndarray | None]:
    """Points of a legacy or XML file, and their array "volume" if there is one."""
    try:
        import vtk
        from vtk.util.numpy_support import vtk_to_numpy
    except ImportError as error:
        raise ValueError("needs the package vtk, which is not installed") from error
    kinds = (vtk.vtkDataSetReader, vtk.vtkXMLUnstructuredGridReader, vtk.vtkXMLPolyDataReader, vtk.vtkHDFReader)
    reader = kinds[VTK_SUFFIXES.index(path.suffix.lower())]()
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    if data is None or data.GetNumberOfPoints() == 0:
        raise ValueError("holds no points")
    sizes = data.GetPointData().GetArray(VOLUME)
    points = vtk_to_numpy(data.GetPoints().GetData())[:, :dimensions]
    return points, None if sizes is None else vtk_to_numpy(sizes).astype(float)
