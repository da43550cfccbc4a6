"""Contact of particles without a bond: different bodies, what a crack has parted, debris."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns
from distfsi.mesh.rows import Rows
from distfsi.solid.kernels import contact as kernels
from distfsi.solid.kernels.bonds import DEBRIS
from distfsi.solid.kernels.pairs import SMOOTHING
from distfsi.solid.neighbours import Near, NeighbourSearch

DRIVERS = (kernels.mark_touching, kernels.remember, kernels.mark_invalid, kernels.touch, kernels.heat_contact)
SKIN = 0.5  # of a particle's size: how far a search looks beyond particles that touch


class Contact:
    """Pairs of exposed particles that may touch, found again when they have moved or others are exposed.

    The forces are the same to the bit whenever the search was made: pairs beyond touch add nothing, and the partners of
    a particle are visited in the order of their keys.
    """

    def __init__(self, kernels: SimpleNamespace, rows: Rows, search: NeighbourSearch, dimensions: int):
        self._kernels, self._device, self._rows = kernels, rows.device, rows
        self._search, self._dimensions = search, dimensions
        self.forget()

    def forget(self) -> None:
        """Search anew in the next step."""
        self._then: tuple | None = None

    def find(self, c: Columns, near: Near, reference: Any, facts: Any, through: Any) -> None:
        """Find who may touch, with the `reference` positions (count, D), the `facts` (count, …) of
        solid/kernels/bonds.py and the axes `through` (bodies,) which bodies go on. Particles with a bond do not
        touch."""
        device, count = self._device, near.plan.count
        size, parted = device.empty(count), device.empty(count)
        side, mark = device.empty(count, np.int64), device.empty(count, np.int8)
        known = (near.plan.key.device, facts, near.position, size)
        device.run(self._kernels.mark_touching, count, near.state, facts, known[0], through, size, parted, side, mark)
        number, rows = self._rows.marked(mark)
        if not self._still_valid(number, rows, known):
            self._then = device.empty(number, np.int64), device.empty((number, self._dimensions)), device.empty(number)
            device.run(self._kernels.remember, number, rows, *known, *self._then)
            self._table, self._count = self._candidates(c, near, device.download(rows), rows, size, facts)
        self._among = (rows, self._table, self._count)
        self._pairs = (near.position, near.state, reference, size, parted, side)

    def _still_valid(self, number: int, rows: Any, known: tuple) -> bool:
        if self._then is None or self._then[0].shape[0] != number:
            return False
        mark = self._device.empty(number, np.int8)
        self._device.run(self._kernels.mark_invalid, number, SKIN, rows, *known, *self._then, mark)
        return not self._rows.any(mark)

    def _candidates(
        self, c: Columns, near: Near, rows: np.ndarray, device_rows: Any, size: Any, facts: Any
    ) -> tuple[Any, Any]:
        """Table (own, width) and number (own,) of the particles among `rows` that may soon touch each of them.

        Two particles of debris act on each other otherwise.
        """
        device = self._device
        position, key, state, size, facts = (
            self._rows.taken(array, device_rows)
            for array in (near.position, near.plan.key.device, near.state, size, facts)
        )
        state, debris = device.download(state).copy(), device.download(facts)[:, DEBRIS]
        reach = (1.0 + SKIN) * device.download(size)
        state[:, SMOOTHING] = 0.5 * reach
        own = int(np.searchsorted(rows, near.own))
        cells = reach.max(initial=np.finfo(float).tiny)
        self._search.find(own, position, device.array(state), key, cells)
        found, key, bonds = device.download(self._search.table), device.download(key), c["bonds"]
        first, place = np.nonzero(np.arange(found.shape[1]) < device.download(self._search.count)[:, None])
        second = found[first, place]
        apart = debris[first] * debris[second] == 0
        first, second = first[apart], second[apart]
        free = ~(bonds[rows[first]] == key[second][:, None]).any(axis=1)
        first, second = first[free], second[free]
        order = np.lexsort((key[second], first))
        first, second = first[order], second[order]
        count = np.bincount(first, minlength=own)
        table = np.zeros((own, count.max(initial=0)), dtype=np.int32)
        table[first, np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)] = second
        return device.array(table), device.array(count)

    def accelerate(self, mass: Any, acceleration: Any) -> None:
        """Add the contact forces to the `acceleration` (own, D); after find()."""
        self._device.run(
            self._kernels.touch, self._count.shape[0], *self._among, *self._pairs, mass, acceleration
        )  # fmt: skip

    def heat(self, mass: Any, dt: float, motion: Any, energy: Any) -> None:
        """Advance the `energy` (own,) by half the work of the contact forces with the mean velocities `motion`."""
        self._device.run(
            self._kernels.heat_contact, self._count.shape[0], *self._among, *self._pairs, mass, dt, motion, energy
        )  # fmt: skip
