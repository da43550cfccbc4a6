"""The particles of a solid as points of their materials: the kernels of solid/kernels/material.py, one set for each
material of the scene."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device.interface import Columns, Device
from distfsi.solid.kernels import material as kernels
from distfsi.solid.kernels.records import LawTables, MaterialPoints, RestState, Volumes
from distfsi.solid.materials import Material, Materials

DRIVERS = (kernels.deform, kernels.open_voids)


class MaterialGroup:
    """The particles of one material."""

    def __init__(self, material: Material, tables: LawTables, device: Device, constants: Mapping[str, object]):
        """`constants`: what all kernels of the solid are specialised for."""
        self.material, self._memory = material, material.memory
        self.tables = LawTables(*map(device.array, tables))
        self.kernels = device.build(DRIVERS, {**constants, **material.constants}, material.bindings)
        self.rows = device.empty(0, np.int64)

    def memory(self, columns: Columns) -> list[tuple[Any, ...]]:
        """What is remembered for each of the laws, of all particles."""
        return [record(*columns.write(*record._fields)) for record in self._memory]


class MaterialGroups:
    """All own particles, grouped by their materials.

    Stresses are those that a particle carries, damage included: forces need no further factor. Damage 1 means failed:
    no tension and no shear are left (closed cracks in concrete carry friction), and bonds are to be cut.
    """

    def __init__(self, materials: Materials, device: Device, constants: Mapping[str, object]):
        self._device, self._number = device, materials.number
        self.rest = RestState(*map(device.array, materials.rest))
        self.groups = [MaterialGroup(m, materials.tables(m), device, constants) for m in materials.materials]

    def select(self, body: np.ndarray) -> None:
        """Say which `body` (n,) each particle is of; their rows have changed."""
        number = self._number[body]
        for k, group in enumerate(self.groups):
            group.rows = self._device.array(np.flatnonzero(number == k))

    def deform(self, columns: Columns, dt: float, gradient: Any) -> None:
        """Advance density, smoothing length and all that the materials remember by `dt` [s] of the velocity `gradient`
        (n, D D) [1/s] at mid-step."""
        found = columns.read("body", "energy") + columns.write("density", "h", "deviator", "pressure", "sound_speed")
        found += [self._column(columns, name, axes) for name, axes in (("stretch", 2), ("strength_scatter", 1))]
        points = MaterialPoints(*found)
        for group in self.groups:
            memory = group.memory(columns)
            self._run(group, group.kernels.deform, dt, gradient, points, self.rest, group.tables, *memory)

    def open_voids(self, columns: Columns, dt: float, bond_count: Any, gradient: Any) -> None:
        """Failed particles and debris swell until they have no pressure, at the cost of their voids."""
        volumes = Volumes(*columns.read("mass", "density", "volume"), *columns.write("void"))
        body, energy = columns.read("body", "energy")
        given = (energy, volumes, bond_count, self._column(columns, "damage", 1), gradient)
        for group in self.groups:
            self._run(group, group.kernels.open_voids, dt, body, group.tables.eos, *given)

    def _column(self, columns: Columns, name: str, axes: int) -> Any:
        """A column for kernels that may write into it; an empty one where no material has it."""
        return columns.write(name)[0] if name in columns else self._device.empty((0,) * axes)

    def _run(self, group: MaterialGroup, kernel: SimpleNamespace, *arguments: Any) -> None:
        self._device.run(kernel, group.rows.shape[0], group.rows, *arguments)
