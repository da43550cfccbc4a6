"""What the solid asks of its form, and what a step and a coupling ask of whatever makes a wall."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from distfsi.device.interface import Columns
from distfsi.laws.body_force import BodyForce
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.particles import ParticleExchange
from distfsi.solid.neighbours import Near


class SolidForm(Protocol):
    """How particles act on each other: solid/updated.py, solid/total_lagrangian.py. It adds columns of its own to those
    of the particles, and is told these each time; D dimensions, `own` particles of this rank, and `count` with ghosts
    and images.

    In each sub-step flags(), requested_keys() and ghost_payload() say what ghosts must bring; then accelerate(), and
    strain() when the velocities are new. All take their arguments by position.
    """

    def bind(self, columns: Columns, exchange: ParticleExchange, /) -> None:
        """Collective, once. Add the form's columns for the particles where they are now."""

    def flags(self, columns: Columns, /) -> list[float]:
        """What a rank must know of all others: numbers of which the largest over all ranks come back in
        `Near.flags`."""

    def requested_keys(self, columns: Columns, /) -> np.ndarray | None:
        """Keys (n,) of particles and images that this rank needs wherever they are; None: of none."""

    def ghost_payload(self, columns: Columns, /) -> list[Any]:
        """What ghosts and images must bring besides the state: pairs of an array (own, k) of the device and its
        parities, or "position". It comes back, of `count` particles, in `Near.payload`."""

    def accelerate(self, columns: Columns, near: Near, acceleration: Any, limits: Any, /) -> None:
        """Collective. Add to the `acceleration` (own, D) [m/s2] that of the forces between particles, and write the
        time steps (own, 2) [s] that they allow: by the speed of sound, and by the acceleration."""

    def strain(self, columns: Columns, near: Near, dt: float, velocity: Any, gradient: Any, /) -> None:
        """Collective, after accelerate(). Advance the energy, and what else the form keeps of the deformation, by `dt`
        [s] with the old and the new `velocity` (count, D) [m/s], and write the velocity gradient (own, D D) [1/s]."""

    def resume(self, /) -> None:
        """The columns are those of a restart from now on."""

    def label_pieces(self, columns: Columns, exchange: ParticleExchange, /) -> None:
        """Collective. Bring the labels of the pieces that hold together up to date, if the form knows pieces."""


class Structure(Protocol):
    """What makes a wall: surface points with mass that are advanced, and that take an impulse of the fluid. The order
    of calls in a step (distfsi/step.py): prepare(), time_step() and advance() in each sub-step, apply_impulse(),
    migrate(). There are deformable particles (solid/solid.py), rigid bodies among them (solid/with_rigid.py), and
    obstacles (solid/obstacles.py). Arrays are the
    device's, of this rank's `count` points.

    communicator  of all ranks
    columns    of the points: id, fixed, mass [kg], density [kg/m3], position [m], velocity [m/s]; where bonds hold
               them also bond_count, volume [m^D] and deformation
    dimensions D
    sub_steps  that have been made since the step began
    body_force that of the sources, whose mean over a sub-step advance() takes
    start      (own, D) [m] positions when the step began
    before     (own, D) [m/s] velocities then
    carried    (own, D) [m/s] mean velocity since then
    given      (local blocks, bodies, D) impulse [N s] that the fluid gave to each body in the last step, on the host
    work       (local blocks,) work [J] of that impulse, on the host
    stands     whether no point ever moves
    """

    communicator: Communicator
    columns: Columns
    dimensions: int
    sub_steps: int
    body_force: BodyForce
    start: Any
    before: Any
    carried: Any
    given: np.ndarray
    work: np.ndarray
    stands: bool

    @property
    def count(self) -> int:
        """Number of this rank's points."""

    @property
    def around(self) -> Near:
        """Own points, ghosts and images within the reach of the last prepare()."""

    def attach_column(self, name: str, values: np.ndarray, shown: bool) -> None:
        """A column (own, …) of a coupling's own: it goes with the points to other ranks and into restart files, and
        into field files if it is `shown`."""

    def prepare(self, reach: float = 0.0, stray: float = 0.0, goes_on: bool = False) -> None:
        """Collective. Bring in ghosts and images within `reach` [m] of this rank's blocks, and find the forces that
        points exert on each other. `goes_on`: a step that has begun goes on with another sub-step; `stray` [m]: how far
        points go between two calls of migrate(). Raises Diverged on all ranks."""

    def time_step(self) -> tuple[float, str]:
        """After prepare(). Longest stable step [s] of this rank's points (NaN: none is), and what bounds it."""

    def advance(self, dt: float) -> None:
        """Collective, after prepare(). Advance by `dt` [s] without the fluid."""

    def share_push(self, mass: Any, gained: Any, impulse: Any, shared: Any) -> tuple[Any, Any]:
        """Collective, after advance(). What of the fluid's push goes to rigid bodies, and what to the fluid that goes
        along with them (docs/theory.md: light bodies). The points, of a `mass` (own,) [kg] as wall, have `gained`
        (own, 1 + D) velocity [m/s] and added mass over their own. Returns the `impulse` (own, D) [N s], and what is
        `shared` (own, D) [m/s] per added mass, of all points, from what they are where each acts for itself."""

    def apply_impulse(self, impulse: Any) -> Any:
        """After advance(). The fluid gives `impulse` (own, D) [N s]. Returns by how much (own, D) [m/s] the velocity at
        which it works on each point exceeds the one that has carried it."""

    def migrate(self) -> None:
        """Collective. Give points that have left this rank's blocks to their new owners."""
