"""The total Lagrangian form: bonds between the neighbours of the reference state, contact, and debris.

Bonds are known by the keys of their partners, so that they move with the particles; what follows from them (rows of
partners, gradients) is found again when a rank's particles, ghosts or images have changed. A particle whose bonds are
gone is debris: from then on the updated Lagrangian form moves it among other debris, with the state it had.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns
from distfsi.errors import Diverged
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.particles import IMAGES, Key, ParticleExchange
from distfsi.scene.description import Solid
from distfsi.solid import contact, pieces
from distfsi.solid.contact import Contact
from distfsi.solid.kernels import bonds as kernels
from distfsi.solid.kernels import motion
from distfsi.solid.neighbours import Near, NeighbourSearch
from distfsi.solid.updated import UpdatedLagrangian

DRIVERS = (
    kernels.find_partners,
    kernels.weigh,
    kernels.fit,
    kernels.keep_fit,
    kernels.mark_parted,
    kernels.mark_cut,
    kernels.mark_damaged,
    kernels.mark_debris,
    kernels.look_around,
    kernels.crack,
    kernels.tell,
    kernels.cut,
    kernels.stress_bonds,
    kernels.pull,
    kernels.stretch,
    kernels.bound,
    kernels.open_voids,
    motion.mean_motion,
    *contact.DRIVERS,
)
EXPOSED_BELOW = 0.75  # determinant of the moment of a particle's bonds, 1 inside a body
LOOSE_BELOW = 0.1  # least eigenvalue of the moment, below which the gradient's correction fades
ON_THE_PLANE = 0.75  # spacings: a body whose particles come so close to a symmetry plane goes on behind it
AT_A_TIME = 16384  # particles whose bonds are made together
NONE = np.iinfo(np.int64).max  # no key
FACTS = 9  # columns of what ghosts are told besides, see solid/kernels/bonds.py


def chunks_of(rows: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """First row and rows, AT_A_TIME of them."""
    return ((begin, rows[begin : begin + AT_A_TIME]) for begin in range(0, len(rows), AT_A_TIME))


class TotalLagrangian:
    """Bonds of this rank's particles. Columns of the solid that belong to it:

    reference         (n, D) position in the reference state [m]
    volume            (n,) volume in the reference state [m^D]
    bonds             (n, width) keys of the partners in ascending order, -1 for none; bond_count (n,)
    correction        (n, D D) gradient correction; deformation (n, D D) deformation gradient, by rows
    viscous_pressure  (n,) [Pa]
    parted            (n,) length of the shortest bond that was cut, when it was cut [m]
    void              (n,) logarithm of how much larger a failed particle is with its void
    piece             (n,) smallest id of all particles that intact bonds hold together, as of label_pieces()
    around            (n,) largest damage of the particle and its partners so far
    crack             (n, D) vector, in the reference state, to the plane of the crack beside the particle [m]; 0: none
    loose             (n,) 1 when the particle leaves its bonds in the next step
    exposed           (n,) 1 when it lies at a surface
    """

    def __init__(
        self,
        kernels: SimpleNamespace,
        exchange: ParticleExchange,
        search: NeighbourSearch,
        communicator: Communicator,
        scene: Solid,
        eos: Any,
        strength: Any,
        dimensions: int,
    ):
        """`eos`, `strength`: those tables of the materials, on the device."""
        self._kernels, self._rows, self._device = kernels, exchange.rows, exchange.device
        self._communicator, self._eos, self._strength = communicator, eos, strength
        self._spacing = np.array([body.spacing for body in scene.bodies])
        self._support = 2.0 * scene.smoothing * self._spacing.max()
        self._size = self._device.array(scene.smoothing * self._spacing)
        self._distance = self._device.array(self._spacing)
        self._dimensions, self._search = dimensions, search
        self._debris = UpdatedLagrangian(kernels, self._device, search, dimensions)
        self._contact = Contact(kernels, self._rows, search, dimensions)
        self._ids: np.ndarray | None = None
        self._cut_since_labelled = True

    # ---- the reference state ----------------------------------------------------------------------------------------

    def bind(self, c: Columns, exchange: ParticleExchange) -> None:
        """Collective. Make the bonds of the particles where they are now, and add the columns."""
        n, D, device = len(c["id"]), self._dimensions, self._device
        c["reference"], c["volume"] = c["position"].copy(), c["mass"] / c["density"]
        c["bonds"] = bonds = self._near_each_other(c, exchange)
        c["bond_count"] = np.count_nonzero(bonds >= 0, axis=1)
        c["viscous_pressure"], c["void"], c["around"] = np.zeros(n), np.zeros(n), np.zeros(n)
        c["crack"], c["parted"] = np.zeros((n, D)), np.full(n, self._support)
        c["loose"] = np.zeros(n, dtype=np.int64)
        plan = exchange.ghosts(*c.read("position"), c["id"], self._support, self.requested_keys(c))
        volume = device.array(np.ascontiguousarray(c["volume"][:, None]))
        self._place(c, plan.key, *plan.exchange([(*c.read("reference"), "position"), (volume, ((),))]))
        correction, deformation, moments = self._fit(
            n, device.array(np.arange(n)), c, device.zeros((plan.count, 1 + D))
        )
        c.adopt("correction", correction)
        c.adopt("deformation", deformation)
        c["exposed"] = (device.download(moments)[:, 0] < EXPOSED_BELOW).astype(np.int64)
        self.label_pieces(c, exchange)

    def label_pieces(self, c: Columns, exchange: ParticleExchange) -> None:
        """Collective. Bring the labels of the pieces up to date."""
        if self._communicator.maximum(np.array([self._cut_since_labelled]))[0] == 0.0:
            return
        self._cut_since_labelled = False
        plan = exchange.ghosts(*c.read("position"), c["id"], 0.0, self.requested_keys(c))
        id = plan.key.host[plan.key.host % IMAGES == 0] // IMAGES
        order = np.argsort(id, kind="stable")
        pairs = [np.empty((2, 0), dtype=np.int64)]
        for begin, bonds in chunks_of(c["bonds"]):
            first, place = np.nonzero(bonds >= 0)
            second = order[np.searchsorted(id, bonds[first, place] // IMAGES, sorter=order)]
            pairs.append(np.stack([begin + first, second])[:, begin + first < second])  # each bond once
        c["piece"] = pieces.label(id, np.concatenate(pairs, axis=1), plan, self._device, self._communicator)

    def _near_each_other(self, c: Columns, exchange: ParticleExchange) -> np.ndarray:
        """(own, width) keys of each particle's neighbours of its body, ascending, and then -1."""
        device = self._device
        plan = exchange.ghosts(*c.read("position"), c["id"], self._support)
        state = device.array(np.column_stack([c["mass"], c["density"], c["h"]]))
        body = device.array(c["body"].astype(float))
        given = [(*c.read("position"), "position"), (state, ((),) * 3), (body, ((),))]
        position, state, body = plan.exchange(given)
        self._search.find(plan.own, position, state, plan.key.device, self._support)
        table, count, body = (
            device.download(self._search.table),
            device.download(self._search.count),
            device.download(body),
        )
        through = self._through_planes(c, exchange)
        self._through, key = device.array(through), plan.key.host
        body = body.astype(np.int64)
        side = body + len(through) * (key % IMAGES & ~through[body] > 0)  # an image where a body ends is another's
        bonds = []
        for begin, near in chunks_of(table):
            rows = slice(begin, begin + len(near))
            found = np.arange(table.shape[1]) < count[rows, None]
            near = np.where(found, near, 0)
            bonded = found & (side[near] == body[rows, None])
            keys = np.sort(np.where(bonded, key[near], NONE), axis=1)
            bonds.append(keys[:, : bonded.sum(axis=1).max(initial=1)])
        width = int(self._communicator.maximum(np.array([max((b.shape[1] for b in bonds), default=1)]))[0])
        padded = [np.pad(b, ((0, 0), (0, width - b.shape[1])), constant_values=NONE) for b in bonds]
        keys = np.concatenate([np.empty((0, width), dtype=np.int64), *padded])
        return np.where(keys == NONE, -1, keys)

    def _through_planes(self, c: Columns, exchange: ParticleExchange) -> np.ndarray:
        """(bodies,) the axes, as bits, along which a body goes on behind a symmetry plane."""
        touching = np.zeros((len(self._spacing), self._dimensions))
        for axis, place in exchange.planes():
            close = np.abs(c["position"][:, axis] - place) < ON_THE_PLANE * self._spacing[c["body"]]
            touching[c["body"][close], axis] = 1.0
        touching = self._communicator.maximum(touching.ravel()).reshape(touching.shape)
        return (touching.astype(np.int64) << np.arange(self._dimensions)).sum(axis=1)

    def _place(self, c: Columns, key: Key, reference: Any, facts: Any) -> None:
        """Find the partners' rows, the vectors and the weights of the bonds, if the rows have changed since.

        `facts`: volumes in the first column.
        """
        self._reference = reference
        if key is self._key:
            return
        self._key = key
        self._partner = self._rows_of_partners(c, key.host)
        n, width = self._partner.shape
        if n and self._rows.minimum(self._partner.reshape(-1))[0] < 0:
            raise Diverged("solid: the partner of a bond is not at hand")
        self._bond = self._device.empty((n, width * (self._dimensions + 1)))
        (body,) = c.read("body")
        self._run(n, "weigh", reference, facts, self._size, body, *self._bonds(c))

    def _bonds(self, c: Columns) -> tuple:
        """How many bonds each particle has, their partners' rows, their vectors and weights."""
        return *c.read("bond_count"), self._partner, self._bond

    def _rows_of_partners(self, c: Columns, key: np.ndarray) -> Any:
        """(n, width) where the partners' keys stand in `key`; -1: nowhere."""
        order = np.argsort(key, kind="stable")
        bonds, count = c.read("bonds", "bond_count")
        partner = self._device.zeros(bonds.shape, np.int32)
        sorted_keys = (self._device.array(key[order]), self._device.array(order))
        self._run(bonds.shape[0], "find_partners", bonds, count, *sorted_keys, partner)
        return partner

    def _fit(self, count: int, rows: Any, c: Columns, tension: Any) -> tuple[Any, ...]:
        """Gradient correction, deformation gradient (rows, D D) and moments (rows, 2) of solid/kernels/bonds.py."""
        D = self._dimensions
        fitted = tuple(self._device.empty((count, width)) for width in (D * D, D * D, 2))
        self._run(count, "fit", rows, *self._bonds(c), self._reference, tension, *fitted)
        return fitted

    def _run(self, count: int, kernel: str, *arguments: Any) -> None:
        self._device.run(getattr(self._kernels, kernel), count, *arguments)

    # ---- a step -----------------------------------------------------------------------------------------------------

    def requested_keys(self, c: Columns) -> np.ndarray:
        """Keys of the partners that are not among this rank's particles."""
        if c["id"] is not self._ids:
            self._ids, self._key = c["id"], None
            partner = self._device.download(self._rows_of_partners(c, c["id"] * IMAGES))
            self._asked = np.unique(c["bonds"][partner < 0])
        return self._asked

    def flags(self, c: Columns) -> list[float]:
        """Whether any particle is damaged; whether any has failed, is loose or debris."""
        bond_count, loose = c.read("bond_count", "loose")
        n = bond_count.shape[0]
        mark = self._device.empty(n, np.int8)
        self._run(n, "mark_parted", bond_count, loose, self._damage(c), mark)
        parted = self._rows.any(mark)
        if "damage" not in c:
            return [0.0, float(parted)]
        self._run(n, "mark_damaged", *c.read("damage"), mark)
        return [float(self._rows.any(mark)), float(parted)]

    def _damage(self, c: Columns) -> Any:
        return c.read("damage")[0] if "damage" in c else self._device.empty(0)

    def ghost_payload(self, c: Columns) -> list:
        """Reference position; stiffness, displacement and bond stress; the facts of solid/kernels/bonds.py."""
        axes, D, n = range(self._dimensions), self._dimensions, c.read("id")[0].shape[0]
        vector = tuple((a,) for a in axes)
        parity = ((), *vector, *((a, b) for a in axes for b in axes))
        tension, facts = self._device.empty((n, 1 + D + D * D)), self._device.empty((n, FACTS + D))
        material = c.read("density", "sound_speed", "plastic_strain", "deviator", "pressure", "viscous_pressure")
        shape = c.read("correction", "deformation", "position", "reference", "loose", "around")
        self._run(n, "stress_bonds", *c.read("body"), self._strength, *material, *shape, tension)
        known = c.read("volume", "body", "around", "loose", "exposed", "bond_count", "parted", "deformation", "crack")
        self._run(n, "tell", *known, self._damage(c), facts)
        return [(*c.read("reference"), "position"), (tension, parity), (facts, (*((),) * FACTS, *vector))]

    def accelerate(self, c: Columns, near: Near, acceleration: Any, limits: Any) -> None:
        """Collective. Cut bonds that have failed; add the `acceleration` (own, D) of all forces to none, and write the
        time steps (own, 2) that they allow."""
        reference, self._tensions, facts = near.ghost_payload
        self._place(c, near.plan.key, reference, facts)
        damaged, parted = near.flags
        if damaged:
            self._run(near.own, "look_around", *c.read("bond_count"), self._partner, facts, *c.write("around"))
        if parted:
            self._cut(c, near, facts)
            _, self._tensions, facts = near.plan.exchange(self.ghost_payload(c))
            mark = self._device.empty(near.plan.count, np.int8)
            self._run(near.plan.count, "mark_debris", facts, mark)
            self._debris.push_debris(c, near, self._rows.marked(mark)[1], acceleration, limits)
        volume, mass = c.read("volume", "mass")
        self._run(near.own, "pull", *self._bonds(c), self._tensions, volume, mass, acceleration)
        self._contact.find(c, near, reference, facts, self._through)
        self._contact.accelerate(mass, acceleration)
        material = c.read("body", "sound_speed", "viscous_pressure", "density", "deformation")
        self._run(near.own, "bound", *c.read("bond_count"), self._size, *material, acceleration, limits)

    def _cut(self, c: Columns, near: Near, facts: Any) -> None:
        """Cut bonds and fit what is left; a particle that too few bonds hold gets loose for the next step."""
        lost, mark = self._device.empty(near.own, np.int64), self._device.empty(near.own, np.int8)
        spacing = (self._distance, *c.read("body"))
        if "damage" in c:
            known = (*c.read("deformation", "damage"), facts, *c.write("crack"))
            sizes = (self._distance, self._size, *c.read("body"))
            self._run(near.own, "crack", *sizes, *self._bonds(c), self._reference, self._tensions, *known)
        bonds = (*c.write("bonds", "bond_count"), self._partner, self._bond)
        self._run(near.own, "cut", near.position, self._reference, *spacing, facts, *bonds, *c.write("parted"), lost)
        self._run(near.own, "mark_cut", lost, mark)
        count, rows = self._rows.marked(mark)
        if not count:
            return
        fitted = self._fit(count, rows, c, self._tensions)
        volumes = c.read("mass", "density", "volume", "void")
        kept = c.write("correction", "deformation", "loose", "exposed")
        self._run(count, "keep_fit", rows, *fitted, LOOSE_BELOW, EXPOSED_BELOW, *volumes, *kept)
        self._contact.forget()
        self._cut_since_labelled = True

    def strain(self, c: Columns, near: Near, dt: float, velocity: Any, gradient: Any) -> None:
        """Advance energy and deformation by `dt` [s] with the old and the new `velocity` (count, D), and write the
        velocity gradient (own, D D) [1/s]; after accelerate()."""
        if near.flags[1]:
            self._debris.strain_debris(c, near, dt, velocity, gradient)
        motion = self._device.empty((near.plan.count, 2 * self._dimensions))
        self._run(near.plan.count, "mean_motion", near.state, velocity, motion)
        material = c.read("volume", "mass", "correction", "h", "density", "sound_speed", "around")
        changed = c.write("deformation", "energy", "viscous_pressure")
        given = (*material, *changed, gradient, *c.write("loose"))
        self._run(near.own, "stretch", dt, *self._bonds(c), self._tensions, motion, *given)
        self._contact.heat(*c.read("mass"), dt, motion, *c.write("energy"))
        if near.flags[1] and dt > 0.0:
            material = (*c.read("body"), self._eos, *c.read("energy", "volume", "mass", "density", "bond_count"))
            self._run(near.own, "open_voids", dt, *material, self._damage(c), *c.write("void"), gradient)
