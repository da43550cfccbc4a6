"""Problems with exact answers that methods are compared on: a scene, the exact state at its end, the error of a run.

Tubes are computed as many equal rows side by side, in two dimensions: so it is the work in the cells that is timed, as
in a user's run, and not what a step costs before it has any cells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, cast

import numpy as np

from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import of_kind, present
from distfsi.scene import load
from distfsi.scene.build import BLOCK_CELLS, TILE_CELLS
from distfsi.scene.description import Ball, BoundaryKind, Box, HalfSpace, Performance, Scene, Shape
from distfsi.scene.shipped import shipped_inputs
from distfsi.simulation import Simulation
from distfsi.study.exact import ExactEos, PureState, RiemannSolution, exact_riemann
from distfsi.study.radial import Rings, cylindrical_explosion

INPUTS = shipped_inputs()
PERIODIC: tuple[BoundaryKind, BoundaryKind] = ("periodic", "periodic")
QUANTITIES = ("density", "velocity", "pressure")

Exact = Callable[[Scene, Sequence[np.ndarray]], Sequence[np.ndarray]]


@dataclass(frozen=True)
class Problem:
    """An input with an exact answer.

    cells: along x, of the default resolution and of a quick look; rows: how many of them (None: as many as `cells`)
    exact: density, velocity along the way and pressure at cell centers (x, y) at the scene's end, as (y, x) arrays
    radial: whether the way goes away from the origin, else along x
    """

    name: str
    title: str
    input: str
    cells: int
    quick_cells: int
    rows: int | None
    exact: Exact
    radial: bool = False
    settings: tuple[str, ...] = ()

    def scene(self, cells: int, settings: Sequence[str] = ()) -> Scene:
        """The input on so many cells along x, the tubes in rows. Raises InputError."""
        size = f"[{cells},{cells}]" if self.rows is None else f"[{cells}]"
        scene = load(INPUTS / self.input, [*self.settings, f"domain.cells={size}", *settings])
        return scene if self.rows is None else in_rows(scene, self.rows)

    def errors(self, simulation: Simulation) -> np.ndarray:
        """L1 errors of density, velocity and pressure at the end of a run, each over its own mean size."""
        x, y = centers(simulation)[:2]
        found = fields(simulation)
        velocity = found["velocity"][0]
        along = velocity[..., 0]
        if self.radial:
            along = (velocity[..., 0] * x + velocity[..., 1] * y[:, None]) / np.hypot(x, y[:, None])
        exact = self.exact(simulation.scene, (x, y))
        pairs = zip((found["density"][0], along, found["pressure"][0]), exact, strict=True)
        return np.array([np.abs(a - b).mean() / np.abs(b).mean() for a, b in pairs])


def _in_the_plane(source: Any) -> Any:
    """A source of one dimension in two."""
    return replace(source, acceleration=(*source.acceleration, 0.0))


def in_rows(scene: Scene, rows: int) -> Scene:
    """A scene in one dimension as `rows` equal ones in two, periodic across."""
    domain, fluid = scene.domain, present(scene.fluid)
    upper = rows * domain.spacing[0]
    wide = replace(
        domain,
        lower=(*domain.lower, 0.0),
        upper=(*domain.upper, upper),
        cells=(*domain.cells, rows),
        boundaries=(*domain.boundaries, PERIODIC),
    )
    regions = tuple(
        replace(
            region,
            state=replace(region.state, velocity=(*region.state.velocity, 0.0)),
            shape=_extended(region.shape, upper),
        )
        for region in fluid.regions
    )
    return replace(
        scene,
        domain=wide,
        sources=tuple(_in_the_plane(source) for source in scene.sources),
        fluid=replace(fluid, regions=regions, inflow=(*fluid.inflow, (None, None))),
        performance=Performance(BLOCK_CELLS[1], TILE_CELLS[1]),
    )


def _extended(shape: Shape | None, upper: float) -> Shape | None:
    match shape:
        case None:
            return None
        case Box(lower=low, upper=high):
            return Box((*low, 0.0), (*high, upper))
        case HalfSpace(point=point, normal=normal):
            return HalfSpace((*point, 0.0), (*normal, 0.0))
    raise TypeError(f"{shape} has no rows")


def centers(simulation: Simulation) -> list[np.ndarray]:
    """Cell centers along each axis of the domain [m]."""
    domain = simulation.scene.domain
    parts = zip(domain.lower, domain.spacing, domain.cells, strict=True)
    return [low + h * (np.arange(n) + 0.5) for low, h, n in parts]


def fields(simulation: Simulation) -> dict[str, np.ndarray]:
    """Primitive fields (z, y, x[, 3]) of the whole domain, float64; of a run on one rank."""
    blocks, result = simulation.blocks, {}
    for name, parts in present(simulation.fluid).outputs().items():
        whole = np.empty((*blocks.grid.cells[::-1], *parts.shape[4:]))
        for part, (x, y, z), (n, m, l) in zip(parts, blocks.origin, blocks.extent, strict=True):
            whole[z : z + l, y : y + m, x : x + n] = part[:l, :m, :n]
        result[name] = whole
    return result


def start(scene: Scene, threads: int = 1) -> Simulation:
    """The scene at time 0 on this rank."""
    return Simulation.of(scene, Communicator(), threads)


# ---- exact states ----------------------------------------------------------------------------------------------------


def riemann_of(scene: Scene) -> tuple[RiemannSolution, float]:
    """The exact solution of a tube whose second region is right of a plane, and the plane's x [m]."""
    phases, (left, right) = present(scene.fluid).phases, present(scene.fluid).regions[:2]
    side, other = (PureState(r.state.density, r.state.pressure, r.state.velocity[0]) for r in (left, right))
    eos, other_eos = (cast(ExactEos, phases[r.state.phase].eos) for r in (left, right))
    return exact_riemann(side, other, eos, other_eos), of_kind(HalfSpace, right.shape).point[0]


def tube(scene: Scene, centers: Sequence[np.ndarray]) -> Sequence[np.ndarray]:
    """The exact waves of a tube, the same in every row."""
    solution, interface = riemann_of(scene)
    rows = np.ones((len(centers[1]), 1))
    return [rows * values for values in solution.sample((centers[0] - interface) / scene.time.end)[:3]]


def slab(scene: Scene, centers: Sequence[np.ndarray]) -> Sequence[np.ndarray]:
    """A slab that has moved through the whole domain: as at the start."""
    regions, x = present(scene.fluid).regions, centers[0]
    outside, inside = (region.state for region in regions)
    box = of_kind(Box, regions[1].shape)
    density = np.where((x > box.lower[0]) & (x < box.upper[0]), inside.density, outside.density)
    rows = np.ones((len(centers[1]), len(x)))
    return rows * density, rows * outside.velocity[0], rows * outside.pressure


RINGS = 2500  # of the radial computation, from the axis to a side of the domain


def explosion(scene: Scene, centers: Sequence[np.ndarray]) -> Sequence[np.ndarray]:
    """The underwater explosion by the radial computation."""
    return _rings(scene).sample(np.hypot(centers[0], centers[1][:, None]))


def _rings(scene: Scene) -> Rings:
    phases, regions = present(scene.fluid).phases, present(scene.fluid).regions
    water, gas = (PureState(r.state.density, r.state.pressure) for r in regions)
    eos_water, eos_gas = (phases[r.state.phase].eos for r in regions)
    radius, side = of_kind(Ball, regions[1].shape).radius, scene.domain.upper[0]
    eos = StiffenedGas(of_kind(IdealGas, eos_gas).gamma, 0.0), eos_water
    return _rings_of(gas, water, *eos, radius, side, scene.time.end, side / RINGS)


_rings_of = cache(cylindrical_explosion)

SOD = Problem("sod", "Sod's tube", "sod.toml", 400, 50, 128, tube)
WATER_AIR = Problem("water_air", "Water at 1 GPa against air at 50 kg/m3", "water_air.toml", 1000, 50, 32, tube)
INTERFACE = Problem("interface", "Slab of water in air, once around", "interface.toml", 200, 32, 64, slab)
EXPLOSION = Problem(
    "explosion",
    "Cylindrical underwater explosion",
    "undex_2d.toml",
    200,
    40,
    None,
    explosion,
    True,
    ("time.end=1e-4", "domain.lower=[0,0]", 'domain.x=["symmetry","outflow"]', 'domain.y=["symmetry","outflow"]'),
)
PROBLEMS = (SOD, WATER_AIR, INTERFACE, EXPLOSION)
