"""What a solid's particles add up to: totals, per body and per piece, and what they have got and given."""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.gauges import AXES, per_extent
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.particles import ParticleExchange
from distfsi.mesh.rows import Groups
from distfsi.narrowing import present
from distfsi.solid import pieces
from distfsi.solid.protocol import SolidForm
from distfsi.solid.walls import Walls


class Totals:
    """Of a solid (solid/solid.py), whose attributes these are."""

    blocks: Blocks
    device: Device
    dimensions: int
    columns: Columns
    exchange: ParticleExchange
    form: SolidForm
    given: np.ndarray
    _boundary_impulse: np.ndarray
    _gravity_work: np.ndarray
    _walls: Walls | None
    _groups: Groups | None
    _block: np.ndarray
    _order: np.ndarray

    @property
    def count(self) -> int:
        """Number of this rank's particles."""
        return self.columns.read("id")[0].shape[0]

    def _per_body(self, values: Any) -> np.ndarray:
        """Sums (local blocks, bodies, k) of `values` (own, k) on the device, in the order of the particles' ids."""
        return present(self._groups).sums(values).reshape(*self.given.shape[:2], values.shape[1])

    def _sorted(self, *names: str) -> dict[str, np.ndarray]:
        """The columns of these names by (block, body, id), an order that depends on nothing else."""
        return {name: self.columns[name][self._order] for name in names}

    def totals(self) -> dict[str, np.ndarray]:
        """Collective. mass [kg], momentum (D,) [N s], kinetic and internal energy [J] of all particles of all ranks;
        acoustic [N s]: their momentum at the speed of sound."""
        c = self.columns
        mass, velocity = c["mass"], c["velocity"]
        kinetic = 0.5 * mass * (velocity**2).sum(axis=1)
        sums = (mass, kinetic, mass * c["energy"], mass * c["sound_speed"])
        values = np.column_stack([*sums, mass[:, None] * velocity])
        total = self.blocks.sum(self._per_body(self.device.array(values)).sum(axis=1))
        return dict(zip(("mass", "kinetic", "internal", "acoustic"), total, strict=False)) | {"momentum": total[4:]}

    def body_totals(self, body: int) -> dict[str, np.ndarray]:
        """Collective. mass [kg], center of mass (D,) [m] (NaN: all of it has left), momentum (D,) [N s] of a body, and
        the impulse (D,) [N s] that the fluid gave to it in the last step."""
        c, D = self.columns, self.dimensions
        mass = c["mass"][:, None]
        values = np.hstack([mass, mass * c["position"], mass * c["velocity"]])
        amounts = self._per_body(self.device.array(values))
        total = self.blocks.sum(np.hstack([amounts[:, body], self.given[:, body]]))
        mass, first_moment, momentum, impulse = np.split(total, [1, 1 + D, 1 + 2 * D])
        return {"mass": mass, "center": first_moment / (mass or np.nan), "momentum": momentum, "impulse": impulse}

    def pieces(self) -> dict[str, np.ndarray] | None:
        """Collective. The pieces that intact bonds hold together: see solid/pieces.py; None without bonds."""
        self.label_pieces()
        if "piece" not in self.columns:
            return None
        c, bonded = self._sorted("piece", "mass", "position", "velocity"), self.columns["piece"][self._order] >= 0
        c = {name: column[bonded] for name, column in c.items()}
        return pieces.table(c, self._block[self._order][bonded], self.blocks)

    def label_pieces(self) -> None:
        """Collective. Bring the pieces that particles belong to up to date, for outputs()."""
        self.form.label_pieces(self.columns, self.exchange)

    def reported(self) -> dict[str, float]:
        """Collective. What the history shows besides totals, by the names of its columns: the impulse on all walls."""
        if not self._walls:
            return {}
        unit, given = per_extent("N s", self.dimensions), self.wall_impulse().sum(axis=(0, 1))
        return {f"walls momentum_{axis} [{unit}]": float(m) for axis, m in zip(AXES, given, strict=False)}

    def boundary_impulse(self) -> np.ndarray:
        """Collective. Impulse (D,) [N s] given by symmetry planes, walls, fixed particles, gravity and loads since the
        start, less the momentum that has left."""
        return self.blocks.sum(self._boundary_impulse)

    def wall_impulse(self) -> np.ndarray:
        """Collective. Impulse (D, 2, D) [N s] that bodies have given to each wall of the domain since the start: across
        each axis the low one and the high one; 0 where there is none."""
        D = self.dimensions
        total = self.blocks.sum(self._walls.impulse) if self._walls else np.zeros(2 * D * D)
        return total.reshape(D, 2, D)

    def gravity_work(self) -> float:
        """Collective. Work [J] of gravity, loads, and what moves fixed particles, since the start, less the energy that
        has left."""
        return self.blocks.sum(self._gravity_work[:, None])[0]

    def workload(self) -> np.ndarray:
        """(local blocks,) particles."""
        return np.bincount(self._block, minlength=self.blocks.local_count).astype(float)
