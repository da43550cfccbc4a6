"""The total Lagrangian form: bonds between the neighbours of the reference state, contact, and debris.

A particle whose bonds are gone is debris: from then on the updated Lagrangian form moves it among other debris of
its body, with the state it had. So it moves bodies beside the bonded ones whose form it is. Bodies meet in contact.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.kernels.particles import IMAGES
from distfsi.mesh.particles import Parity, ParticleExchange
from distfsi.narrowing import present
from distfsi.scene.description import Solid
from distfsi.solid import bonds, pieces, self_contact
from distfsi.solid.bonds import BondNetwork, chunks_of
from distfsi.solid.kernels import bonds as kernels
from distfsi.solid.kernels import cracks, motion
from distfsi.solid.kernels.records import (
    CRACK,
    RIGID,
    BondedMaterial,
    BondedPoint,
    Bonds,
    Cohesion,
    Fit,
    StrainResult,
    Volumes,
)
from distfsi.solid.material_points import MaterialGroups
from distfsi.solid.neighbours import Near, NeighbourSearch
from distfsi.solid.self_contact import SelfContact
from distfsi.solid.sides import Sides
from distfsi.solid.updated import Carried, UpdatedLagrangian

DRIVERS = (
    *bonds.DRIVERS,
    cracks.mark_breaking,
    cracks.mark_cut,
    cracks.mark_damaged,
    cracks.mark_unbonded,
    cracks.spread_damage,
    cracks.find_cracks,
    cracks.cut_bonds,
    kernels.pack_payload,
    kernels.pack_bond_state,
    kernels.accelerate_bonds,
    kernels.strain_bonds,
    kernels.limit_bonds,
    motion.pack_motion,
    cracks.carry_unbonded,
    cracks.keep_rates,
    *self_contact.DRIVERS,
)


class TotalLagrangian:
    """Bonds of this rank's particles. Columns of the solid that belong to it:

    reference            (n, D) position in the reference state [m]
    volume               (n,) volume in the reference state [m^D]
    bonds                (n, width) keys of the partners in ascending order, -1 for none; bond_count (n,)
    correction           (n, D D) gradient correction; deformation (n, D D) deformation gradient, by rows
    viscous_pressure     (n,) [Pa]
    rupture_length       (n,) length of the shortest bond that was cut, when it was cut [m]
    void                 (n,) logarithm of how much larger a failed particle is with its void
    piece                (n,) smallest id of all particles that intact bonds hold together, as of label_pieces()
    neighbourhood_damage (n,) largest damage of the particle and its partners so far
    crack                (n, D) vector, in the reference state, to the plane of the crack beside it [m]; 0: none
    detaching            (n,) 1 when the particle leaves its bonds in the next step
    exposed              (n,) 1 when it lies at a surface
    velocity_gradient    (n, D D) that of the last step [1/s], of particles of bodies in the updated form, if there are
                         such; their bond_count is NEVER_BONDED, or RIGID, and their piece -1
    """

    def __init__(
        self,
        kernels: SimpleNamespace,
        exchange: ParticleExchange,
        search: NeighbourSearch,
        communicator: Communicator,
        scene: Solid,
        materials: MaterialGroups,
        sides: Sides,
        dimensions: int,
    ):
        self._kernels, self._rows, self._device = kernels, exchange.rows, exchange.device
        self._communicator, self._materials, self._dimensions = communicator, materials, dimensions
        self._network = BondNetwork(kernels, exchange, search, communicator, scene, sides)
        self._mixed = any(scene.form_of(body) == "updated_lagrangian" for body in scene.bodies)
        repels = scene.artificial_stress > 0.0
        self._unbonded = UpdatedLagrangian(kernels, self._device, search, sides, dimensions, repels)
        self._self_contact = SelfContact(kernels, self._rows, search, sides, dimensions)
        self._cut_since_labelled = True
        self._bonds: Bonds | None = None  # of the last accelerate(), and the packed state of its bonds
        self._bond_state: Any = None

    # ---- the reference state ----------------------------------------------------------------------------------------

    def bind(self, c: Columns, exchange: ParticleExchange) -> None:
        """Collective. Make the bonds of the particles where they are now, and add the columns."""
        n, D, device, network = len(c["id"]), self._dimensions, self._device, self._network
        c["reference"], c["volume"] = c["position"].copy(), c["mass"] / c["density"]
        network.make(c, exchange)
        c["viscous_pressure"], c["void"], c["neighbourhood_damage"] = np.zeros(n), np.zeros(n), np.zeros(n)
        c["crack"], c["rupture_length"] = np.zeros((n, D)), np.full(n, network.support)
        c["detaching"] = np.zeros(n, dtype=np.int64)
        if self._mixed:
            self._unbonded.bind(c, exchange)
        # Fit the bonds to no displacement.
        (position,) = c.read("position")
        plan = exchange.ghosts(position, c["id"], network.support, self.requested_keys(c))
        volume = device.array(np.ascontiguousarray(c["volume"][:, None]))
        reference, volume = plan.exchange([(*c.read("reference"), "position"), (volume, ((),))])
        bonds = network.find(c, plan.key, reference, volume)
        at_rest = device.zeros((plan.count, 1 + D))
        fit, moments = network.fit(n, device.array(np.arange(n)), bonds, reference, at_rest)
        c.adopt("correction", fit.correction)
        c.adopt("deformation", fit.deformation)
        exposed = device.download(moments)[:, 0] < kernels.EXPOSED_BELOW
        c["exposed"] = (exposed & (c["bond_count"] != RIGID)).astype(np.int64)
        self.label_pieces(c, exchange)

    def resume(self) -> None:
        """Bonds may have been cut since the pieces were labelled."""
        self._cut_since_labelled = True

    def label_pieces(self, c: Columns, exchange: ParticleExchange) -> None:
        """Collective. Bring the labels of the pieces up to date."""
        if self._communicator.maximum(np.array([self._cut_since_labelled]))[0] == 0.0:
            return
        self._cut_since_labelled = False
        (position,) = c.read("position")
        plan = exchange.ghosts(position, c["id"], 0.0, self.requested_keys(c))
        id = plan.key.host[plan.key.host % IMAGES == 0] // IMAGES
        order = np.argsort(id, kind="stable")
        links = [np.empty((2, 0), dtype=np.int64)]
        for begin, partners in chunks_of(c["bonds"]):
            first, index = np.nonzero(partners >= 0)
            second = order[np.searchsorted(id, partners[first, index] // IMAGES, sorter=order)]
            links.append(np.stack([begin + first, second])[:, begin + first < second])  # each bond once
        found = pieces.label(id, np.concatenate(links, axis=1), plan, self._device, self._communicator)
        c["piece"] = np.where(c["bond_count"] < 0, -1, found)

    # ---- what ghosts must know ---------------------------------------------------------------------------------------

    def requested_keys(self, c: Columns) -> np.ndarray:
        """Keys of the partners that are not among this rank's particles."""
        return self._network.requested_keys(c)

    def flags(self, c: Columns) -> list[float]:
        """Whether any particle is damaged; whether any has failed, detaches or is debris."""
        bond_count, detaching = c.read("bond_count", "detaching")
        n = bond_count.shape[0]
        mark = self._device.empty(n, np.int8)
        self._run(n, "mark_breaking", bond_count, detaching, self._damage(c), mark)
        breaking = self._rows.any(mark)
        if "damage" not in c:
            return [0.0, float(breaking)]
        self._run(n, "mark_damaged", *c.read("damage"), mark)
        return [float(self._rows.any(mark)), float(breaking)]

    def ghost_payload(self, c: Columns) -> list[tuple[Any, Parity]]:
        """Reference position, packed state of the bonds and payload, the latter two with the columns of
        solid/kernels/records.py."""
        axes, D, n = range(self._dimensions), self._dimensions, c.read("id")[0].shape[0]
        vector = tuple((a,) for a in axes)
        parity = ((), *vector, *((a, b) for a in axes for b in axes))
        bond_state, payload = self._device.empty((n, 1 + D + D * D)), self._device.empty((n, CRACK + D))
        cohesion = Cohesion(*c.read(*Cohesion._fields))
        shape = (Fit(*c.read("correction", "deformation")), *c.read("position", "reference"), cohesion)
        self._run(n, "pack_bond_state", self._materials.rest, self._material(c), *shape, bond_state)
        known = (*c.read("volume", "body"), cohesion, *c.read("deformation"), self._damage(c))
        self._run(n, "pack_payload", *known, payload)
        given = [(*c.read("reference"), "position"), (bond_state, parity), (payload, (*((),) * CRACK, *vector))]
        return given + (self._unbonded.ghost_payload(c) if self._mixed else [])

    def _damage(self, c: Columns) -> Any:
        return c.read("damage")[0] if "damage" in c else self._device.empty(0)

    def _material(self, c: Columns) -> BondedMaterial:
        strain = c.read("plastic_strain")[0] if "plastic_strain" in c else self._device.empty(0)
        body, density, sound_speed = c.read("body", "density", "sound_speed")
        return BondedMaterial(body, density, sound_speed, strain, *c.read("deviator", "pressure", "viscous_pressure"))

    # ---- a step -----------------------------------------------------------------------------------------------------

    def accelerate(self, c: Columns, near: Near, acceleration: Any, limits: Any) -> None:
        """Collective. Cut bonds that have failed; add the `acceleration` (own, D) of all forces to none, and write the
        time steps (own, 2) that they allow."""
        reference, bond_state, payload, *rates = near.payload
        bonds = self._network.find(c, near.plan.key, reference, payload)
        damaged, breaking = near.flags
        if damaged:
            self._run(near.own, "spread_damage", bonds, payload, *c.write("neighbourhood_damage"))
        if breaking:
            self._cut(c, near, bonds)
            _, bond_state, payload, *rates = near.plan.exchange(self.ghost_payload(c))
        if breaking or self._mixed:
            mark = self._device.empty(near.plan.count, np.int8)
            self._run(near.plan.count, "mark_unbonded", payload, mark)
            carried = self._carried(c, near, rates)
            self._unbonded.accelerate_among(near, self._rows.marked(mark)[1], carried, acceleration, limits)
        volume, mass = c.read("volume", "mass")
        self._run(near.own, "accelerate_bonds", bonds, bond_state, volume, mass, acceleration)
        self._self_contact.find(c, near, reference, payload)
        self._self_contact.accelerate(mass, acceleration)
        given = (self._material(c), *c.read("deformation"), acceleration, *c.write("detaching"), limits)
        self._run(near.own, "limit_bonds", bonds.count, self._network.bodies, *given)
        self._bonds, self._bond_state = bonds, bond_state

    def _carried(self, c: Columns, near: Near, rates: list[Any]) -> Carried:
        """What particles without bonds act on each other with; `rates`: their velocity gradients if any has one."""
        D, (pressure, deviator) = self._dimensions, c.read("pressure", "deviator")
        found = rates[0] if rates else self._device.zeros((near.plan.count, D * D))
        carried = Carried(found, self._device.empty(near.own), self._device.empty(deviator.shape))
        self._run(near.own, "carry_unbonded", *c.read("bond_count"), pressure, deviator, *carried[1:])
        return carried

    def _cut(self, c: Columns, near: Near, bonds: Bonds) -> None:
        """Cut bonds and fit what is left; a particle that too few bonds hold detaches in the next step."""
        lost, mark = self._device.empty(near.own, np.int64), self._device.empty(near.own, np.int8)
        sizes = (self._network.bodies, *c.read("body"))
        reference, bond_state, payload, *_ = near.payload
        # Planes of cracks beside the particles that are damaged.
        if "damage" in c:
            known = (*c.read("deformation", "damage"), payload, *c.write("crack"))
            self._run(near.own, "find_cracks", *sizes, bonds, reference, bond_state, *known)
        # Bonds that cross them.
        key, count = c.write("bonds", "bond_count")
        given = (near.position, reference, *sizes, payload, key, bonds._replace(count=count))
        self._run(near.own, "cut_bonds", *given, *c.write("rupture_length"), lost)
        # What the other bonds of their ends tell.
        self._run(near.own, "mark_cut", lost, mark)
        count, rows = self._rows.marked(mark)
        if not count:
            return
        found, moments = self._network.fit(count, rows, bonds, reference, bond_state)
        volumes = Volumes(*c.read(*Volumes._fields))
        kept = (Fit(*c.write("correction", "deformation")), *c.write("detaching", "exposed"))
        self._run(count, "accept_fit", rows, found, moments, volumes, *kept)
        self._self_contact.forget()
        self._cut_since_labelled = True

    def strain(self, c: Columns, near: Near, dt: float, velocity: Any, gradient: Any) -> None:
        """Advance energy and deformation by `dt` [s] with the old and the new `velocity` (count, D), and write the
        velocity gradient (own, D D) [1/s]; after accelerate()."""
        breaking = near.flags[1]
        if breaking or self._mixed:
            self._unbonded.strain_among(c, near, dt, velocity, gradient)
        if self._mixed:
            self._run(near.own, "keep_rates", *c.read("bond_count"), gradient, *c.write("velocity_gradient"))
        motion = self._device.empty((near.plan.count, 2 * self._dimensions))
        self._run(near.plan.count, "pack_motion", near.state, velocity, motion)
        point = BondedPoint(*c.read(*BondedPoint._fields))
        fit = Fit(*c.read("correction"), *c.write("deformation"))
        energy, viscous_pressure, detaching = c.write("energy", "viscous_pressure", "detaching")
        result = StrainResult(energy, viscous_pressure, gradient, detaching)
        self._run(near.own, "strain_bonds", dt, self._bonds, self._bond_state, motion, point, fit, result)
        (mass,), (energy,) = c.read("mass"), c.write("energy")
        self._self_contact.heat(mass, dt, motion, energy)
        if breaking and dt > 0.0:
            self._materials.open_voids(c, dt, present(self._bonds).count, gradient)

    def _run(self, count: int, kernel: str, *arguments: Any) -> None:
        self._device.run(getattr(self._kernels, kernel), count, *arguments)
