"""Small flows in the computer's memory: scenes written in code, run without any output file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distfsi.coordinates import coordinates_of
from distfsi.laws.law import FluidEos, Source
from distfsi.scene.description import Box, Domain, Fluid, FluidState, Output, Performance, Phase, Region, Scene, Time
from distfsi.simulation import Simulation
from distfsi.study.exact import PureState, RiemannSolution, exact_riemann
from distfsi.study.problems import centers, fields, start
from distfsi.study.profiles import Profile

__all__ = ["Tube", "advance", "centers", "fields", "radii", "scene_of", "start"]

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
    sources: tuple[Source, ...] = (),
    symmetry: str = "planar",
    **method: object,
) -> Scene:
    """A scene of one or two materials; `method`: what differs from minmod and HLLC in float64."""
    dimensions = len(cells)
    phases = tuple(Phase(f"phase {k}", material) for k, material in enumerate(eos))
    fluid = Fluid(
        phases,
        regions,
        inflow=((None, None),) * dimensions,
        **{"reconstruction": "minmod", "minimum_volume_fraction": TRACE, "precision": "float64"} | method,
    )
    return Scene(
        title="",
        domain=Domain(lower, upper, cells, boundaries or (OPEN,) * dimensions, coordinates_of(symmetry)),
        time=Time(end, cfl, None, scheme=scheme),
        fluid=fluid,
        solid=None,
        output=Output("", 0.0, 10),
        performance=performance or Performance(BLOCKS[dimensions], BLOCKS[dimensions]),
        sources=sources,
    )


def advance(simulation: Simulation) -> Simulation:
    """Run to the scene's end."""
    while not simulation.done:
        simulation.step()
    return simulation


def radii(simulation: Simulation) -> list[np.ndarray]:
    """Distance (z, y, x) of the active cells of each block from the origin [m]."""
    D, blocks = simulation.fluid.model.dimensions, simulation.blocks
    result = []
    for block in range(blocks.local_count):
        grid = np.meshgrid(*blocks.cell_centers(block)[2::-1], indexing="ij")[::-1]
        result.append(np.sqrt(sum(x**2 for x in grid[:D])))
    return result


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
        return Profile.of(advance(start(self.scene(cells, **method))), self.exact, self.interface)
