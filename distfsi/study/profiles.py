"""A tube's state at one time beside the exact solution of its Riemann problem."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from distfsi.simulation import Simulation
from distfsi.study.exact import RiemannSolution
from distfsi.study.problems import centers, fields

MIDDLE = 0.2  # of the way between two waves, on both sides of its middle, counts as the plateau
AT_REST = 0.01  # of the shock's velocity: below that a plateau's velocity counts as zero


@dataclass(frozen=True)
class Profile:
    """Cell values of a tube whose states met at `interface` [m] at time zero: x [m], density, velocity, pressure."""

    solution: RiemannSolution
    interface: float
    time: float
    x: np.ndarray
    density: np.ndarray
    velocity: np.ndarray
    pressure: np.ndarray

    @classmethod
    def of(cls, simulation: Simulation, solution: RiemannSolution, interface: float) -> Profile:
        """The present state of a run in one dimension, on one rank."""
        found = fields(simulation)
        density, velocity, pressure = (found[name][0, 0] for name in ("density", "velocity", "pressure"))
        return cls(solution, interface, simulation.time, centers(simulation)[0], density, velocity[:, 0], pressure)

    @property
    def spacing(self) -> float:
        """Size of a cell [m]."""
        return self.x[1] - self.x[0]

    @property
    def values(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Density, velocity, pressure."""
        return self.density, self.velocity, self.pressure

    def exact(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Density, velocity, pressure of the exact solution in the same places."""
        return self.solution.sample((self.x - self.interface) / self.time)[:3]

    def errors(self) -> np.ndarray:
        """L1 errors of density, velocity and pressure."""
        return np.array([np.abs(a - b).sum() * self.spacing for a, b in zip(self.values, self.exact(), strict=True)])

    def shock(self) -> tuple[float, float]:
        """Where the right shock is, half-way up its pressure step, and where it should be [m]."""
        level = 0.5 * (self.solution.p_star + self.solution.right.pressure)
        last = np.flatnonzero(self.pressure > level)[-1]
        part = (self.pressure[last] - level) / (self.pressure[last] - self.pressure[last + 1])
        return self.x[last] + part * self.spacing, self.interface + self.solution.right_wave.head * self.time

    def plateaus(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Mean (density, velocity, pressure) well between the left wave, the contact and the right wave, and exact."""
        solution = self.solution
        speeds = (solution.left_wave.tail, solution.u_star, solution.right_wave.tail)
        ends = [self.interface + speed * self.time for speed in speeds]
        for low, high, rho in zip(ends, ends[1:], (solution.rho_star_left, solution.rho_star_right), strict=False):
            inside = np.abs(self.x - 0.5 * (low + high)) < MIDDLE * (high - low)
            yield np.array([v[inside].mean() for v in self.values]), np.array([rho, solution.u_star, solution.p_star])

    def plateau_error(self) -> float:
        """Largest relative error of a plateau's density, velocity or pressure; a velocity near zero is measured by the
        shock's."""
        shock, worst = abs(self.solution.right_wave.head), 0.0
        for state, expected in self.plateaus():
            scale = np.abs(expected)
            scale[1] = scale[1] if scale[1] > AT_REST * shock else shock
            worst = max(worst, float(np.max(np.abs(state - expected) / scale)))
        return worst
