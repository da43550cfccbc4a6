"""The solid: smoothed particles, their motion and their budget (paper, Sec. 2.1 and Appendix A).

How particles of a body act on each other is a matter of its form: updated.py, total_lagrangian.py; how bodies do, of
contact.py. A step needs three to five messages per pair of ranks that are neighbours: who needs whom, the state, in the
updated form the corrected stress, where bodies meet their pressure, the new velocity. Time integration is leapfrog:
forces at x^n take v^(n-1/2) to v^(n+1/2), which strains and moves the particles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from distfsi.device.emit import plain
from distfsi.device.interface import Columns, Device, DualArray
from distfsi.errors import Diverged
from distfsi.laws.body_force import BodyForce
from distfsi.mesh.blocks import Blocks, Snapshot
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.kernels import particles as particle_kernels
from distfsi.mesh.kernels import rows as row_kernels
from distfsi.mesh.particles import ParticleExchange
from distfsi.mesh.rows import Groups
from distfsi.narrowing import present
from distfsi.scene.description import Scene
from distfsi.solid import contact, fields, neighbours, open_ends, total_lagrangian, updated, walls
from distfsi.solid.contact import Contact
from distfsi.solid.formulas.stress import von_mises
from distfsi.solid.interactions import contacts_of, form_of
from distfsi.solid.kernels import motion
from distfsi.solid.kernels.records import VELOCITY
from distfsi.solid.material_points import MaterialGroups
from distfsi.solid.materials import Materials
from distfsi.solid.neighbours import Near
from distfsi.solid.open_ends import OpenEnds
from distfsi.solid.packed import packed
from distfsi.solid.periodic import PeriodicEnds
from distfsi.solid.protocol import SolidForm
from distfsi.solid.sides import Sides
from distfsi.solid.totals import Totals
from distfsi.solid.walls import Walls

DRIVERS = (
    *particle_kernels.EXCHANGE,
    *neighbours.DRIVERS,
    *row_kernels.REDUCTIONS,
    motion.pack_state,
    motion.kick,
    motion.apply_impulse,
    motion.average_velocity,
    motion.move,
    *updated.DRIVERS,
    *total_lagrangian.DRIVERS,
    *contact.DRIVERS,
    *walls.DRIVERS,
    *open_ends.DRIVERS,
)
LIMITS = ("sound", "acceleration")  # what bounds the time step, columns of `_limits`


class Solid(Totals):
    """All particles of this rank. A step is prepare(), time_step(), advance(dt), apply_impulse(impulse), migrate(); of
    these a sub-step is the first three.

    columns  this rank's particles on host and device, in any order: id, body, fixed (n,), position [m],
             velocity [m/s] (n, D), mass [kg], h [m], density [kg/m3], energy [J/kg] (specific, internal), and what the
             materials remember (solid/materials.py): deviator (n, D(D+1)/2) [Pa], pressure [Pa], sound_speed [m/s],
             damage (n,) … Velocities belong to half a step before the positions.
    start    (own, D) [m] positions when the step began, on the device
    before   (own, D) [m/s] velocities then, on the device
    carried  (own, D) [m/s] mean velocity since then, on the device
    sub_steps  that have been made since then
    body_force  that of the sources, over the sub-step
    work     (local blocks,) work [J] of the last step's external impulse
    given    (local blocks, bodies, D) impulse [N s] that the fluid gave to each body in the last step
    stands   whether no particle ever moves
    """

    stands = False

    def __init__(self, scene: Scene, blocks: Blocks, communicator: Communicator, device: Device):
        self.blocks, self.communicator, self.device = blocks, communicator, device
        self.dimensions = D = scene.domain.dimensions
        self._scene = solid = present(scene.solid)
        self.materials = Materials(solid, D)
        self._vector = tuple((a,) for a in range(D))  # the axes whose reflection changes the sign of each component
        self.body_force = BodyForce(scene.sources, D)
        constants = self._constants()
        self.kernels = device.build(DRIVERS, constants)
        self._points = MaterialGroups(self.materials, device, constants)
        self._von_mises = plain(von_mises, constants)
        self.exchange = ParticleExchange(blocks, device, self.kernels)
        self._open = OpenEnds(self.kernels, device, communicator, scene.domain)
        self._rigid = np.array([body.motion is not None for body in solid.bodies])
        self._periodic = PeriodicEnds(self.kernels, device, communicator, scene.domain)
        self._support = 2.0 * solid.smoothing * max(body.spacing for body in solid.bodies)  # at the start [m]
        # Sums over all steps, and of the last one.
        self._boundary_impulse = np.zeros((blocks.local_count, D))
        self._gravity_work = np.zeros(blocks.local_count)
        self.work = np.zeros(blocks.local_count)
        self.given = np.zeros((blocks.local_count, len(solid.bodies), D))
        # What prepare() finds.
        self._near: Near | None = None
        self._acceleration, self._limits = device.empty((0, D)), device.empty((0, len(LIMITS)))
        self.start, self.before, self.carried = (device.empty((0, D)) for _ in range(3))
        self.sub_steps = 0
        self._shown: list[str] = []  # columns of others that field files show
        # What migrate() finds: the block of each particle, and the particles by block, body and id.
        self._home: DualArray | None = None
        self._block = self._order = np.empty(0, dtype=np.int64)
        self._groups: Groups | None = None
        # The particles of this rank's blocks.
        c = self._own_particles(scene)
        self.columns = Columns(device, c | self.materials.initial(c["body"], c["id"], c["mass"] / c["density"]))
        self.migrate()
        self.form, self._contacts = self._begin(scene)
        self._walls = next((met for met in self._contacts if isinstance(met, Walls)), None)

    def _begin(self, scene: Scene) -> tuple[SolidForm, Sequence[Contact | Walls]]:
        """Collective. What materials and bonds find before the first step; how particles act on each other, and what
        bodies run into."""
        self._points.deform(self.columns, 0.0, self.device.zeros((self.count, self.dimensions**2)))
        self.sides = sides = Sides(self._scene, self.columns, self.exchange, self.communicator)
        given = (scene, self.kernels, self.exchange, self.communicator)
        form, contacts = form_of(*given, self._points, sides), contacts_of(*given, sides)
        form.bind(self.columns, self.exchange)
        for met in contacts:
            met.bind(self.columns)
        return form, contacts

    def _constants(self) -> dict[str, object]:
        """What the kernels are specialised for."""
        solid, D = self._scene, self.dimensions
        return {
            "DIMENSIONS": D,
            "COMPONENTS": D * (D + 1) // 2,
            "BODY_FORCE": self.body_force.acceleration,
            "VISCOSITY_ALPHA": solid.viscosity_alpha,
            "VISCOSITY_BETA": solid.viscosity_beta,
            "SMOOTHING_RATIO": solid.smoothing,
            "ARTIFICIAL_STRESS": solid.artificial_stress,
            "FRICTION": solid.friction,
            "WALL_FRICTION": solid.wall_friction,
            "ZERO_ENERGY": solid.zero_energy,
        } | self.materials.constants

    def _own_particles(self, scene: Scene) -> dict[str, np.ndarray]:
        """The columns of the particles in this rank's blocks."""
        columns = packed(scene)
        mine = self.blocks.owners[self.blocks.block_of(columns["position"])] == self.communicator.rank
        return {name: column[mine] for name, column in columns.items()}

    # ---- the step ---------------------------------------------------------------------------------------------------

    def prepare(self, reach: float = 0.0, stray: float = 0.0, goes_on: bool = False) -> None:
        """Collective. Bring in ghosts and images, find neighbours, and compute the forces between particles.

        `around` then holds all particles within `reach` [m], or farther, of this rank's blocks. `goes_on`: a step that
        has begun goes on with another sub-step; `stray` [m]: how far particles go between two calls of migrate(), if
        there are such. What has left the domain is let go before a step. Raises Diverged on all ranks when a smoothing
        length is not finite.
        """
        c, device = self.columns, self.device
        passed = np.empty(0, dtype=np.int64)
        if self._open.there and not goes_on:
            passed = self._open.passed(c, max(reach, self._support))
            passed = passed[~self._rigid[c["body"][passed]]]  # these go on: all of a body, or nothing, moves
        (h,) = c.read("h")
        largest = self.exchange.rows.largest(h, 0.0)
        maxima = self.communicator.maximum(np.array([largest, len(passed), *self.form.flags(c)]))
        support, flags = 2.0 * maxima[0] or self._support, maxima[2:]
        if not np.isfinite(support):
            raise Diverged("solid: a smoothing length is not finite")
        if maxima[1]:
            self._let_go(passed)
        own = self.count
        state, parity = device.empty((own, VELOCITY + self.dimensions)), ((),) * VELOCITY
        device.run(self.kernels.pack_state, own, *c.read("mass", "density", "h", "sound_speed", "velocity"), state)
        (now,) = c.read("position")
        if not goes_on:
            self.start, self.sub_steps = now, 0
            self.before, self.carried = (device.zeros((own, self.dimensions)) for _ in range(2))
            self._run(self.kernels.average_velocity, 1, *c.read("velocity"), self.before)
        reach = max(reach, support, *(met.widening * support for met in self._contacts))
        plan = self.exchange.ghosts(now, c["id"], reach + stray, self.form.requested_keys(c), image_reach=reach)
        given = [(now, "position"), (state, parity + self._vector), *self.form.ghost_payload(c)]
        position, state, *payload = plan.exchange(given)
        self._near = Near(plan, position, state, support, payload, flags)
        self._acceleration = device.zeros((own, self.dimensions))
        self._limits = device.empty((own, len(LIMITS)))
        for met in self._contacts:
            met.accelerate(c, self._near, self._acceleration)
        self.form.accelerate(c, self._near, self._acceleration, self._limits)

    def time_step(self) -> tuple[float, str]:
        """Longest stable step [s] of this rank's particles (NaN: none is) and what bounds it, with the particle, its
        body and place; after prepare(). Of particles with the same step the first by block, body and id is named."""
        if self.count == 0:
            return np.inf, "solid"
        rows = self.exchange.rows
        dt, index = rows.minimum(rows.taken(self._limits, present(self._groups).rows).reshape(-1))
        particle, cause = divmod(index, len(LIMITS))
        dt = float(dt)
        return dt if dt > 0.0 else np.nan, f"{LIMITS[cause]} of {self._name(self._order[particle])}"

    def _name(self, row: int) -> str:
        """Words for the particle in a row: its number, body and place."""
        c, (position,) = self.columns, self.columns.read("position")
        (x,) = self.device.download(self.exchange.rows.taken(position, self.device.array(np.array([row]))))
        body = self._scene.bodies[c["body"][row]].name
        return f"solid particle {c['id'][row]} of body '{body}' at ({', '.join(f'{at:.6g}' for at in x)}) m"

    def advance(self, dt: float) -> None:
        """Collective, after prepare(). Advance by `dt` [s]: velocities first, then positions.

        The energy takes the mean of old and new velocities: kinetic plus internal energy grow by the work of gravity.
        """
        self.kick(dt)
        self.drift(dt)

    def kick(self, dt: float) -> None:
        """After prepare(). Give the particles the velocities after `dt` [s] of the forces between them and gravity."""
        c, budget = self.columns, self.device.empty((self.count, 1 + self.dimensions))
        given = (*c.read("mass", "fixed"), self._acceleration, *c.write("velocity"), budget)
        self._run(self.kernels.kick, dt, *given)
        sums = self._per_body(budget).sum(axis=1)
        self._gravity_work += sums[:, motion.WORK]
        self._boundary_impulse += sums[:, motion.IMPULSE :]
        if self._walls:
            self._walls.account(dt, lambda load: self._per_body(load).sum(axis=1))

    def drift(self, dt: float) -> None:
        """Collective, after kick(). Strain and move the particles by `dt` [s] of their new velocities."""
        c, device, D = self.columns, self.device, self.dimensions
        (velocity,) = c.read("velocity")
        (around,) = self.around.plan.exchange([(velocity, self._vector)])
        gradient = device.zeros((self.count, D**2))
        self.form.strain(c, self.around, dt, around, gradient)
        for met in self._contacts:
            met.heat(c, self.around, dt, around)
        self._points.deform(c, dt, gradient)
        moved = device.empty((self.count, D))
        going = self._going(dt)
        self._run(self.kernels.move, dt, going, *c.read("position"), moved)
        c.adopt("position", moved)
        self.sub_steps += 1
        self._run(self.kernels.average_velocity, self.sub_steps, going, self.carried)

    def _going(self, dt: float) -> Any:
        """The velocity (own, D) [m/s] with which particles go on for `dt` [s]."""
        return self.columns.read("velocity")[0]

    def apply_impulse(self, impulse: Any) -> Any:
        """After advance() and before migrate(). The fluid gives `impulse` (own, D) [N s], an array of the device.

        Returns by how much (own, D) [m/s], another one, the velocity at which the impulse works on each particle, the
        mean of before and after, exceeds the one that carried it.
        """
        c, device, D = self.columns, self.device, self.dimensions
        excess, budget = device.empty((self.count, D)), device.empty((self.count, 2 + D))
        given = (*c.read("mass", "fixed"), self.carried, *c.write("velocity"), excess, budget)
        self._run(self.kernels.apply_impulse, impulse, *given)
        sums = self._per_body(budget).sum(axis=1)
        self.work, self.given = sums[:, 0], self._per_body(impulse)
        self._gravity_work += sums[:, 1]
        self._boundary_impulse += sums[:, 2:]
        return excess

    def bear(self, impulse: Any) -> None:
        """As apply_impulse(), of a load from outside: impulse and work count as given to the solid."""
        self.apply_impulse(impulse)
        self._gravity_work += self.work
        self._boundary_impulse += self.given.sum(axis=1)

    def share_push(self, mass: Any, gained: Any, impulse: Any, shared: Any) -> tuple[Any, Any]:
        """See solid/protocol.py: each particle has shared for itself."""
        return impulse, shared

    def migrate(self) -> None:
        """Collective. Carry round what is beyond periodic ends, and give the particles that left this rank's blocks to
        their new owners."""
        if self._periodic.there and self._periodic.passed(self.columns):
            self.label_pieces()
            self._periodic.carry(self.columns)
        home = self.exchange.migrate(self.columns, self._home)
        if home is not self._home:
            self._settle(home)

    def _let_go(self, passed: np.ndarray) -> None:
        """Collective. Of the rows that have `passed` an end forget those that have left; what they carry has left."""
        self.label_pieces()
        left = self._open.left(self.columns, passed)
        if not len(left):
            return
        c, gone = self.columns, np.zeros((self.count, 1))
        gone[left] = 1.0
        mass, velocity = gone * c["mass"][:, None], c["velocity"]
        energy = mass * (0.5 * (velocity**2).sum(axis=1, keepdims=True) + c["energy"][:, None])
        sums = self._per_body(self.device.array(np.hstack([energy, mass * velocity]))).sum(axis=1)
        self._gravity_work -= sums[:, 0]
        self._boundary_impulse -= sums[:, 1:]
        home, stays = present(self._home).host(), np.flatnonzero(gone == 0.0)
        rows = self.device.array(stays)
        for name in c:
            c.adopt(name, self.exchange.rows.taken(c.read(name)[0], rows))
        self._settle(DualArray(self.device, home[stays]))

    def _settle(self, home: DualArray) -> None:
        """Particles have come or gone: `home` (own,) are their blocks now."""
        self._home, bodies = home, self.given.shape[1]
        self._points.select(self.columns["body"])
        self._block = home.host() - self.blocks.first
        group = self._block * bodies + self.columns["body"]
        self._order = np.lexsort((self.columns["id"], group))
        sizes = np.bincount(group, minlength=self.blocks.local_count * bodies)
        self._groups = Groups(self.device, self.kernels, sizes, self._order)

    def attach_column(self, name: str, values: np.ndarray, shown: bool) -> None:
        """A column (own, …) of a coupling's own: it goes with the particles to other ranks and into restart files, and
        into field files if it is `shown`."""
        self.columns[name] = values
        if shown:
            self._shown.append(name)

    def _run(self, kernel: Any, *arguments: Any) -> None:
        self.device.run(kernel, self.count, *arguments)

    # ---- state and output -------------------------------------------------------------------------------------------

    @property
    def around(self) -> Near:
        """Own particles, ghosts and images as of prepare()."""
        return present(self._near)

    def check(self, time: float) -> None:
        """Raise Diverged, naming the particle, if one of this rank has no valid state at `time` [s]."""
        c = self.columns
        names = ("position", "velocity", "density", "energy", "sound_speed")
        broken = np.flatnonzero(~np.isfinite(np.column_stack([c[name] for name in names])).all(axis=1))
        if len(broken):
            state = ", ".join(f"{name} {c[name][broken[0]]}" for name in names)
            raise Diverged(f"{self._name(broken[0])} has no valid state at t = {time:.6g} s: {state}")

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        sums = {"boundary_impulse": self._boundary_impulse, "gravity_work": self._gravity_work}
        if self._walls:
            sums["wall_impulse"] = self._walls.impulse
        return {"particles": self._sorted(*self.columns), "sums": sums}

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, whose particles may be on any rank."""
        for name, column in snapshot["particles"].items():
            self.columns[name] = column
        self._home = None
        self.migrate()
        self.form.resume()
        self._boundary_impulse[:] = snapshot["sums"]["boundary_impulse"]
        self._gravity_work[:] = snapshot["sums"]["gravity_work"]
        if self._walls:
            self._walls.impulse[:] = snapshot["sums"]["wall_impulse"]

    def outputs(self, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """This rank's particles for a field file (solid/fields.py); `chosen`: the rows wanted, by default all, by
        block, body and id."""
        rows = self._order if chosen is None else chosen
        c = {name: column[rows] for name, column in self.columns.items()}
        written = fields.outputs(c, self.materials.columns, self._shown)
        return written | {"von_mises": self._von_mises(c["deviator"].T)}
