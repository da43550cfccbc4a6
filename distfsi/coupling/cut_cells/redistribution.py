"""The fluid of cells that the wall cuts: states, conserved contents, and how contents become states again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels import redistribution as kernels
from distfsi.coupling.cut_cells.kernels import volumes
from distfsi.coupling.cut_cells.kernels.records import VOLUME_FIELDS, Contents, Merging, States, Walls
from distfsi.coupling.cut_cells.merging import CellMerging
from distfsi.coupling.cut_cells.values import CellLists
from distfsi.device.interface import DualArray
from distfsi.mesh.rows import Rows

DRIVERS = (
    kernels.take_contents,
    kernels.keep_volumes,
    kernels.mark_absorbed,
    kernels.absorb,
    kernels.put_moved,
    kernels.find_trapped,
    kernels.redistribute,
    kernels.put_states,
    kernels.put_rest,
    volumes.exchange_volumes,
)
ROUNDS = 2  # of the exchange of volumes in a step: so far may what a cell has too much go


class Redistribution:
    """Contents of the band become states, and states contents; both in place.

    volume  field (local blocks, 1 or VOLUME_FIELDS, Z, Y, X) on host and device: fluid volume fraction of each cell;
            for two phases room for the contents of both phase energies behind it
    fields  that this makes
    """

    def __init__(
        self,
        model: Any,
        wall: WallGeometry,
        merging: CellMerging,
        rows: Rows,
        kernels: SimpleNamespace,
        rest: np.ndarray,
    ):
        """`kernels` holds DRIVERS; rest (variables,): conserved state of covered cells."""
        device, blocks = wall.device, wall.blocks
        self._model, self._device, self._grid, self._merging = model, device, wall.grid, merging
        self._rows, self._kernels, self._rest = rows, kernels, device.array(rest)
        self._communicator = blocks.communicator
        self.fields = VOLUME_FIELDS if model.phases == 2 else 1
        self.volume = DualArray(device, np.ones((blocks.local_count, self.fields, *blocks.shape), rest.dtype))
        mirrors = (model.mirror, np.full(self.fields, -1))
        self._parities = [device.array(np.where(axes < 0, 0, 1 << np.maximum(axes, 0))) for axes in mirrors]

    def states(self, U: Any) -> States:
        """The fluid of all cells, in a field U of states."""
        return States(U, self.volume.device.reshape(-1))

    def contents(self, Q: Any) -> Contents:
        """The fluid of all cells, in a field Q of which the band's cells hold contents, all others states."""
        return Contents(Q, self.volume.device.reshape(-1))

    def take_contents(self, band: Any, states: States) -> Contents:
        """States of the `band` (n,) become contents."""
        self._device.run(self._kernels.take_contents, band.shape[0], band, states, self._grid)
        return Contents(*states)

    def keep_volumes(self, band: Any, states: States, volume: Any) -> None:
        """volume (n,) = fluid volume fractions of the band's cells."""
        self._device.run(self._kernels.keep_volumes, band.shape[0], band, states, volume, self._grid)

    # ---- absorption of isolated cells -------------------------------------------------------------------------------

    def any_absorbed(self, band: Any, kind: Any) -> bool:
        """Whether isolated cells of this rank have receivers."""
        mark = self._device.empty(band.shape[0], np.int8)
        self._device.run(self._kernels.mark_absorbed, band.shape[0], band, mark, kind, self._merging.target, self._grid)
        return self._rows.any(mark)

    def is_settled(self, lists: CellLists, lone: Any, walls: Walls) -> bool:
        """Collective. Whether a wall that stands leaves nothing to find again: no cells without all their fluid, no
        isolated ones with receivers, no `lone` particles."""
        absorbed = self.any_absorbed(lists.band, walls.kind)
        left = np.array([float(lists.uneven.shape[0]), float(lone.shape[0]), float(absorbed)])
        return not self._communicator.maximum(left).any()

    def absorb(self, band: Any, contents: Contents, walls: Walls) -> None:
        """Collective. Contents of isolated cells move to their receivers."""
        self.exchange_ghosts(contents)
        moved = self._device.empty((band.shape[0], self._model.variables + 3), contents.Q.dtype)
        known = (contents, walls.kind, walls.old_fraction, self._merging.target, self._grid)
        self._device.run(self._kernels.absorb, band.shape[0], band, moved, *known)
        self._device.run(self._kernels.put_moved, band.shape[0], band, moved, contents, self._grid)

    def trapped(self, band: Any, states: States, kind: Any) -> Any:
        """Masses per volume (n, phases) [kg/m3] of isolated cells of the band, 0 of the others."""
        held = self._device.empty((band.shape[0], self._model.phases))
        self._device.run(self._kernels.find_trapped, band.shape[0], band, held, states, kind, self._grid)
        return held

    # ---- redistribution ---------------------------------------------------------------------------------------------

    def redistribute(self, lists: CellLists, contents: Contents, fraction: Any, merging: Merging) -> States:
        """Collective. Contents of the band become states of what is merged; covered cells rest. Merged cells share
        their volume as their open `fraction` is."""
        run, k, band = self._device.run, self._kernels, lists.band
        self.exchange_ghosts(contents)
        new, boxes = self._new_states(band), -(-band.shape[0] // self._device.lanes)
        run(k.redistribute, boxes, band, new, contents, fraction, merging, self._grid)
        states = States(*contents)
        run(k.put_states, band.shape[0], band, new, states, self._grid)
        run(k.put_rest, lists.covered.shape[0], lists.covered, states, self._rest, self._grid)
        return states

    def exchange_volumes(self, lists: CellLists, states: States, walls: Walls, expands: bool) -> None:
        """Collective. Fluid volume fractions come nearer to the open ones; what is missing in whole cells their fluid
        fills itself, if it `expands`."""
        run, k = self._device.run, self._kernels
        both = [(cells, self._new_states(cells)) for cells in (lists.band, lists.uneven)]
        for _ in range(ROUNDS):
            self.exchange_ghosts(states)
            for cells, new in both:
                run(k.exchange_volumes, cells.shape[0], cells, new, states, walls, int(expands), self._grid)
            for cells, new in both:
                run(k.put_states, cells.shape[0], cells, new, states, self._grid)
        self._merging.ghosts.exchange((self.volume.device, self._parities[1]))

    def exchange_ghosts(self, fluid: States | Contents) -> None:
        """Collective. Of the cells around the wall."""
        field, volume = fluid
        self._merging.ghosts.exchange((field, self._parities[0]), (volume, self._parities[1]))

    def _new_states(self, cells: Any) -> Any:
        """Room for states and volumes of a list of cells."""
        return self._device.empty((cells.shape[0], self._model.variables + 1), self.volume.dtype)
