"""What a step, the budget, the diagnostics and a restart ask of a coupling of fluid and solid."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from distfsi.device.interface import Device, DualArray
from distfsi.fluid.stages import Stage
from distfsi.mesh.blocks import Snapshot


class Transfer(Protocol):
    """What the fluid gives to a solid in a step."""

    @property
    def impulse(self) -> Any:
        """(own, D) [N s] on this rank's particles, an array of the device."""


class Coupling(Protocol):
    """Lets fluid and solid act on each other. The order of calls in a step (distfsi/step.py):

    time_step(), once the forces between particles are known; when the solid has been advanced update_geometry(); in
    each stage merge() before the fluid's tiles and apply_wall_fluxes() after them; redistribute(), transfer_impulse(),
    and account_work() when the solid has taken the impulse. What a call finds it returns, and those that follow take
    it: the `geometry` of the step, the `cells` of the stage, the `transfer`; what is in them is the coupling's alone,
    but for `transfer.impulse`. All else may be asked for between steps.

    device     the device, whose seconds are those of the coupling alone
    reach      [m]: how far the solid's ghosts and images must go
    sub_steps  how many sub-steps of the solid a step has at most
    stray      [m]: how far particles may go between two migrations, if there are sub-steps
    """

    device: Device
    reach: float
    sub_steps: int
    stray: float

    @property
    def causes(self) -> tuple[str, ...]:
        """Of what the coupling creates or takes, keys of budget_by_cause()."""

    @property
    def at_ends(self) -> tuple[str, ...]:
        """Those of the causes that pass the ends of the domain with bodies: they have come in, or left."""

    @property
    def kind(self) -> DualArray:
        """Field (local blocks, 1, Z, Y, X) on host and device: at least COVERED where a cell holds no fluid, see
        coupling/kernels/cells.py."""

    def time_step(self) -> float:
        """Longest step [s] that this rank's particles allow, or sub-step when the wall moves on; inf: any."""

    def update_geometry(self) -> Any:
        """Collective. Where the wall is now and how it has moved since the step began."""

    def merge(self, geometry: Any, stage: Stage, /) -> Any:
        """Collective. Make all cells of the stage's input states from which the fluid's stage can go on: small cells
        share with others, covered ones get what their neighbours are to see."""

    def apply_wall_fluxes(self, geometry: Any, cells: Any, stage: Stage, dt: float, /) -> None:
        """Let the wall's fluxes act in a stage, which the fluid has made, of a step of `dt` [s]; keep what has crossed
        the wall."""

    def redistribute(self, geometry: Any, /) -> None:
        """Collective, after the last stage. Make all cells of the new state states again."""

    def transfer_impulse(self, geometry: Any, cells: Any, dt: float, /) -> Transfer:
        """Collective. What the fluid gives to this rank's particles in the step of `dt` [s]; `cells`: of its last
        stage."""

    def account_work(self, geometry: Any, transfer: Any, excess: Any, /) -> None:
        """Collective. Account for what the solid has received, whose impulse worked at the `excess` (own, D) [m/s] over
        the velocity of the wall that the stages knew."""

    @property
    def covered(self) -> np.ndarray:
        """(local blocks, Z, Y, X) whether a cell holds no fluid, ghosts included."""

    @property
    def volume(self) -> np.ndarray:
        """(local blocks, Z, Y, X) the part of each cell that fluid fills."""

    def trapped(self) -> np.ndarray:
        """Collective. Mass [kg] of each phase in cells that are shut: it neither flows nor pushes."""

    def budget_by_cause(self) -> dict[str, np.ndarray]:
        """Collective. Masses [kg], momentum [N s] and energy [J] (conserved,) that the coupling has created since the
        start, per cause."""

    def memory(self) -> int:
        """Bytes of this rank's fields."""

    def workload(self) -> np.ndarray:
        """(local blocks,) how many cells the coupling has to do with, as a measure of its costs."""

    def snapshot(self) -> Snapshot:
        """What a restart needs."""

    def restore(self, snapshot: Snapshot) -> None:
        """Collective. Go on from a snapshot, after fluid and solid have."""


@runtime_checkable
class ReleasesFluid(Protocol):
    """A coupling that can go on with the solid alone (`coupling.drop_below`)."""

    def pressure(self, dt: float) -> float:
        """Collective, between steps. The highest mean pressure [Pa] on a cell's wall in the last step, of `dt` [s]."""

    def let_fluid_leave(self) -> None:
        """Between steps. All that the fluid holds leaves the domain; from now on all cells are covered."""
