"""When the first wave has come to a distance."""

from __future__ import annotations

import numpy as np

from distfsi.diagnostics.sampling import FluidSampler
from distfsi.fluid.fluid import Fluid

DISTURBED = 1e-3  # relative change of the pressure


class Front:
    """The fluid at one distance from r = 0, in one dimension.

    arrived  whether its pressure is another than the first region's; as of the last look()
    """

    def __init__(self, fluid: Fluid, distance: float, pressure: float):
        """`distance` [m] inside the domain; `pressure` [Pa] of the fluid before the wave."""
        self._sampler, self._pressure = FluidSampler(fluid, None, np.array([[distance]])), pressure
        self.arrived = False

    def look(self) -> None:
        """Collective."""
        self.arrived = bool(abs(self._sampler.values()[0, 0] - self._pressure) > DISTURBED * abs(self._pressure))
