"""The particles of a solid as the wall that they make: where, how many points each, how much images of them count."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.geometry import WallGeometry
from distfsi.coupling.cut_cells.kernels import forces as cut_forces
from distfsi.coupling.cut_cells.kernels import images
from distfsi.coupling.cut_cells.thickness import Thickness
from distfsi.coupling.cut_cells.wall_points import WallPoints
from distfsi.mesh.particles import GhostPlan, ParticleExchange
from distfsi.solid.protocol import Structure

MIRRORS = ("symmetry", "wall", "outflow", "inflow")
DRIVERS = (
    cut_forces.keep_mass,
    cut_forces.keep_inside,
    cut_forces.find_volumes,
    cut_forces.mark_stretched,
    cut_forces.find_middle,
    images.weigh_images,
    images.fade_images,
)


class WallParticles:
    """Own particles first, then ghosts and images, all that this rank's cells see.

    plan        who needs copies of which particles
    own_middle, middle  (own, D), (count, D) [m]: of their ways in the step; bins: the search cells of these
    own_mass, mass      (own,), (count,) [kg], 0 of those that are no wall
    velocity    (count, D) [m/s] with which they have moved
    image       (own, D): how much the images of a particle along each axis count
    thickness   of bodies (coupling/cut_cells/thickness.py)
    """

    def __init__(self, solid: Structure, exchange: ParticleExchange, kernels: SimpleNamespace, wall: WallGeometry):
        """`kernels` holds DRIVERS."""
        grid = wall.blocks.grid
        self._solid, self._exchange, self._kernels, self._wall = solid, exchange, kernels, wall
        self._D = grid.dimensions
        self._team, self._communicator = wall.team, wall.blocks.communicator
        cell = max(grid.spacing[: grid.dimensions])
        self._points = WallPoints(exchange.rows, kernels, cell)
        self.thickness = Thickness(solid.columns, wall, cell)
        self._corners = [self._team.array(np.array(corner)) for corner in (grid.lower, grid.upper)]

    def look(self, start: Any) -> float:
        """Collective. Find the particles, which have moved from `start`; how far one did at most along an axis [m]."""
        c, team, own = self._solid.columns, self._team, self._solid.count
        self.own_middle, way = team.empty(start.shape), team.empty(own)
        team.run(self._kernels.find_middle, own, start, *c.read("position"), self.own_middle, way)
        self._stretched = self._points.stretched(c)
        most = np.array([self._exchange.rows.largest(way, 0.0), float(self._stretched.shape[0])])
        farthest, split = self._communicator.maximum(most)
        self._split = split > 0.0
        self.plan = self._ghosts(start, c["id"])
        (self.middle,) = self.plan.exchange([(self.own_middle, "position")])
        self.bins = self._wall.sort(self.middle, self.plan.key.device)
        return farthest

    def cut(self, start: Any, velocity: Any) -> None:
        """Collective, after look(). Cut the cells where the particles are, which have moved from `start` with
        `velocity`."""
        c, team, wall, own, k = self._solid.columns, self._team, self._wall, self._solid.count, self._kernels
        self.own_mass, known = team.empty(own), c.read("dust", "mass", "density")
        team.run(k.keep_mass, own, start, *known, *self._corners, self.own_mass)
        vector = tuple((a,) for a in range(self._D))
        self.velocity, self.mass = self.plan.exchange([(velocity, vector), (self.own_mass, ((),))])
        (point,), size, plan = c.read("position"), self._points.volumes(c), self.plan
        if self._split:
            point, size, number = self._points.of(c, self._stretched)
            plan = self._ghosts(point, number)
        inside = team.empty((point.shape[0], 2))
        team.run(k.keep_inside, point.shape[0], point, size, *self._corners, inside)
        position, volume = plan.exchange([(point, "position"), (inside, ((), ()))])
        bins = wall.sort(position, plan.key.device)
        points = (plan.key.device, volume, position, *bins)
        self.image, image = self._weigh_images(plan, point, size, points)
        team.run(k.fade_images, plan.count, plan.key.device, image, 2, volume.reshape(-1))
        if self._split:
            self.image, image = self._weigh_images(self.plan, *c.read("position"), self._points.volumes(c), points)
        team.run(k.fade_images, self.plan.count, self.plan.key.device, image, 1, self.mass)
        ball = self.thickness.balls(c, plan, position, volume, bins, self._split)
        wall.cut(position, volume, ball, plan.key.device, bins)

    def _ghosts(self, position: Any, id: np.ndarray) -> GhostPlan:
        """Collective. Who needs copies of which particles or points."""
        return self._exchange.ghosts(position, id, self._wall.reach, image_reach=self._wall.images, mirrors=MIRRORS)

    def _weigh_images(self, plan: GhostPlan, place: Any, size: Any, points: tuple[Any, ...]) -> tuple[Any, Any]:
        """Collective. How much images along each axis count of the particles at a `place` (own, D) [m], of a `size`
        (own, 1) [m^D], beside the `points` of all bodies: (own, D) and (count, D) of the plan."""
        own, wall = place.shape[0], self._wall
        weight = self._team.empty((own, self._D))
        known = (*self._corners, *wall.touching, wall.images, *points)
        self._team.run(self._kernels.weigh_images, own, weight, place, size, *known)
        (extended,) = plan.exchange([(weight, ((),) * self._D)])
        return weight, extended
