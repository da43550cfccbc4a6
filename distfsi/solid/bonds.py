"""Bonds of a rank's particles: who is bonded to whom, and where the partners are.

Bonds are known by the keys of their partners, so that they move with the particles; what follows from them (rows of
partners, vectors, weights) is found again when a rank's particles, ghosts or images have changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns
from distfsi.errors import Diverged
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.kernels.particles import IMAGES
from distfsi.mesh.particles import GhostPlan, Key, ParticleExchange
from distfsi.scene.description import Solid
from distfsi.solid.kernels import bonds as kernels
from distfsi.solid.kernels.records import NEVER_BONDED, RIGID, Bodies, Bonds, Fit, Particles
from distfsi.solid.neighbours import NeighbourSearch
from distfsi.solid.sides import Sides

DRIVERS = (kernels.find_partners, kernels.weigh_bonds, kernels.fit_bonds, kernels.accept_fit)
AT_A_TIME = 16384  # particles whose bonds are made together
NONE = np.iinfo(np.int64).max  # no key


def chunks_of(rows: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """First row and rows, AT_A_TIME of them."""
    return ((begin, rows[begin : begin + AT_A_TIME]) for begin in range(0, len(rows), AT_A_TIME))


class BondNetwork:
    """The bonds of this rank's particles: the columns `bonds` and `bond_count` of solid/total_lagrangian.py.

    support    how far bonds reach in the reference state [m]
    bodies     spacing and smoothing length of the bodies, on the device
    """

    def __init__(
        self,
        kernels: SimpleNamespace,
        exchange: ParticleExchange,
        search: NeighbourSearch,
        communicator: Communicator,
        scene: Solid,
        sides: Sides,
    ):
        """The bodies of the `scene` whose form is not the total Lagrangian one get no bonds."""
        device, spacing = exchange.device, np.array([body.spacing for body in scene.bodies])
        forms = [scene.form_of(body) for body in scene.bodies]
        self._bonded = np.array([form == "total_lagrangian" for form in forms])
        self._unbonded = np.array([RIGID if form == "rigid" else NEVER_BONDED for form in forms])
        self._kernels, self._rows, self._device = kernels, exchange.rows, device
        self._search, self._communicator, self._sides = search, communicator, sides
        self._dimensions = exchange.blocks.grid.dimensions
        self.support = 2.0 * scene.smoothing * spacing.max()
        self._smoothing, self._first = scene.smoothing * spacing, np.array(scene.first_tied)
        self.bodies = Bodies(device.array(spacing), device.array(self._smoothing))
        self._ids: np.ndarray | None = None  # for whose columns the requested keys are
        self._requested = np.empty(0, dtype=np.int64)
        self._key: Key | None = None  # for whose particles the partners and the geometry are
        self._partner: Any = None
        self._geometry: Any = None

    # ---- making bonds ------------------------------------------------------------------------------------------------

    def make(self, c: Columns, exchange: ParticleExchange) -> None:
        """Collective. Bond each particle with its neighbours of its body and those tied to it, where they are now, and
        add the columns."""
        plan, side, table, count = self._neighbours(c, exchange)
        key, bonds = plan.key.host, []
        for begin, near in chunks_of(table):
            rows = slice(begin, begin + len(near))
            found = np.arange(table.shape[1]) < count[rows, None]
            near, body = np.where(found, near, 0), c["body"][rows, None].astype(np.int64)
            bonded = found & (side[near] == self._first[body]) & self._bonded[body]
            keys = np.sort(np.where(bonded, key[near], NONE), axis=1)
            bonds.append(keys[:, : bonded.sum(axis=1).max(initial=1)])
        width = int(self._communicator.maximum(np.array([max((b.shape[1] for b in bonds), default=1)]))[0])
        padded = [np.pad(b, ((0, 0), (0, width - b.shape[1])), constant_values=NONE) for b in bonds]
        keys = np.concatenate([np.empty((0, width), dtype=np.int64), *padded])
        c["bonds"] = np.where(keys == NONE, -1, keys)
        count = np.count_nonzero(c["bonds"] >= 0, axis=1)
        c["bond_count"] = np.where(self._bonded[c["body"]], count, self._unbonded[c["body"]])

    def _neighbours(
        self, c: Columns, exchange: ParticleExchange
    ) -> tuple[GhostPlan, np.ndarray, np.ndarray, np.ndarray]:
        """Who is near whom, at the moment: a plan, the side (count,) of all particles, table and number of
        neighbours."""
        device = self._device
        (own_position,) = c.read("position")
        plan = exchange.ghosts(own_position, c["id"], self.support)
        state = device.array(np.column_stack([c["mass"], c["density"], c["h"]]))
        position, state = plan.exchange([(own_position, "position"), (state, ((),) * 3)])
        found = self._search.find(plan.own, Particles(position, state), plan.key.device, self.support)
        table, count = (device.download(array) for array in found)
        return plan, self._sides.of(plan.key).host(), table, count

    # ---- where the partners are --------------------------------------------------------------------------------------

    def requested_keys(self, c: Columns) -> np.ndarray:
        """Keys of the partners that are not among this rank's particles."""
        if c["id"] is not self._ids:
            self._ids, self._key = c["id"], None
            partner = self._device.download(self._rows_of_partners(c, c["id"] * IMAGES))
            self._requested = np.unique(c["bonds"][partner < 0])
        return self._requested

    def find(self, c: Columns, key: Key, reference: Any, payload: Any) -> Bonds:
        """The bonds among particles with this `key`: partners and geometry are found again if it is a new one.

        `reference` (count, D) [m]; `payload` (count, ...) with the volume in the first column. Raises Diverged when a
        partner is not among them.
        """
        (count,) = c.read("bond_count")
        if key is not self._key:
            self._key, self._partner = key, self._rows_of_partners(c, key.host)
            n, width = self._partner.shape
            if n and self._rows.minimum(self._partner.reshape(-1))[0] < 0:
                raise Diverged("solid: the partner of a bond is not at hand")
            self._geometry = self._device.empty((n, width * (self._dimensions + 1)))
            bonds = Bonds(count, self._partner, self._geometry)
            smoothing = self._device.array(self._smoothing[self._sides.body_of(key.host)])
            self._device.run(self._kernels.weigh_bonds, n, reference, payload, smoothing, bonds)
        return Bonds(count, self._partner, self._geometry)

    def _rows_of_partners(self, c: Columns, key: np.ndarray) -> Any:
        """(n, width) where the partners' keys stand in `key`; -1: nowhere."""
        order = np.argsort(key, kind="stable")
        bonds, count = c.read("bonds", "bond_count")
        partner = self._device.zeros(bonds.shape, np.int32)
        sorted_keys = (self._device.array(key[order]), self._device.array(order))
        self._device.run(self._kernels.find_partners, bonds.shape[0], bonds, count, *sorted_keys, partner)
        return partner

    def fit(self, count: int, rows: Any, bonds: Bonds, reference: Any, bond_state: Any) -> tuple[Fit, Any]:
        """What the bonds tell of the particles `rows` (count,), and the moments (count, 2) that fit_bonds() gives."""
        D = self._dimensions
        correction, deformation, moments = (self._device.empty((count, width)) for width in (D * D, D * D, 2))
        fit = Fit(correction, deformation)
        self._device.run(self._kernels.fit_bonds, count, rows, bonds, reference, bond_state, fit, moments)
        return fit, moments
