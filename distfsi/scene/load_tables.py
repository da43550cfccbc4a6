"""Tables of the input of what presses on bodies where no fluid is computed."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from distfsi.scene import description
from distfsi.scene.values import Delay, Mass, Position, Table


class LoadInput(Table):
    """The blast of a charge of TNT on the free faces of all bodies, by the curves of Kingery and Bulmash, where no
    fluid is computed: the positive phase of Friedlander's wave, reflected by how squarely a face meets it, incident on
    faces that look away. Faces are those at the start, and nothing stands in another's shade. In 2D the plane is that
    of the charge. Bodies must be on a lattice along the axes."""

    mass: Mass = Field(description="of TNT")
    center: Position = Field(description="of the charge; of one on the ground a point of the ground")
    burst: Literal["free_air", "surface"] = Field("free_air", description="a sphere, or a hemisphere on the ground")
    start: Delay = Field(0.0, description="when it detonates")

    def build(self) -> description.BlastLoad:
        """The load."""
        return description.BlastLoad(self.mass, self.center, self.burst, self.start)
