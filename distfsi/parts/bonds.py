"""The total Lagrangian form: bonds between the neighbours of the reference state, contact, and debris.

Bonds are known by the keys of their partners, so that they move with the particles; what follows from them (rows of
partners, gradients) is found again when a rank's particles, ghosts or images have changed. A particle whose bonds are
gone is debris: from then on the updated Lagrangian form moves it among other debris, with the state it had.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from distfsi.device.cpu import Team
from distfsi.errors import Diverged
from distfsi.kernels import bonds as kernels
from distfsi.kernels.solid import VELOCITY
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.particles import IMAGES, ParticleExchange
from distfsi.parts import contact, pieces
from distfsi.parts.contact import Contact
from distfsi.parts.neighbours import Near, NeighbourSearch
from distfsi.parts.updated import UpdatedLagrangian
from distfsi.scene.description import Solid

DRIVERS = (
    kernels.find_partners,
    kernels.weigh,
    kernels.fit,
    kernels.cut,
    kernels.stress_bonds,
    kernels.pull,
    kernels.stretch,
    kernels.bound,
    *contact.DRIVERS,
)
MATERIAL = ("density", "sound_speed", "plastic_strain", "deviator", "pressure", "viscous_pressure")
EXPOSED_BELOW = 0.75  # determinant of the moment of a particle's bonds, 1 inside a body
LOOSE_BELOW = 0.1  # least eigenvalue of the moment, below which the gradient's correction fades
ON_THE_PLANE = 0.75  # spacings: a body whose particles come so close to a symmetry plane goes on behind it
VOLUME, BODY, FAILED, LOOSE, EXPOSED, DEBRIS = range(6)  # columns of what ghosts are told besides


class TotalLagrangian:
    """Bonds of this rank's particles. Columns of the solid that belong to it:

    reference         (n, D) position in the reference state [m]
    volume            (n,) volume in the reference state [m^D]
    bonds             (n, width) keys of the partners in ascending order, -1 for none; bond_count (n,)
    correction        (n, D D) gradient correction; deformation (n, D D) deformation gradient, by rows
    viscous_pressure  (n,) [Pa]
    void              (n,) logarithm of how much larger a failed particle is with its void
    piece             (n,) smallest id of all particles that intact bonds hold together, as of label_pieces()
    loose             (n,) 1 when the particle leaves its bonds in the next step
    exposed           (n,) 1 when it lies at a surface
    """

    def __init__(
        self,
        kernels: SimpleNamespace,
        team: Team,
        search: NeighbourSearch,
        communicator: Communicator,
        scene: Solid,
        strength: np.ndarray,
        dimensions: int,
    ):
        self._kernels, self._team, self._communicator, self._strength = kernels, team, communicator, strength
        self._spacing = np.array([body.spacing for body in scene.bodies])
        self._size = scene.smoothing * self._spacing
        self._dimensions, self._search = dimensions, search
        self._debris = UpdatedLagrangian(kernels, team, search, dimensions)
        self._contact = Contact(kernels, team, search, dimensions)
        self._ids: np.ndarray | None = None
        self._cut_since_labelled = True

    # ---- the reference state ----------------------------------------------------------------------------------------

    def bind(self, c: dict[str, np.ndarray], exchange: ParticleExchange) -> None:
        """Collective. Make the bonds of the particles where they are now, and add the columns."""
        n, D = len(c["id"]), self._dimensions
        c["reference"], c["volume"] = c["position"].copy(), c["mass"] / c["density"]
        first, key = self._near_each_other(c, exchange)
        count = np.bincount(first, minlength=n)
        width = int(self._communicator.maximum(np.array([count.max(initial=1)]))[0])
        c["bonds"] = np.full((n, width), -1)
        c["bonds"][first, np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)] = key
        c["bond_count"] = count
        c["viscous_pressure"], c["void"] = np.zeros((2, n))
        c["loose"] = np.zeros(n, dtype=np.int64)
        plan = exchange.ghosts(c["position"], c["id"], 2.0 * self._size.max(), self.asked(c))
        self._place(c, plan.key, *plan.exchange([(c["reference"], "position"), (c["volume"], ((),))]))
        c["correction"], c["deformation"], moments = self._fit(np.arange(n), c, np.zeros((plan.count, D)))
        c["exposed"] = (moments[:, 0] < EXPOSED_BELOW).astype(np.int64)
        self.label_pieces(c, exchange)

    def label_pieces(self, c: dict[str, np.ndarray], exchange: ParticleExchange) -> None:
        """Collective. Bring the labels of the pieces up to date."""
        if self._communicator.maximum(np.array([self._cut_since_labelled]))[0] == 0.0:
            return
        self._cut_since_labelled = False
        plan = exchange.ghosts(c["position"], c["id"], 0.0, self.asked(c))
        id = plan.key[plan.key % IMAGES == 0] // IMAGES
        order = np.argsort(id, kind="stable")
        first, place = np.nonzero(c["bonds"] >= 0)
        second = order[np.searchsorted(id, c["bonds"][first, place] // IMAGES, sorter=order)]
        c["piece"] = pieces.label(id, np.stack([first, second]), plan, self._communicator)

    def _near_each_other(self, c: dict[str, np.ndarray], exchange: ParticleExchange) -> tuple[np.ndarray, np.ndarray]:
        """Own rows and keys of all pairs of neighbours of one body, in ascending order."""
        support = 2.0 * self._size.max()
        plan = exchange.ghosts(c["position"], c["id"], support)
        state = np.column_stack([c["mass"], c["density"], c["h"]])
        given = [(c["position"], "position"), (state, ((),) * 3), (c["body"], ((),))]
        position, state, body = plan.exchange(given)
        self._search.find(plan.own, position, state, plan.key, support)
        first, place = np.nonzero(np.arange(self._search.table.shape[1]) < self._search.count[:, None])
        second = self._search.table[first, place]
        self._through = self._through_planes(c, exchange)
        bonded = self._side(body, plan.key)[second] == body[first]
        first, key = first[bonded], plan.key[second[bonded]]
        order = np.lexsort((key, first))
        return first[order], key[order]

    def _through_planes(self, c: dict[str, np.ndarray], exchange: ParticleExchange) -> np.ndarray:
        """(bodies,) the axes, as bits, along which a body goes on behind a symmetry plane."""
        touching = np.zeros((len(self._spacing), self._dimensions))
        for axis, place in exchange.planes():
            close = np.abs(c["position"][:, axis] - place) < ON_THE_PLANE * self._spacing[c["body"]]
            touching[c["body"][close], axis] = 1.0
        touching = self._communicator.maximum(touching.ravel()).reshape(touching.shape)
        return (touching.astype(np.int64) << np.arange(self._dimensions)).sum(axis=1)

    def _side(self, body: np.ndarray, key: np.ndarray) -> np.ndarray:
        """(n,) numbers of the bodies of particles and images; an image at a plane where its body ends is another's."""
        return body + len(self._through) * (key % IMAGES & ~self._through[body] > 0)

    def _place(self, c: dict[str, np.ndarray], key: np.ndarray, reference: np.ndarray, volume: np.ndarray) -> None:
        """Find the partners' rows, the vectors and the weights of the bonds, if the rows have changed since."""
        self._reference = reference
        if self._key is not None and np.array_equal(key, self._key):
            return
        self._key = key
        self._partner = self._rows_of_partners(c, key)
        if (self._partner < 0).any():
            raise Diverged("solid: the partner of a bond is not at hand")
        n, width = c["bonds"].shape
        self._bond = np.empty((n, width * (self._dimensions + 1)))
        bonds = (c["bond_count"], self._partner, self._bond)
        self._run(n, "weigh", reference, volume, self._size, c["body"], *bonds)

    def _rows_of_partners(self, c: dict[str, np.ndarray], key: np.ndarray) -> np.ndarray:
        """(n, width) where the partners' keys stand in `key`; -1: nowhere."""
        order = np.argsort(key, kind="stable")
        partner = np.zeros(c["bonds"].shape, dtype=np.int32)
        self._run(len(partner), "find_partners", c["bonds"], c["bond_count"], key[order], order, partner)
        return partner

    def _fit(self, rows: np.ndarray, c: dict[str, np.ndarray], displacement: np.ndarray) -> tuple[np.ndarray, ...]:
        """Gradient correction, deformation gradient (rows, D D) and moments (rows, 2) of kernels/bonds.py."""
        fitted = (*np.empty((2, len(rows), self._dimensions**2)), np.empty((len(rows), 2)))
        bonds = (c["bond_count"], self._partner, self._bond)
        self._run(len(rows), "fit", rows, *bonds, self._reference, displacement, *fitted)
        return fitted

    def _run(self, count: int, kernel: str, *arguments) -> None:
        self._team.run(getattr(self._kernels, kernel), count, *arguments)

    # ---- a step -----------------------------------------------------------------------------------------------------

    def asked(self, c: dict[str, np.ndarray]) -> np.ndarray:
        """Keys of the partners that are not among this rank's particles."""
        if c["id"] is not self._ids:
            self._ids, self._key = c["id"], None
            self._asked = np.unique(c["bonds"][self._rows_of_partners(c, c["id"] * IMAGES) < 0])
        return self._asked

    def flags(self, c: dict[str, np.ndarray]) -> list[float]:
        """Whether any particle has failed, is loose or debris."""
        return [float(self._failed(c).any() or c["loose"].any() or (c["bond_count"] == 0).any())]

    @staticmethod
    def _failed(c: dict[str, np.ndarray]) -> np.ndarray:
        """(n,) whether the material has failed."""
        return c["damage"] >= 1.0 if "damage" in c else np.zeros(len(c["id"]), dtype=bool)

    def told(self, c: dict[str, np.ndarray]) -> list:
        """Reference position; stiffness, displacement and bond stress; the columns VOLUME to DEBRIS."""
        axes = range(self._dimensions)
        parity = ((), *((a,) for a in axes), *((a, b) for a in axes for b in axes))
        facts = (c["volume"], c["body"], self._failed(c), c["loose"], c["exposed"], c["bond_count"] == 0)
        return [(c["reference"], "position"), (self._tension(c), parity), (np.column_stack(facts), ((),) * len(facts))]

    def _tension(self, c: dict[str, np.ndarray]) -> np.ndarray:
        """(own, 1 + D + D D) what a bond's force needs of a particle, see kernels/bonds.py."""
        D, n = self._dimensions, len(c["id"])
        tension = np.empty((n, 1 + D + D * D))
        material = [c[name] for name in MATERIAL]
        material += [c["correction"], c["deformation"], c.get("damage", np.empty(0))]
        self._run(n, "stress_bonds", c["body"], self._strength, *material, tension)
        tension[c["loose"] > 0] = 0.0  # its bonds no longer determine its strain
        tension[:, 1 : 1 + D] = c["position"] - c["reference"]
        return tension

    def accelerate(self, c: dict[str, np.ndarray], near: Near, acceleration: np.ndarray, limits: np.ndarray) -> None:
        """Collective. Cut bonds that have failed; write the `acceleration` (own, D) of all forces, and the time steps
        (own, 2) that they allow."""
        reference, self._tensions, facts = near.told
        self._place(c, near.plan.key, reference, np.ascontiguousarray(facts[:, VOLUME]))
        acceleration[:] = 0.0
        if near.flags[0]:
            self._cut(c, near, facts)
            _, self._tensions, facts = near.plan.exchange(self.told(c))
            self._debris.push_debris(c, near, np.flatnonzero(facts[:, DEBRIS]), acceleration, limits)
        bonds = (c["bond_count"], self._partner, self._bond)
        self._run(near.own, "pull", *bonds, self._tensions, c["volume"], c["mass"], acceleration)
        marks = facts[:, [BODY, EXPOSED, DEBRIS]].astype(np.int64)
        marks[:, 0] = self._side(marks[:, 0], near.plan.key)
        self._contact.find(near, reference, marks, c["bonds"])
        self._contact.accelerate(c["mass"], acceleration)
        material = [c[name] for name in ("body", "sound_speed", "viscous_pressure", "density", "deformation")]
        self._run(near.own, "bound", c["bond_count"], self._size, *material, acceleration, limits)

    def _cut(self, c: dict[str, np.ndarray], near: Near, facts: np.ndarray) -> None:
        """Cut bonds and fit what is left; a particle that too few bonds hold gets loose for the next step."""
        marks = [np.ascontiguousarray(facts[:, column]) for column in (FAILED, LOOSE)]
        bonds = (c["bonds"], c["bond_count"], self._partner, self._bond)
        lost = np.empty(near.own, dtype=np.int64)
        self._run(near.own, "cut", near.position, self._reference, *marks, *bonds, lost)
        rows = np.flatnonzero(lost)
        displacement = np.ascontiguousarray(self._tensions[:, 1 : 1 + self._dimensions])
        correction, deformation, moments = self._fit(rows, c, displacement)
        held = moments[:, 1] > LOOSE_BELOW
        c["correction"][rows[held]], c["deformation"][rows[held]] = correction[held], deformation[held]
        c["loose"][rows[~held]] = 1
        c["exposed"][rows[~(moments[:, 0] >= EXPOSED_BELOW)]] = 1
        if len(rows):
            self._contact.forget()
            self._cut_since_labelled = True

    def strain(
        self, c: dict[str, np.ndarray], near: Near, dt: float, velocity: np.ndarray, gradient: np.ndarray
    ) -> None:
        """Advance energy and deformation by `dt` [s] with the old and the new `velocity` (count, D), and write the
        velocity gradient (own, D D) [1/s]; after accelerate()."""
        gradient[:] = 0.0
        if near.flags[0]:
            self._debris.strain(c, near, dt, velocity, gradient)
        before = near.state[:, VELOCITY : VELOCITY + self._dimensions]
        motion = np.hstack([0.5 * (before + velocity), velocity])
        bonds = (c["bond_count"], self._partner, self._bond)
        material = [c[name] for name in ("volume", "mass", "correction", "h", "density", "sound_speed")]
        changed = [c[name] for name in ("deformation", "energy", "viscous_pressure")]
        self._run(near.own, "stretch", dt, *bonds, self._tensions, motion, *material, *changed, gradient, c["loose"])
        self._contact.heat(c["mass"], dt, motion, c["energy"])
        if near.flags[0] and dt > 0.0:
            self._open_voids(c, dt, gradient)

    def _open_voids(self, c: dict[str, np.ndarray], dt: float, gradient: np.ndarray) -> None:
        """Failed particles do not swell: what their surroundings give way is void, and must close again first."""
        D = self._dimensions
        rows = np.flatnonzero(self._failed(c) | (c["bond_count"] == 0))
        divergence = np.einsum("iaa->i", gradient[rows].reshape(-1, D, D))
        swollen = np.log(c["mass"][rows] / (c["volume"][rows] * c["density"][rows]))
        whole = swollen + c["void"][rows] + dt * divergence
        solid = np.minimum(whole, 0.0)
        c["void"][rows] = whole - solid
        gradient[rows] += (((solid - swollen) / dt - divergence) / D)[:, None] * np.eye(D).ravel()
