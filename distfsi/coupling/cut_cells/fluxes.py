"""The band's part in a stage: fluxes through open faces and the wall's, in the place of the fluid's stage."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.kernels import fluxes as kernels
from distfsi.coupling.cut_cells.kernels.fluxes import StageTimes
from distfsi.coupling.cut_cells.kernels.records import Band, Walls
from distfsi.coupling.cut_cells.values import CutGeometry, OpenFaces, StageCells
from distfsi.device.interface import Device
from distfsi.mesh.kernels.grid import BlockGrid
from distfsi.mesh.rows import Rows

DRIVERS = (kernels.find_walls, kernels.find_faces, kernels.find_fluxes, kernels.advance_band)


class BandFluxes:
    """Finds the faces of the band, what passes them, and what that leaves in its cells."""

    def __init__(self, model: Any, grid: BlockGrid, device: Device, rows: Rows, kernels: SimpleNamespace):
        """`kernels` holds DRIVERS."""
        self._grid, self._device, self._rows, self._kernels = grid, device, rows, kernels
        self._D, self._fluxes = model.dimensions, model.constants["FLUXES"]

    def find_faces(self, cells: Any, above: Any, walls: Walls) -> tuple[Band, OpenFaces]:
        """What walls and faces the `cells` (n,) of the band have; `above` (n, D): which of them are next to each
        other."""
        device, n, D = self._device, cells.shape[0], self._D
        band = Band(cells, above, device.empty((n, 2 * D)), device.empty((n, D)))
        device.run(self._kernels.find_walls, n, cells, band.aperture, band.area, walls, self._grid)
        seen = device.empty(2 * D * n, np.int8)
        device.run(self._kernels.find_faces, n, band, seen, walls, self._grid)
        return band, OpenFaces(self._rows.marked(seen)[1], seen, device.empty((n, 2 * D * self._fluxes)))

    def advance(self, geometry: CutGeometry, cells: StageCells, times: StageTimes) -> None:
        """One stage of the band's cells: from states to contents."""
        device, k, lanes, band, faces = self._device, self._kernels, self._device.lanes, geometry.band, geometry.faces
        boxes = -(-faces.index.shape[0] // lanes)
        known = (faces.index, faces.seen, faces.flux, cells.input.U, times.dt, self._grid)
        device.run(k.find_fluxes, boxes, band.cells, *known)
        boxes = -(-band.cells.shape[0] // lanes)
        states = (cells.before, geometry.start_volume, cells.input, cells.output)
        device.run(k.advance_band, boxes, band, faces.flux, *states, geometry.loads, times, self._grid)
