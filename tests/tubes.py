"""Small flows in the computer's memory: scenes written in code, run without any output file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from distfsi.mesh.communicator import Communicator
from distfsi.scene.description import (
    Box,
    Domain,
    Fluid,
    FluidEos,
    FluidState,
    Output,
    Performance,
    Phase,
    Region,
    Scene,
    Time,
)
from distfsi.simulation import Simulation
from distfsi.study.exact import PureState, RiemannSolution, exact_riemann

BLOCKS = {1: (512,), 2: (128, 64), 3: (32, 32, 32)}
TRACE = 1e-6
OPEN = ("outflow", "outflow")
PERIODIC = ("periodic", "periodic")


def scene_of(
    eos: tuple[FluidEos, ...],
    regions: tuple[Region, ...],
    lower: tuple[float, ...],
    upper: tuple[float, ...],
    cells: tuple[int, ...],
    end: float,
    boundaries: tuple[tuple[str, str], ...] | None = None,
    cfl: float = 0.5,
    scheme: str = "rk3",
    performance: Performance | None = None,
    **method: object,
) -> Scene:
    """A scene of one or two materials; `method`: what differs from minmod and HLLC in float64."""
    dimensions = len(cells)
    phases = tuple(Phase(f"phase {k}", material) for k, material in enumerate(eos))
    fluid = Fluid(
        phases, regions, inflow=((None, None),) * dimensions,
        **{"reconstruction": "minmod", "minimum_volume_fraction": TRACE, "precision": "float64"} | method,
    )  # fmt: skip
    return Scene(
        title="",
        domain=Domain(lower, upper, cells, boundaries or (OPEN,) * dimensions),
        time=Time(end, cfl, None, scheme=scheme),
        gravity=(0.0,) * dimensions,
        fluid=fluid,
        solid=None,
        output=Output("", 0.0, 10),
        performance=performance or Performance(BLOCKS[dimensions], BLOCKS[dimensions]),
    )


def start(scene: Scene) -> Simulation:
    """The scene at time 0, on one thread."""
    return Simulation.of(scene, Communicator(), threads=1)


def advance(simulation: Simulation) -> Simulation:
    """Run to the scene's end."""
    while not simulation.done:
        simulation.step()
    return simulation


def fields(simulation: Simulation) -> dict[str, np.ndarray]:
    """Primitive fields (z, y, x[, 3]) of the whole domain, float64; of one process."""
    blocks, result = simulation.blocks, {}
    for name, parts in simulation.fluid.outputs().items():
        whole = np.empty((*blocks.grid.cells[::-1], *parts.shape[4:]))
        for part, (x, y, z), (n, m, l) in zip(parts, blocks.origin, blocks.extent, strict=True):
            whole[z : z + l, y : y + m, x : x + n] = part[:l, :m, :n]
        result[name] = whole
    return result


def centers(simulation: Simulation) -> list[np.ndarray]:
    """Cell centers along each axis of the domain [m]."""
    domain = simulation.scene.domain
    parts = zip(domain.lower, domain.spacing, domain.cells, strict=True)
    return [low + h * (np.arange(n) + 0.5) for low, h, n in parts]


def radii(simulation: Simulation) -> list[np.ndarray]:
    """Distance (z, y, x) of the active cells of each block from the origin [m]."""
    D, blocks = simulation.fluid.model.dimensions, simulation.blocks
    result = []
    for block in range(blocks.local_count):
        grid = np.meshgrid(*blocks.cell_centers(block)[2::-1], indexing="ij")[::-1]
        result.append(np.sqrt(sum(x**2 for x in grid[:D])))
    return result


def radial_mean(simulation: Simulation, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean of a field in rings as wide as a cell: their radii and values; up to the nearest side of the domain."""
    grid = np.meshgrid(*centers(simulation)[::-1], indexing="ij")
    r = np.sqrt(sum(x**2 for x in grid)).ravel()
    h, upper = simulation.scene.domain.spacing[0], min(simulation.scene.domain.upper)
    ring, count = (r / h).astype(int), int(round(upper / h))
    number = np.bincount(ring)[:count]
    return h * (np.arange(count) + 0.5), np.bincount(ring, fields(simulation)[name].ravel())[:count] / number


@dataclass(frozen=True)
class Tube:
    """Two states that meet at `interface` on [lower, upper] m, looked at after `time` s."""

    left: PureState
    right: PureState
    eos_left: FluidEos
    eos_right: FluidEos
    interface: float
    time: float
    lower: float = 0.0
    upper: float = 1.0

    @property
    def exact(self) -> RiemannSolution:
        return exact_riemann(self.left, self.right, self.eos_left, self.eos_right)

    def scene(self, cells: int, **method: object) -> Scene:
        """Of two phases if the materials differ, else of one."""
        eos = (self.eos_left,) if self.eos_left == self.eos_right else (self.eos_left, self.eos_right)
        left = FluidState(0, self.left.density, self.left.pressure, (self.left.velocity,))
        right = FluidState(len(eos) - 1, self.right.density, self.right.pressure, (self.right.velocity,))
        regions = (Region(right, None), Region(left, Box((self.lower,), (self.interface,))))
        return scene_of(eos, regions, (self.lower,), (self.upper,), (cells,), self.time, **method)

    def run(self, cells: int, **method: object) -> Profile:
        """The profile at the end."""
        simulation = advance(start(self.scene(cells, **method)))
        density, velocity, pressure = (fields(simulation)[name][0, 0] for name in ("density", "velocity", "pressure"))
        return Profile(self, centers(simulation)[0], density, velocity[:, 0], pressure)


@dataclass(frozen=True)
class Profile:
    """Cell values of a tube at its end: x [m], density, velocity, pressure."""

    tube: Tube
    x: np.ndarray
    density: np.ndarray
    velocity: np.ndarray
    pressure: np.ndarray

    @property
    def spacing(self) -> float:
        return self.x[1] - self.x[0]

    @property
    def values(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.density, self.velocity, self.pressure

    def exact(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Density, velocity, pressure of the exact solution in the same places."""
        return self.tube.exact.sample((self.x - self.tube.interface) / self.tube.time)[:3]

    def errors(self) -> np.ndarray:
        """L1 errors of density, velocity and pressure."""
        return np.array([np.abs(a - b).sum() * self.spacing for a, b in zip(self.values, self.exact(), strict=True)])

    def shock(self) -> tuple[float, float]:
        """Where the right shock is, half-way up its pressure step, and where it should be [m]."""
        solution = self.tube.exact
        level = 0.5 * (solution.p_star + self.tube.right.pressure)
        last = np.flatnonzero(self.pressure > level)[-1]
        part = (self.pressure[last] - level) / (self.pressure[last] - self.pressure[last + 1])
        return self.x[last] + part * self.spacing, self.tube.interface + solution.right_wave.head * self.tube.time

    def plateaus(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Mean (density, velocity, pressure) well between the left wave, the contact and the right wave, and exact."""
        solution = self.tube.exact
        speeds = (solution.left_wave.tail, solution.u_star, solution.right_wave.tail)
        ends = [self.tube.interface + speed * self.tube.time for speed in speeds]
        for low, high, rho in zip(ends, ends[1:], (solution.rho_star_left, solution.rho_star_right), strict=False):
            inside = np.abs(self.x - 0.5 * (low + high)) < 0.2 * (high - low)
            yield np.array([v[inside].mean() for v in self.values]), np.array([rho, solution.u_star, solution.p_star])
