"""A simulation as diagnostics see it."""

from __future__ import annotations

from typing import Protocol

from distfsi.coupling.protocol import Coupling
from distfsi.fluid.fluid import Fluid
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.communicator import Communicator
from distfsi.scene.description import Scene
from distfsi.solid.solid import Solid


class WatchedStep(Protocol):
    """The step made last."""

    @property
    def sub_steps(self) -> int:
        """Steps of the solid in it."""

    def name_particle(self, communicator: Communicator) -> str:
        """Collective. What bounds the solid's sub-steps."""


class Watched(Protocol):
    """A simulation between two steps."""

    scene: Scene
    communicator: Communicator
    blocks: Blocks
    fluid: Fluid | None
    solid: Solid | None
    coupling: Coupling | None
    time: float
    steps: int

    @property
    def dt(self) -> float:
        """[s] of the last step; 0 before the first."""

    @property
    def last_step(self) -> WatchedStep:
        """The step made last."""

    def name_limit(self) -> str:
        """Collective. What set the last time step."""
