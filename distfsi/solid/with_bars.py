"""A solid some of whose bodies have bars in them (solid/bars.py)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from distfsi.device.emit import plain
from distfsi.gauges import per_extent
from distfsi.mesh.blocks import Snapshot
from distfsi.narrowing import present
from distfsi.scene.bar_lines import lines_of
from distfsi.scene.bars import Bars
from distfsi.scene.description import Scene
from distfsi.solid.bars import BarNetwork, Nodes, assemble, fit_weights
from distfsi.solid.contact import Contact
from distfsi.solid.formulas.smoothing import smoothing_kernel
from distfsi.solid.protocol import SolidForm
from distfsi.solid.walls import Walls
from distfsi.solid.with_rigid import SolidWithRigid

PREFIX = "bars_"  # of what a restart file keeps of them


class SolidWithBars(SolidWithRigid):
    """Bodies with bars, and others. All ranks know all bars and the particles that these are tied to."""

    def _begin(self, scene: Scene) -> tuple[SolidForm, Sequence[Contact | Walls]]:
        found = super()._begin(scene)
        self._bars = self._network(scene)
        self._find_tied()
        return found

    def _network(self, scene: Scene) -> BarNetwork:
        """Collective. The bars of all bodies, tied to the particles around them."""
        D, c, bodies = self.dimensions, self.columns, present(scene.solid).bodies
        laws: list[Bars] = []
        self._body_of_law: list[int] = []
        lines, speeds, of_line = [], [], []
        for b, body in enumerate(bodies):
            if body.bars is None:
                continue
            for line in lines_of(body, body.bars, scene.domain):
                axis = int(np.argmax(np.ptp(line.nodes, axis=0)))
                lines.append((len(laws), axis, line))
                speeds.append(body.velocity)
                of_line += [b] * len(line.nodes)
            laws.append(body.bars)
            self._body_of_law.append(b)
        parts = assemble(lines, laws, D == 2, np.array(speeds))
        own = np.column_stack([c["id"], c["body"], c["mass"], c["h"], c["position"]])
        every = self.communicator.concatenate(own)
        every = every[np.argsort(every[:, 0])]
        self._particles = len(every)
        kernel = plain(smoothing_kernel, {"DIMENSIONS": D})
        near, shares = [], []
        for x, b in zip(parts["position"], of_line, strict=True):
            distance2 = ((every[:, 4:] - x) ** 2).sum(axis=1)
            rows = np.flatnonzero((every[:, 1] == b) & (distance2 < 4.0 * every[:, 3] ** 2))
            weight = every[rows, 2] * kernel(distance2[rows], every[rows, 3])
            near.append(rows)
            shares.append(fit_weights(x, every[rows, 4:], weight))
        tied = np.unique(np.concatenate(near))
        width = max(map(len, near))
        around, weights = np.zeros((len(near), width), dtype=np.int64), np.zeros((len(near), width))
        for n, (rows, share) in enumerate(zip(near, shares, strict=True)):
            around[n, : len(rows)], weights[n, : len(rows)] = np.searchsorted(tied, rows), share
        nodes = Nodes(**parts, tied=every[tied, 0].astype(np.int64), around=around, weight=weights)
        return BarNetwork(nodes, laws, every[tied, 2])

    def _find_tied(self) -> None:
        """Which particles of this rank are tied: their rows, and which of the tied ones they are."""
        tied, id = self._bars.nodes.tied, self.columns["id"]
        self._tied_rows = np.flatnonzero(np.isin(id, tied))
        self._tied = np.searchsorted(tied, id[self._tied_rows])

    def _of_tied(self, values: np.ndarray) -> np.ndarray:
        """Collective. What the tied particles of all ranks have, of `values` (own, D): (t, D)."""
        found = np.empty((len(self._bars.nodes.tied), values.shape[1]))
        for which, part in self.communicator.allgather((self._tied, values[self._tied_rows])):
            found[which] = part
        return found

    # ---- the step ---------------------------------------------------------------------------------------------------

    def prepare(self, reach: float = 0.0, stray: float = 0.0, goes_on: bool = False) -> None:
        """Collective. As of any solid; bars pull at the particles around them."""
        super().prepare(reach, stray, goes_on)
        force = self._bars.find_forces(self._of_tied(self.columns["position"]))
        acceleration = np.array(self.device.download(self._acceleration))
        mass = self.columns["mass"][self._tied_rows, None]
        acceleration[self._tied_rows] += force[self._tied] / mass
        self._acceleration = self.device.array(acceleration)

    def time_step(self) -> tuple[float, str]:
        """As of any solid; and what bars allow."""
        limits = [super().time_step(), (self._bars.longest, "bars")]
        return min(limits, key=lambda limit: limit[0] if limit[0] == limit[0] else -1.0)

    def kick(self, dt: float) -> None:
        """After prepare(). As of any solid."""
        before = np.array(self.columns["velocity"])
        super().kick(dt)
        mean = self._of_tied(0.5 * (before + self.columns["velocity"]))
        self._bars.kick(dt, mean, self._gravity()[: self.dimensions])

    def drift(self, dt: float) -> None:
        """Collective, after kick(). As of any solid."""
        super().drift(dt)
        self._bars.go(dt)

    def migrate(self) -> None:
        """Collective. Give the particles that left this rank's blocks to their new owners."""
        home = self._home
        super().migrate()
        if home is not None and self._home is not home:
            self._find_tied()

    # ---- totals and output ------------------------------------------------------------------------------------------

    def totals(self) -> dict[str, np.ndarray]:
        """Collective. As of any solid, bars among them."""
        found, bars = super().totals(), self._bars
        more = {
            "mass": bars.nodes.mass.sum(),
            "kinetic": bars.kinetic,
            "internal": bars.internal,
            "momentum": bars.momentum,
        }
        return found | {name: found[name] + value for name, value in more.items()}

    def boundary_impulse(self) -> np.ndarray:
        """Collective. As of any solid."""
        return np.asarray(super().boundary_impulse() + self._bars.outside)

    def gravity_work(self) -> float:
        """Collective. As of any solid."""
        return super().gravity_work() + self._bars.gravity_work

    def reported(self) -> dict[str, float]:
        """Collective. Energies of the bars with their bonds, how many elements are torn, the largest stress, plastic
        strain and slip."""
        bars, joule = self._bars, per_extent("J", self.dimensions)
        return super().reported() | {
            f"bars kinetic energy [{joule}]": bars.kinetic,
            f"bars internal energy [{joule}]": bars.internal,
            "bars torn": float(bars.torn.sum()),
            "bars stress [Pa]": float(np.abs(bars.stress).max()),
            "bars plastic strain": float(bars.strained.max()),
            "bars slip [m]": float(np.abs(bars.slipped).max()),
        }

    def outputs(self, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """As of any solid; behind the particles of the first rank follow the nodes of bars, whose column `bar` is 1."""
        found = super().outputs(chosen)
        found["bar"] = np.zeros(len(found["id"]), dtype=np.int64)
        if chosen is not None or self.communicator.rank > 0:
            return found
        nodes, n = self._bars.nodes, len(self._bars.nodes.mass)
        stress = np.zeros(n)
        for end in range(2):  # an element's stress at both of its nodes; where two meet the latter one's
            stress[nodes.ends[:, end]] = self._bars.stress
        more = {name: np.zeros((n, *column.shape[1:]), dtype=column.dtype) for name, column in found.items()}
        pad = ((0, 0), (0, 3 - self.dimensions))
        more |= {"position": np.pad(nodes.position, pad), "velocity": np.pad(nodes.velocity, pad)}
        more |= {"id": self._particles + np.arange(n), "body": np.array(self._body_of_law)[nodes.law_of_node]}
        more |= {"bar": np.ones(n, dtype=np.int64), "piece": np.full(n, -1), "von_mises": np.abs(stress)}
        more["stress"][np.arange(n), nodes.axis] = stress
        return {name: np.concatenate([column, more[name]]) for name, column in found.items()}

    # ---- restart ----------------------------------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        kept = super().snapshot()
        return {**kept, "values": {**kept["values"], **{PREFIX + n: v for n, v in self._bars.state().items()}}}

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, whose particles may be on any rank."""
        super().restore(snapshot)
        self._find_tied()
        values = snapshot["values"]
        self._bars.restore({name: values[PREFIX + name] for name in self._bars.state()})
