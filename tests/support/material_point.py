"""Points of materials for the tests: particles that are strained and look at no neighbours."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from distfsi.device import cpu
from distfsi.device.interface import Columns
from distfsi.scene import description as d
from distfsi.solid.material_points import MaterialGroups
from distfsi.solid.materials import Materials


def body_of(eos, strength, density=7830.0, failure=None, spacing=1e-3, D=3):
    """A body of a material."""
    shape = d.Ball((0.0,) * D, 1.0)
    return d.Body("body", shape, spacing, density, (0.0,) * D, eos, strength, None, failure)


class Points:
    """Particles of several bodies, of which `body` (n,) are the numbers."""

    def __init__(self, bodies, body, rate="jaumann", D=3, device=None):
        bodies = tuple(replace(each, name=f"body {b}") for b, each in enumerate(bodies))
        materials = Materials(d.Solid(bodies, 1.3, 1.0, 2.0, rate), D)
        constants = {"DIMENSIONS": D, "COMPONENTS": D * (D + 1) // 2} | materials.constants
        body, self.count, self.device = np.asarray(body), len(body), device or cpu.Cpu(1)
        size = np.array([each.spacing for each in bodies])[body]
        columns = materials.initial(body, np.arange(self.count), size**D) | {"body": body, "h": 1.3 * size}
        columns |= {"energy": np.zeros(self.count), "density": np.array([each.density for each in bodies])[body]}
        self.columns = Columns(self.device, columns)
        self.groups = MaterialGroups(materials, self.device, constants)
        self.groups.select(body)
        self.strain(0.0, np.zeros((D, D)))

    def strain(self, dt, gradient):
        """Strain all particles by `dt` of one velocity gradient (D, D), or each by its own (count, D, D)."""
        rates = np.broadcast_to(np.asarray(gradient, dtype=float), (self.count, *np.shape(gradient)[-2:]))
        self.groups.deform(self.columns, dt, self.device.array(np.ascontiguousarray(rates.reshape(self.count, -1))))
        return self

    def __getattr__(self, name):
        return self.columns[name]

    @property
    def normal_stress(self):
        """Along x [Pa], tension positive."""
        return self.deviator[:, 0] - self.pressure

    @property
    def mises(self):
        """Von Mises stress [Pa], in three dimensions."""
        return np.array([von_mises(S) for S in self.deviator])


class Point(Points):
    """One or more particles of one material."""

    def __init__(self, eos, strength, density=7830.0, failure=None, spacing=1e-3, rate="jaumann", count=1, D=3):
        super().__init__([body_of(eos, strength, density, failure, spacing, D)], np.zeros(count, dtype=int), rate, D)


def von_mises(S):
    """Of a deviator (6,) in three dimensions."""
    return math.sqrt(1.5 * (S[:3] @ S[:3] + 2.0 * S[3:] @ S[3:]))
