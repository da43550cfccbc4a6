"""Exchange of those ghost cells only whose sources are marked."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Device
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.regions import Regions
from distfsi.mesh.route import Route
from distfsi.mesh.rows import Rows
from distfsi.narrowing import present


class Choice:
    """The cells of some regions in flat lists of the device, and those that are chosen among them.

    rows     (n,) the indices of the chosen among all, on the device
    columns  (n,) each: of the chosen cells, on the device
    """

    def __init__(self, rows: Rows, *columns: np.ndarray):
        """`columns`: int64; the first are the cells by whose mark others are chosen."""
        self._rows, self._all = rows, [rows.device.array(np.ascontiguousarray(column)) for column in columns]
        self.rows, self.columns = rows.device.empty(0, np.int64), [rows.device.empty(0, np.int64) for _ in columns]

    def choose(self, mark: Any) -> None:
        """Those cells are chosen whose `mark`, in a flat field of one variable, is not 0."""
        if self._all[0].shape[0]:
            _, self.rows = self._rows.marked(self._rows.taken(mark, self._all[0]))
            self.columns = [self._rows.taken(column, self.rows) for column in self._all]


class ChosenGhosts:
    """Fills chosen ghost cells of fields, all fields in one message per other rank. What an inflow fills is let be."""

    def __init__(self, exchange: GhostExchange, device: Device, kernels: SimpleNamespace) -> None:
        """`kernels`: copy_cells, pack_cells and unpack_cells of mesh/kernels/regions.py, and those of
        mesh/kernels/rows.py that `Rows` needs, as built by the device that holds the fields."""
        blocks = exchange.blocks
        self._communicator, self._device, self._kernels = blocks.communicator, device, kernels
        self._cells, rows = int(np.prod(blocks.shape)), Rows(device, kernels)
        local, into, out = exchange.local, exchange.incoming, exchange.outgoing

        def listed(regions: Regions, *ends: str) -> list[np.ndarray]:
            return [*(regions.cells(blocks, end) for end in ends), np.repeat(regions.flips, regions.volume)]

        self._local = Choice(rows, *listed(local, "block", "source"))
        self._into, self._out = (
            Choice(rows, *listed(into.regions, "block")),
            Choice(rows, *listed(out.regions, "source")),
        )
        self._givers, self._takers = into.rank_of_cells(), out.rank_of_cells()
        self._route: Route | None = None  # as of choose()
        self._staged: Any = None  # what the device may still read

    def choose(self, mark: Any) -> None:
        """From now on the ghosts of cells with a `mark` other than 0 are exchanged; `mark`: a flat field of one
        variable, whose ghosts are known."""
        for choice in (self._local, self._into, self._out):
            choice.choose(mark)
        givers, takers = (
            ranks[self._device.download(choice.rows)]
            for ranks, choice in ((self._givers, self._into), (self._takers, self._out))
        )
        self._route = Route(self._communicator, takers, givers)

    @property
    def cells(self) -> list[Any]:
        """Lists (n,) of the chosen ghost cells, by their flat index in a field of one variable."""
        return [self._local.columns[0], self._into.columns[0]]

    def exchange(self, *given: tuple[Any, Any]) -> None:
        """Fill the ghosts of each (field, parity).

        field   (local blocks, variables, Z, Y, X) of the device, all of one type
        parity  (variables,) int64, of the device: the axes, as bits, whose reflection changes the variable's sign
        """
        fields = [(field.reshape(-1), parity) for field, parity in given]
        stride, route = sum(parity.shape[0] for _, parity in fields), present(self._route)
        exchanged = route.leaving or route.arriving
        if exchanged:
            arrived = self._transfer(fields, stride)
        to, of, flips = self._local.columns
        for flat, parity in fields:
            self._device.run(self._kernels.copy_cells, to.shape[0], to, of, flips, parity, self._cells, flat)
        if exchanged:
            column, (to, _) = 0, self._into.columns
            for flat, parity in fields:
                target = (parity.shape[0], self._cells, arrived, stride, column, flat)
                self._device.run(self._kernels.unpack_cells, to.shape[0], to, *target)
                column += parity.shape[0]

    def _transfer(self, given: list[tuple[Any, Any]], stride: int) -> Any:
        """The rows of the ghosts, packed, on the device."""
        device, route = self._device, present(self._route)

        def pack(packed: Any) -> None:
            column = 0
            for flat, parity in given:
                source = (*self._out.columns, parity, self._cells, flat, stride, column, packed)
                device.run(self._kernels.pack_cells, route.leaving, *source)
                column += parity.shape[0]

        arrived, self._staged = route.carry(device, stride, given[0][0].dtype, pack)
        return arrived
