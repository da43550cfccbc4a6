"""The particles of a solid as the wall that they make: where, how many points each, how much images of them count."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.inflation import ThinBodies
from distfsi.coupling.cut_cells.kernels import images
from distfsi.coupling.cut_cells.kernels import particles as kernels
from distfsi.coupling.cut_cells.kernels.particles import Domain
from distfsi.coupling.cut_cells.values import Passage, WallMotion
from distfsi.coupling.cut_cells.wall_points import WallPoints
from distfsi.coupling.kernels.interpolation import Cloud
from distfsi.coupling.particles import SolidParticles
from distfsi.mesh.particles import GhostPlan, ParticleExchange

MIRRORS = ("symmetry", "wall", "outflow", "inflow")
DRIVERS = (
    kernels.keep_mass,
    kernels.keep_inside,
    kernels.find_volumes,
    kernels.mark_stretched,
    kernels.find_middle,
    images.weigh_images,
    images.fade_images,
)


class WallParticles:
    """Finds the wall that the particles make, and cuts the cells with it.

    thin  bodies (coupling/cut_cells/inflation.py)
    """

    def __init__(
        self, particles: SolidParticles, exchange: ParticleExchange, kernels: SimpleNamespace, wall: WallGeometry
    ):
        """`kernels` holds DRIVERS."""
        grid = wall.blocks.grid
        self._particles, self._exchange, self._kernels, self._wall = particles, exchange, kernels, wall
        self._D = grid.dimensions
        self._device, self._communicator = wall.device, wall.blocks.communicator
        cell = max(grid.spacing[: grid.dimensions])
        self._points = WallPoints(particles, exchange.rows, kernels, cell)
        self.thin = ThinBodies(particles, wall, cell)
        corners = np.array([grid.lower, grid.upper])[:, : self._D]
        self._domain = Domain(*map(self._device.array, corners))
        # A body that a symmetry plane cuts goes on behind it, so that the plane takes nothing of its particles.
        symmetric = np.array(grid.boundaries[: self._D]).T == "symmetry"
        self._whole = Domain(*map(self._device.array, np.where(symmetric, [[-np.inf], [np.inf]], corners)))

    def find(self, start: Any) -> Passage:
        """Collective. Find the particles, which have moved from `start` (own, D) [m]."""
        device, own = self._device, self._particles.count
        own_middle, way = device.empty(start.shape), device.empty(own)
        device.run(self._kernels.find_middle, own, start, self._particles.position, own_middle, way)
        stretched = self._points.stretched()
        largest = np.array([self._exchange.rows.largest(way, 0.0), float(stretched.shape[0])])
        farthest, split = self._communicator.maximum(largest)
        plan = self._ghosts(start, self._particles.id)
        (middle,) = plan.exchange([(own_middle, "position")])
        bins = self._wall.sort(middle, plan.key.device)
        return Passage(plan, own_middle, middle, bins, stretched, bool(split > 0.0), float(farthest))

    def cut(self, passage: Passage, start: Any, velocity: Any) -> WallMotion:
        """Collective. Cut the cells where the particles are, which have moved from `start` (own, D) [m] with a
        `velocity` (own, D) [m/s]."""
        p, device, own, k, plan = self._particles, self._device, self._particles.count, self._kernels, passage.plan
        # masses and velocities of all that are seen
        own_mass = device.empty(own)
        device.run(k.keep_mass, own, start, p.read("lone"), p.mass, p.density, self._whole, own_mass)
        vector = tuple((a,) for a in range(self._D))
        moving, mass = plan.exchange([(velocity, vector), (own_mass, ((),))])
        # the points of the wall, with the images that count
        position, size, points_plan = p.position, self._points.volumes(), plan
        if passage.split:
            position, size, number = self._points.of(passage.stretched)
            points_plan = self._ghosts(position, number)
        points = self._points_inside(points_plan, position, size)
        image, faded = self._weigh_images(points_plan, position, size, points_plan, points)
        device.run(k.fade_images, points_plan.count, points_plan.key.device, faded, 2, points.values.reshape(-1))
        if passage.split:
            image, faded = self._weigh_images(plan, p.position, self._points.volumes(), points_plan, points)
        device.run(k.fade_images, plan.count, plan.key.device, faded, 1, mass)
        # the cells
        sphere = self.thin.spheres(points_plan, points, passage.split)
        self._wall.cut(points, sphere, points_plan.key.device)
        return WallMotion(passage, own_mass, mass, moving, image)

    def _ghosts(self, position: Any, id: np.ndarray) -> GhostPlan:
        """Collective. Who needs copies of which particles or points."""
        farthest = self._wall.ranges.farthest
        return self._exchange.ghosts(position, id, self._wall.reach, image_reach=farthest, mirrors=MIRRORS)

    def _points_inside(self, plan: GhostPlan, position: Any, size: Any) -> Cloud:
        """Collective. The points of a plan; values (count, 2): what of the volume `size` (own, 1) [m^D] of each is in
        the domain, and all of it."""
        inside = self._device.empty((position.shape[0], 2))
        self._device.run(self._kernels.keep_inside, position.shape[0], position, size, self._whole, inside)
        position, volume = plan.exchange([(position, "position"), (inside, ((), ()))])
        return Cloud(position, volume, self._wall.sort(position, plan.key.device))

    def _weigh_images(
        self, plan: GhostPlan, position: Any, size: Any, points_plan: GhostPlan, points: Cloud
    ) -> tuple[Any, Any]:
        """Collective. How much images along each axis count of the particles at a `position` (own, D) [m], of a `size`
        (own, 1) [m^D], beside the `points` of all bodies: (own, D) and (count, D) of the plan."""
        own, key = position.shape[0], points_plan.key.device
        weight, ranges = self._device.empty((own, self._D)), self._wall.ranges
        self._device.run(self._kernels.weigh_images, own, weight, position, size, self._domain, ranges, key, points)
        (extended,) = plan.exchange([(weight, ((),) * self._D)])
        return weight, extended
