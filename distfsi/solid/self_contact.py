"""Contact of one body with itself: particles without a bond, as the faces of a crack, folds, debris."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns
from distfsi.mesh.rows import Rows
from distfsi.narrowing import present
from distfsi.solid.kernels import self_contact as kernels
from distfsi.solid.kernels.records import SMOOTHING, UNBONDED, Contacts, Neighbours, Particles, SearchMemory
from distfsi.solid.neighbours import Near, NeighbourSearch
from distfsi.solid.sides import Sides

DRIVERS = (
    kernels.mark_exposed,
    kernels.remember_search,
    kernels.mark_outdated,
    kernels.accelerate_contacts,
    kernels.heat_contacts,
)
SKIN = 0.5  # of a particle's size: how far a search looks beyond particles that touch


class SelfContact:
    """Pairs of exposed particles that may touch, found again when they have moved or others are exposed.

    The forces are the same to the bit whenever the search was made: pairs beyond touch add nothing, and the partners of
    a particle are visited in the order of their keys.
    """

    def __init__(self, kernels: SimpleNamespace, rows: Rows, search: NeighbourSearch, sides: Sides, dimensions: int):
        self._kernels, self._device, self._rows, self._sides = kernels, rows.device, rows, sides
        self._search, self._dimensions = search, dimensions
        self._last: SearchMemory | None = None
        self._chosen: Any = None  # rows of the exposed particles
        self._neighbours: Neighbours | None = None
        self._contacts: Contacts | None = None

    def forget(self) -> None:
        """Search anew in the next step."""
        self._last = None

    def find(self, c: Columns, near: Near, reference: Any, payload: Any) -> None:
        """Find who may touch, with the `reference` positions (count, D) and the `payload` (count, …) with the columns
        of solid/kernels/records.py. Particles with a bond do not touch."""
        device, count, key = self._device, near.plan.count, near.plan.key.device
        size, rupture_length, mark = device.empty(count), device.empty(count), device.empty(count, np.int8)
        device.run(self._kernels.mark_exposed, count, near.state, payload, size, rupture_length, mark)
        number, rows = self._rows.marked(mark)
        known = (rows, key, payload, near.position, size)
        if not self._still_valid(number, known):
            shapes = ((number, np.int64), ((number, self._dimensions), np.float64), (number, np.float64))
            self._last = SearchMemory(*(device.empty(*shape) for shape in shapes))
            device.run(self._kernels.remember_search, number, *known, self._last)
            self._neighbours = self._candidates(c, near, rows, size, payload)
        self._chosen = rows
        self._contacts = Contacts(near.position, near.state, reference, size, rupture_length)

    def _still_valid(self, number: int, known: tuple[Any, ...]) -> bool:
        if self._last is None or self._last.identity.shape[0] != number:
            return False
        mark = self._device.empty(number, np.int8)
        self._device.run(self._kernels.mark_outdated, number, SKIN, *known, self._last, mark)
        return not self._rows.any(mark)

    def _candidates(self, c: Columns, near: Near, device_rows: Any, size: Any, payload: Any) -> Neighbours:
        """Those of the particles `device_rows` that may soon touch each of the own among them.

        Different sides meet otherwise, and so do two particles without bonds.
        """
        device, rows = self._device, self._device.download(device_rows)
        position, key, state, size, payload = (
            self._rows.taken(array, device_rows)
            for array in (near.position, near.plan.key.device, near.state, size, payload)
        )
        # A search in which a particle reaches as far as it may soon touch.
        state, unbonded = device.download(state).copy(), device.download(payload)[:, UNBONDED]
        reach = (1.0 + SKIN) * device.download(size)
        state[:, SMOOTHING] = 0.5 * reach
        own = int(np.searchsorted(rows, near.own))
        cells = reach.max(initial=np.finfo(float).tiny)
        near_each_other = self._search.find(own, Particles(position, device.array(state)), key, cells)
        # Pairs of one side without a bond, of which one has bonds.
        found, key, bonds = device.download(near_each_other.table), device.download(key), c["bonds"]
        side = self._sides.of(near.plan.key).host()[rows]
        first, index = np.nonzero(np.arange(found.shape[1]) < device.download(near_each_other.count)[:, None])
        second = found[first, index]
        apart = (unbonded[first] * unbonded[second] == 0) & (side[first] == side[second])
        first, second = first[apart], second[apart]
        free = ~(bonds[rows[first]] == key[second][:, None]).any(axis=1)
        first, second = first[free], second[free]
        # A table in which each particle has its partners in the order of their keys.
        order = np.lexsort((key[second], first))
        first, second = first[order], second[order]
        count = np.bincount(first, minlength=own)
        table = np.zeros((own, count.max(initial=0)), dtype=np.int32)
        table[first, np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)] = second
        return Neighbours(device.array(table), device.array(count))

    def accelerate(self, mass: Any, acceleration: Any) -> None:
        """Add the contact forces to the `acceleration` (own, D); after find()."""
        self._run(self._kernels.accelerate_contacts, mass, acceleration)

    def heat(self, mass: Any, dt: float, motion: Any, energy: Any) -> None:
        """Advance the `energy` (own,) by half the work of the contact forces with the mean velocities `motion`."""
        self._run(self._kernels.heat_contacts, mass, dt, motion, energy)

    def _run(self, kernel: Any, *arguments: Any) -> None:
        neighbours = present(self._neighbours)
        self._device.run(kernel, neighbours.count.shape[0], self._chosen, neighbours, self._contacts, *arguments)
