"""`[loads.NAME]`: blasts that press on the faces of bodies where no fluid is computed."""

from __future__ import annotations

from distfsi.device.interface import Device
from distfsi.scene.description import Scene
from distfsi.scene.loads import loaded_particles
from distfsi.solid.kernels.loads import bear_wave
from distfsi.solid.solid import Solid


class Loads:
    """What the loads of a scene do to the particles of a solid, as columns of these."""

    def __init__(self, scene: Scene, solid: Solid, device: Device):
        self._solid, self._device = solid, device
        self._kernels = device.build([bear_wave], {"DIMENSIONS": solid.dimensions})
        self._columns = []
        for number, load in enumerate(scene.loads, 1):
            found = loaded_particles(scene, load)._asdict()
            names = {part: f"load_{number}_{part}" for part in found}
            for part, name in names.items():
                solid.attach_column(name, found[part][solid.columns["id"]], shown=False)
            self._columns.append(tuple(names.values()))

    def bear(self, start: float, dt: float) -> None:
        """After the solid has advanced and before it migrates: give it the impulse of `dt` [s] from `start` [s] on."""
        solid, c = self._solid, self._solid.columns
        impulse = self._device.zeros((solid.count, solid.dimensions))
        for names in self._columns:
            self._device.run(self._kernels.bear_wave, solid.count, start, start + dt, *c.read(*names), impulse)
        solid.bear(impulse)
