"""The particles of a solid as a coupling sees them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from distfsi.solid.protocol import Structure


class Bonds(NamedTuple):
    """What bonds know of particles, on the device.

    volume       (own,) [m^D] of the reference state
    count        (own,) intact bonds
    deformation  (own, D D) gradient
    """

    volume: Any
    count: Any
    deformation: Any


class SolidParticles:
    """This rank's particles, arrays of the device; and the coupling's own columns, which go with them.

    All that a coupling asks of a solid but for its steps. The impulse on it goes by apply_impulse().
    """

    def __init__(self, solid: Structure):
        self._solid = solid

    @property
    def count(self) -> int:
        """How many there are."""
        return self._solid.count

    @property
    def id(self) -> np.ndarray:
        """(own,) on the host, unique among all ranks."""
        return self._solid.columns["id"]

    @property
    def id_on_device(self) -> Any:
        """(own,) the same."""
        return self.read("id")

    # ---- the state --------------------------------------------------------------------------------------------------

    @property
    def mass(self) -> Any:
        """(own,) [kg]"""
        return self.read("mass")

    @property
    def density(self) -> Any:
        """(own,) [kg/m3]"""
        return self.read("density")

    @property
    def fixed(self) -> Any:
        """(own,) whether no force moves them."""
        return self.read("fixed")

    @property
    def bonds(self) -> Bonds | None:
        """What their bonds know, if they have any."""
        columns = self._solid.columns
        if "bond_count" not in columns:
            return None
        return Bonds(*columns.read("volume", "bond_count", "deformation"))

    # ---- how they move ----------------------------------------------------------------------------------------------

    @property
    def start(self) -> Any:
        """(own, D) [m] positions when the step began."""
        return self._solid.start

    @property
    def position(self) -> Any:
        """(own, D) [m] now."""
        return self.read("position")

    @property
    def before(self) -> Any:
        """(own, D) [m/s] velocities when the step began."""
        return self._solid.before

    @property
    def carried(self) -> Any:
        """(own, D) [m/s] mean velocities since then."""
        return self._solid.carried

    @property
    def velocity(self) -> Any:
        """(own, D) [m/s] now."""
        return self.read("velocity")

    # ---- what they have received ------------------------------------------------------------------------------------

    @property
    def impulse(self) -> np.ndarray:
        """(local blocks, D) [N s] of the last apply_impulse()."""
        return self._solid.given.sum(axis=1)

    @property
    def work(self) -> np.ndarray:
        """(local blocks,) [J] of that impulse."""
        return self._solid.work

    def share_push(self, mass: Any, gained: Any, impulse: Any, shared: Any) -> tuple[Any, Any]:
        """Collective. What rigid bodies make of the fluid's push: see solid/protocol.py."""
        return self._solid.share_push(mass, gained, impulse, shared)

    # ---- columns of the coupling's own ------------------------------------------------------------------------------

    def attach(self, name: str, values: np.ndarray, shown: bool = False) -> None:
        """A new column (own, …): it goes with the particles to other ranks and into restart files, and into field files
        if it is `shown`."""
        self._solid.attach_column(name, values, shown)

    def read(self, name: str) -> Any:
        """A column that is not written into."""
        return self._solid.columns.read(name)[0]

    def write(self, name: str) -> Any:
        """A column that may be written into."""
        return self._solid.columns.write(name)[0]

    def adopt(self, name: str, values: Any) -> None:
        """New values of a column, from now on."""
        self._solid.columns.adopt(name, values)
