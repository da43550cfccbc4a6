"""Contact of particles without a bond: different bodies, what a crack has parted, debris."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from distfsi.device.cpu import Team
from distfsi.kernels import contact as kernels
from distfsi.kernels.solid import DENSITY, MASS, SMOOTHING
from distfsi.parts.neighbours import Near, NeighbourSearch

DRIVERS = (kernels.touch, kernels.heat_contact)
SKIN = 0.5  # of a particle's size: how far a search looks beyond particles that touch


class Contact:
    """Pairs of exposed particles that may touch, found again when they have moved or others are exposed.

    The forces are the same to the bit whenever the search was made: pairs beyond touch add nothing, and the partners of
    a particle are visited in the order of their keys.
    """

    def __init__(self, kernels: SimpleNamespace, team: Team, search: NeighbourSearch, dimensions: int):
        self._kernels, self._team, self._search, self._dimensions = kernels, team, search, dimensions
        self.forget()

    def forget(self) -> None:
        """Search anew in the next step."""
        self._who: np.ndarray | None = None

    def find(self, near: Near, reference: np.ndarray, facts: np.ndarray, bonds: np.ndarray) -> None:
        """Find who may touch, with the `reference` positions (count, D) and `facts` (count, 3): body, exposed, debris.

        Particles with a bond do not touch: `bonds` (own, width) holds the keys of partners, -1 for none.
        """
        rows = np.flatnonzero(facts[:, 1:].any(axis=1))
        size = (near.state[:, MASS] / near.state[:, DENSITY]) ** (1.0 / self._dimensions)
        who = 2 * near.plan.key[rows] + facts[rows, 2]
        if not self._still_valid(who, near.position[rows], size[rows]):
            self._who, self._place, self._size = who, near.position[rows], size[rows]
            self._table, self._count = self._candidates(near, rows, size, facts[rows, 2], bonds)
        self._among = (rows[: len(self._count)], rows[self._table].astype(np.int32), self._count)
        self._pairs = (near.position, near.state, reference, size, np.ascontiguousarray(facts[:, 0]))

    def _still_valid(self, who: np.ndarray, place: np.ndarray, size: np.ndarray) -> bool:
        if self._who is None or not np.array_equal(who, self._who):
            return False
        closer = np.sqrt(((place - self._place) ** 2).sum(axis=1)) + 0.5 * (size - self._size)
        return bool((closer <= 0.5 * SKIN * self._size).all())

    def _candidates(
        self, near: Near, rows: np.ndarray, size: np.ndarray, debris: np.ndarray, bonds: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Table (own, width) and number (own,) of the particles among `rows` that may soon touch each of them.

        Two particles of `debris` (rows,) act on each other otherwise.
        """
        key, state = near.plan.key[rows], near.state[rows]
        reach = (1.0 + SKIN) * size[rows]
        state[:, SMOOTHING] = 0.5 * reach
        own = int(np.searchsorted(rows, near.own))
        cells = reach.max(initial=np.finfo(float).tiny)
        self._search.find(own, near.position[rows], state, key, cells)
        first, place = np.nonzero(np.arange(self._search.table.shape[1]) < self._search.count[:, None])
        second = self._search.table[first, place]
        apart = debris[first] * debris[second] == 0
        first, second = first[apart], second[apart]
        free = ~(bonds[rows[first]] == key[second][:, None]).any(axis=1)
        first, second = first[free], second[free]
        order = np.lexsort((key[second], first))
        first, second = first[order], second[order]
        count = np.bincount(first, minlength=own)
        table = np.zeros((own, count.max(initial=0)), dtype=np.int64)
        table[first, np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)] = second
        return table, count

    def accelerate(self, mass: np.ndarray, acceleration: np.ndarray) -> None:
        """Add the contact forces to the `acceleration` (own, D); after find()."""
        self._team.run(self._kernels.touch, len(self._count), *self._among, *self._pairs, mass, acceleration)

    def heat(self, mass: np.ndarray, dt: float, motion: np.ndarray, energy: np.ndarray) -> None:
        """Advance the `energy` (own,) by half the work of the contact forces with the mean velocities `motion`."""
        self._team.run(
            self._kernels.heat_contact, len(self._count), *self._among, *self._pairs, mass, dt, motion, energy
        )
