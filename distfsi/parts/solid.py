"""The solid: smoothed particles, their motion and their books (paper, Sec. 2.1 and Appendix A).

How particles act on each other is a matter of the solid's form: updated.py, bonds.py. A step needs three or four
messages per pair of ranks that are neighbours: who needs whom, the state, in the updated form the corrected stress, the
new velocity. Time integration is leapfrog: forces at x^n take v^(n-1/2) to v^(n+1/2), which strains and moves the
particles.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from distfsi.device.cpu import Team
from distfsi.device.emit import plain
from distfsi.errors import Diverged
from distfsi.kernels import material
from distfsi.kernels import solid as kernels
from distfsi.mesh.blocks import Blocks, Snapshot
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.particles import ParticleExchange
from distfsi.parts import bonds, pieces, updated
from distfsi.parts.bonds import TotalLagrangian
from distfsi.parts.materials import Materials
from distfsi.parts.neighbours import Near, NeighbourSearch
from distfsi.parts.updated import UpdatedLagrangian
from distfsi.physics.strength import von_mises
from distfsi.scene.description import Scene
from distfsi.scene.packing import initial_velocity, pack
from distfsi.scene.shapes import contains

DRIVERS = (
    kernels.find_cells,
    kernels.fill_cells,
    kernels.order_cells,
    kernels.find_neighbours,
    material.deform,
    *updated.DRIVERS,
    *bonds.DRIVERS,
)
SHEARS = ((), (), (3,), (3, 5, 4))  # where the shear stresses xy, xz, yz stand in xx, yy, zz, xy, yz, xz
LIMITS = ("sound", "acceleration")  # what bounds the time step, columns of `_limits`


class Solid:
    """All particles of this rank. A step is prepare(), time_step(), advance(dt, impulse), migrate().

    columns  this rank's particles, sorted by (block, id): id, body, fixed (n,), position [m], velocity [m/s] (n, D),
             mass [kg], h [m], density [kg/m3], energy [J/kg] (specific, internal), and what the materials remember
             (parts/materials.py): deviator (n, D(D+1)/2) [Pa], pressure [Pa], sound_speed [m/s], damage (n,) …
             Velocities belong to half a step before the positions.
    work     (local blocks,) work [J] of the last step's external impulse
    given    (local blocks, bodies, D) impulse [N s] that the fluid gave to each body in the last step
    """

    def __init__(self, scene: Scene, blocks: Blocks, communicator: Communicator, team: Team):
        self.blocks, self.communicator, self.team = blocks, communicator, team
        self.dimensions = scene.domain.dimensions
        self.gravity = np.array(scene.gravity)
        self.materials = Materials(scene.solid, self.dimensions)
        self.exchange = ParticleExchange(blocks)
        axes = range(self.dimensions)  # parities: the axes whose reflection changes the sign of each component
        self._vector = tuple((a,) for a in axes)
        self._components = self.dimensions * (self.dimensions + 1) // 2
        constants = {
            "DIMENSIONS": self.dimensions,
            "COMPONENTS": self._components,
            "VISCOSITY_ALPHA": scene.solid.viscosity_alpha,
            "VISCOSITY_BETA": scene.solid.viscosity_beta,
            "ZERO_ENERGY": scene.solid.zero_energy,
        } | self.materials.constants
        self.kernels = team.build(DRIVERS, constants)
        self._von_mises = plain(von_mises, constants)
        search = NeighbourSearch(self.kernels, team, scene.domain.lower, scene.domain.upper)
        self.form: UpdatedLagrangian | TotalLagrangian = UpdatedLagrangian(self.kernels, team, search, self.dimensions)
        if scene.solid.form == "total_lagrangian":
            given = (communicator, scene.solid, self.materials.tables[1], self.dimensions)
            self.form = TotalLagrangian(self.kernels, team, search, *given)
        self._boundary_impulse = np.zeros((blocks.local_count, self.dimensions))
        self._gravity_work = np.zeros(blocks.local_count)
        self.work = np.zeros(blocks.local_count)
        self.given = np.zeros((blocks.local_count, len(scene.solid.bodies), self.dimensions))
        self._own_particles(scene)

    def _own_particles(self, scene: Scene) -> None:
        """Pack the bodies and keep the particles of this rank's blocks."""
        columns = [self._packed(scene, b) for b in range(len(scene.solid.bodies))]
        columns = {name: np.concatenate([c[name] for c in columns]) for name in columns[0]}
        count = len(columns["body"])
        columns["id"] = np.arange(count)
        block = self.blocks.block_of(columns["position"])
        mine = np.flatnonzero(self.blocks.owners[block] == self.communicator.rank)
        mine = mine[np.argsort(block[mine], kind="stable")]
        c = {name: column[mine] for name, column in columns.items()}
        n = len(mine)
        c["energy"] = np.zeros(n)
        self.columns = c | self.materials.initial(c["body"], c["id"], c["mass"] / c["density"])
        self._find_blocks()
        self._deform(0.0, np.zeros((n, self.dimensions**2)))
        self.form.bind(self.columns, self.exchange)

    def _packed(self, scene: Scene, b: int) -> dict[str, np.ndarray]:
        body = scene.solid.bodies[b]
        position, volume = pack(body, scene.domain.lower, scene.domain.upper)
        n = len(position)
        fixed = np.zeros(n, dtype=bool) if body.fixed is None else contains(body.fixed, position)
        return {
            "body": np.full(n, b),
            "position": position,
            "velocity": np.where(fixed[:, None], body.fixed_velocity or 0.0, initial_velocity(body, position)),
            "fixed": fixed,
            "mass": body.density * volume,
            "density": np.full(n, body.density),
            "h": np.full(n, scene.solid.smoothing * body.spacing),
        }

    # ---- the step ---------------------------------------------------------------------------------------------------

    def prepare(self, reach: float = 0.0) -> None:
        """Collective. Bring in ghosts and images, find neighbours, and compute the forces between particles.

        `around` then holds all particles within `reach` [m], or farther, of this rank's blocks. Raises Diverged on all
        ranks when a smoothing length is not finite.
        """
        c = self.columns
        support, *flags = self.communicator.maximum(np.array([c["h"].max(initial=0.0), *self.form.flags(c)]))
        support *= 2.0
        if not np.isfinite(support):
            raise Diverged("solid: a smoothing length is not finite")
        state = np.column_stack([c[name] for name in ("mass", "density", "h", "sound_speed", "velocity")])
        parity = ((),) * kernels.VELOCITY + self._vector
        plan = self.exchange.ghosts(c["position"], c["id"], max(reach, support), self.form.asked(c))
        position, state, *told = plan.exchange([(c["position"], "position"), (state, parity), *self.form.told(c)])
        self._near = Near(plan, position, state, support, told, flags)
        self._acceleration, self._limits = np.empty((plan.own, self.dimensions)), np.empty((plan.own, len(LIMITS)))
        self.form.accelerate(c, self._near, self._acceleration, self._limits)

    def time_step(self) -> tuple[float, str]:
        """Longest stable step [s] of this rank's particles (NaN: none is) and what bounds it; after prepare()."""
        if self._limits.size == 0:
            return np.inf, "solid"
        particle, cause = divmod(int(np.argmin(self._limits)), len(LIMITS))
        dt = float(self._limits[particle, cause])
        return dt if dt > 0.0 else np.nan, f"{LIMITS[cause]} of solid particle {self.columns['id'][particle]}"

    def advance(self, dt: float) -> None:
        """Collective, after prepare(). Advance by `dt` [s]: velocities first, then positions.

        The energy takes the mean of old and new velocities: kinetic plus internal energy grow by the work of gravity.
        """
        self.kick(dt)
        self.drift(dt)

    def kick(self, dt: float) -> None:
        """After prepare(). Give the particles the velocities after `dt` [s] of the forces between them and gravity."""
        c = self.columns
        mass, fixed = c["mass"][:, None], c["fixed"][:, None]
        weight = mass * self.gravity * dt
        received = mass * self._acceleration * dt
        velocity = np.where(fixed, c["velocity"], c["velocity"] + (received + weight) / mass)
        mean = 0.5 * (c["velocity"] + velocity)
        held = -(fixed * (received + weight))  # impulse of what moves the fixed particles
        self._gravity_work += self._per_block((weight * mean + held * velocity).sum(axis=1, keepdims=True))[:, 0]
        self._boundary_impulse += self._per_block(received + weight + held)
        c["velocity"] = velocity

    def drift(self, dt: float) -> None:
        """Collective, after kick(). Strain and move the particles by `dt` [s] of their new velocities."""
        c = self.columns
        (around,) = self._near.plan.exchange([(c["velocity"], self._vector)])
        gradient = np.empty((self._near.own, self.dimensions**2))
        self.form.strain(c, self._near, dt, around, gradient)
        self._deform(dt, gradient)
        c["position"] = c["position"] + dt * c["velocity"]

    def push(self, impulse: np.ndarray) -> np.ndarray:
        """After advance() and before migrate(). The fluid gives `impulse` (own, D) [N s].

        Returns the gain (own, D) of velocity [m/s]; there is none where particles are fixed.
        """
        c = self.columns
        fixed = c["fixed"][:, None]
        gain = np.where(fixed, 0.0, impulse / c["mass"][:, None])
        self.work = self._per_block((impulse * (c["velocity"] + 0.5 * gain)).sum(axis=1, keepdims=True))[:, 0]
        self.given = self._per_block_and_body(impulse)
        held = -(fixed * impulse)
        self._gravity_work += self._per_block((held * c["velocity"]).sum(axis=1, keepdims=True))[:, 0]
        self._boundary_impulse += self._per_block(held)
        c["velocity"] = c["velocity"] + gain
        return gain

    def migrate(self) -> None:
        """Collective. Give the particles that left this rank's blocks to their new owners."""
        self.columns = self.exchange.migrate(self.columns)
        self._find_blocks()

    def _deform(self, dt: float, gradient: np.ndarray) -> None:
        c = self.columns
        state = self.materials.state(c)
        self._run(self.kernels.deform, dt, gradient, c["body"], *self.materials.tables, *state)

    def _run(self, kernel: Callable, *arguments) -> None:
        self.team.run(kernel, len(self.columns["id"]), *arguments)

    # ---- totals and output ------------------------------------------------------------------------------------------

    def _find_blocks(self) -> None:
        self._block = self.blocks.block_of(self.columns["position"]) - self.blocks.first

    def _per_block(self, values: np.ndarray) -> np.ndarray:
        """Sums (local blocks, k) of `values` (own, k), particle by particle in the order of their ids."""
        count = self.blocks.local_count
        return np.stack([np.bincount(self._block, v, minlength=count) for v in values.T], axis=1)

    def _per_block_and_body(self, values: np.ndarray) -> np.ndarray:
        """Sums (local blocks, bodies, k) of `values` (own, k), particle by particle in the order of their ids."""
        bodies = self.given.shape[1]
        group, count = self._block * bodies + self.columns["body"], self.blocks.local_count * bodies
        sums = np.stack([np.bincount(group, v, minlength=count) for v in values.T], axis=1)
        return sums.reshape(-1, bodies, values.shape[1])

    @property
    def start(self) -> np.ndarray:
        """Positions (own, D) [m] as of prepare()."""
        return self._near.position[: self._near.own]

    @property
    def around(self) -> dict[str, np.ndarray]:
        """Own particles, ghosts and images as of prepare(): position, velocity, mass, density, volume, h, key."""
        s, v = self._near.state, kernels.VELOCITY
        scalars = {"mass": kernels.MASS, "density": kernels.DENSITY, "h": kernels.SMOOTHING}
        return {
            "position": self._near.position,
            "velocity": np.ascontiguousarray(s[:, v : v + self.dimensions]),
            "key": self._near.plan.key,
            "volume": s[:, kernels.MASS] / s[:, kernels.DENSITY],
        } | {name: np.ascontiguousarray(s[:, column]) for name, column in scalars.items()}

    def check(self, time: float) -> None:
        """Raise Diverged, naming the particle, if one of this rank has no valid state at `time` [s]."""
        c = self.columns
        names = ("position", "velocity", "density", "energy", "sound_speed")
        broken = np.flatnonzero(~np.isfinite(np.column_stack([c[name] for name in names])).all(axis=1))
        if len(broken):
            state = ", ".join(f"{name} {c[name][broken[0]]}" for name in names)
            raise Diverged(f"solid particle {c['id'][broken[0]]} has no valid state at t = {time:.6g} s: {state}")

    def totals(self) -> dict[str, np.ndarray]:
        """Collective. mass [kg], momentum (D,) [N s], kinetic and internal energy [J] of all particles of all ranks."""
        c = self.columns
        mass, velocity = c["mass"], c["velocity"]
        kinetic = 0.5 * mass * (velocity**2).sum(axis=1)
        values = np.column_stack([mass, kinetic, mass * c["energy"], mass[:, None] * velocity])
        total = self.blocks.sum(self._per_block(values))
        return {"mass": total[0], "kinetic": total[1], "internal": total[2], "momentum": total[3:]}

    def body_totals(self, body: int) -> dict[str, np.ndarray]:
        """Collective. mass [kg], center of mass (D,) [m], momentum (D,) [N s] of a body, and the impulse (D,) [N s]
        that the fluid gave to it in the last step."""
        c, D = self.columns, self.dimensions
        mass = c["mass"][:, None]
        amounts = self._per_block_and_body(np.hstack([mass, mass * c["position"], mass * c["velocity"]]))
        total = self.blocks.sum(np.hstack([amounts[:, body], self.given[:, body]]))
        mass, first_moment, momentum, impulse = np.split(total, [1, 1 + D, 1 + 2 * D])
        return {"mass": mass, "center": first_moment / mass, "momentum": momentum, "impulse": impulse}

    def pieces(self) -> dict[str, np.ndarray] | None:
        """Collective. The pieces that intact bonds hold together: see parts/pieces.py; None without bonds."""
        self.label_pieces()
        return pieces.table(self.columns, self._block, self.blocks) if "piece" in self.columns else None

    def label_pieces(self) -> None:
        """Collective. Bring the pieces that particles belong to up to date, for outputs()."""
        self.form.label_pieces(self.columns, self.exchange)

    def boundary_impulse(self) -> np.ndarray:
        """Collective. Impulse (D,) [N s] given by symmetry planes, fixed particles and gravity since the start."""
        return self.blocks.sum(self._boundary_impulse)

    def gravity_work(self) -> float:
        """Collective. Work [J] of gravity, and of what moves fixed particles, since the start."""
        return self.blocks.sum(self._gravity_work[:, None])[0]

    def workload(self) -> np.ndarray:
        """(local blocks,) particles."""
        return np.bincount(self._block, minlength=self.blocks.local_count).astype(float)

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        sums = {"boundary_impulse": self._boundary_impulse, "gravity_work": self._gravity_work}
        return {"particles": self.columns, "sums": sums}

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, whose particles may be on any rank."""
        self.columns = dict(snapshot["particles"])
        self.migrate()
        self._boundary_impulse[:] = snapshot["sums"]["boundary_impulse"]
        self._gravity_work[:] = snapshot["sums"]["gravity_work"]

    def outputs(self, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """This rank's particles for a field file: position and velocity (n, 3), the scalars (n,), and the stress (n, 6)
        with the components xx, yy, zz, xy, yz, xz. `chosen`: the rows wanted, by default all."""
        c, D = self.columns, self.dimensions
        c = c if chosen is None else {name: column[chosen] for name, column in c.items()}
        vectors = {name: np.pad(c[name], ((0, 0), (0, 3 - D))) for name in ("position", "velocity")}
        names = ["density", "energy", "id", "body", *(m.name for m in self.materials.columns if m.unit)]
        names += [name for name in ("piece",) if name in c]
        invariant = {"von_mises": self._von_mises(c["deviator"].T), "stress": self._cauchy_stress(c)}
        return vectors | {name: c[name] for name in names} | invariant

    def _cauchy_stress(self, columns: dict[str, np.ndarray]) -> np.ndarray:
        """(n, 6) stress [Pa], tension positive; the normal stresses out of the plane share what makes the deviator's
        trace vanish."""
        deviator, D = columns["deviator"], self.dimensions
        stress = np.zeros((len(deviator), 6))
        stress[:, :D] = deviator[:, :D]
        stress[:, D:3] = -deviator[:, :D].sum(axis=1, keepdims=True) / max(3 - D, 1)
        stress[:, :3] -= columns["pressure"][:, None]
        for column, component in zip(SHEARS[D], deviator[:, D:].T, strict=True):
            stress[:, column] = component
        return stress
