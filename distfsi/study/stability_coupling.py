"""Where each scheme of the coupling survives: light bodies, thin shells, strong shocks, long time steps.

A run has survived when it reaches its end with a valid state, nothing has got through the body, and the body's velocity
does not ring.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt
from pathlib import Path

import numpy as np

from distfsi.errors import Diverged
from distfsi.laws.law import FluidEos
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.none import NoStrength
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.scene.description import (
    Ball,
    Body,
    Box,
    Coupling,
    CouplingScheme,
    Domain,
    Fluid,
    FluidState,
    Output,
    Performance,
    Phase,
    Region,
    Scene,
    Shape,
    Solid,
    Time,
    Tube,
)
from distfsi.simulation import Simulation
from distfsi.study.exact import RIGHTWARD, PureState, wave_into
from distfsi.study.references import AIR, STEEL, STEEL_DENSITY, WATER
from distfsi.study.stability import Map, Stability, Verdict, corners

DIRECTORY = Path("out/study_stability_coupling")
SCHEMES: dict[str, CouplingScheme] = {
    "cut cells": "cut_cells",
    "staircase": "staircase",
    "immersed boundary": "immersed_boundary",
}
SURVIVED, RANG, LEAKED, FAILED = range(4)
VERDICTS = {"survived": "tab:green", "rang": "tab:olive", "leaked": "tab:orange", "failed": "tab:red"}
CFL = (0.1, 0.5, 0.9)
CELLS, ACROSS = 50, 24  # cells along a tube; across the box of a shell
SWINGS = 1.2  # total variation of the body's velocity over its range
LEAK = 1e-9  # of the mass behind the wall
MAXIMUM_STEPS = 4000


def scene_of(
    scheme: CouplingScheme,
    cfl: float,
    eos: FluidEos,
    regions: Sequence[tuple[PureState, Shape | None]],
    body: Body,
    lower: tuple[float, ...],
    upper: tuple[float, ...],
    cells: tuple[int, ...],
    end: float,
) -> Scene:
    """A body in one gas or liquid, in a closed box."""
    D = len(cells)
    states = [
        Region(FluidState(0, s.density, s.pressure, (s.velocity,) + (0.0,) * (D - 1)), where) for s, where in regions
    ]
    fluid = Fluid((Phase("fluid", eos),), tuple(states), "minmod", 1e-6, ((None, None),) * D, "float64")
    return Scene(
        "stability",
        Domain(lower, upper, cells, (("wall", "wall"),) * D),
        Time(end, cfl, None),
        fluid,
        Solid((body,), 1.3, 0.5, 1.0),
        Output("", 0.0, 1),
        Performance((CELLS,) * D, (CELLS,) * D),
        coupling=Coupling(scheme),
    )


def judge(scene: Scene, leaked: Callable[[Simulation], float], moves: bool = True) -> Verdict:
    """Run a scene; what becomes of it. `leaked` tells the mass behind the wall; only what moves can ring."""
    simulation = Simulation.of(scene, Communicator(), 1)
    solid, before, velocity = present(simulation.solid), leaked(simulation), [0.0]
    try:
        while not simulation.done:
            simulation.step()
            totals = solid.totals()
            velocity.append(totals["momentum"][0] / totals["mass"])
            if simulation.steps > MAXIMUM_STEPS:
                return FAILED, "the time step shrinks"
        simulation.check()
    except Diverged as error:
        return FAILED, str(error).partition(" at t")[0]
    change = abs(leaked(simulation) / before - 1.0)
    if change > LEAK:
        return LEAKED, f"mass {change:.1e}"
    swings = np.abs(np.diff(velocity)).sum() / max(np.ptp(velocity), 1e-12 * np.abs(velocity).max() + 1e-300)
    return (RANG, f"{swings:.2f}") if moves and swings > SWINGS else (SURVIVED, "")


def mass_beyond(simulation: Simulation, inside: Callable[[Sequence[np.ndarray]], np.ndarray]) -> float:
    """Mass [kg] in the cells of the only block whose centers (x, y) are `inside`."""
    fluid, blocks = present(simulation.fluid), simulation.blocks
    density = fluid.cells(0)[0] * fluid.active(present(simulation.coupling).volume, 0)
    x, y, _ = blocks.cell_centers(0)
    grid = np.meshgrid(np.asarray(y), np.asarray(x), indexing="ij")[::-1]
    return float(density[0][inside(grid)].sum())


def fluid_mass(simulation: Simulation) -> float:
    """Mass [kg] of the fluid."""
    return float(present(simulation.fluid).totals(present(simulation.coupling).volume)[0][0])


def pushed(scheme: CouplingScheme, ratio: float, cfl: float) -> Verdict:
    """A plate two cells thick, so many times as dense as the gas, pressed by 10 : 1."""
    h = 1.0 / CELLS
    plate = Body(
        "plate", Box((0.4,), (0.4 + 2 * h,)), 0.5 * h, ratio, (0.0,), LinearEos(100.0 * sqrt(ratio)), NoStrength(), None
    )
    regions = [(PureState(1.0, 1.0), None), (PureState(1.0, 10.0), Box((0.0,), (0.4 + h,)))]
    end = min(0.3, 0.02 * sqrt(ratio))
    scene = scene_of(scheme, cfl, AIR, regions, plate, (0.0,), (1.0,), (CELLS,), end)
    return judge(scene, fluid_mass)


def shell(scheme: CouplingScheme, ratio: float, thickness: float) -> Verdict:
    """A heavy ring, its wall so many cells thick, around gas of so many times the pressure outside."""
    h, radius = 1.0 / ACROSS, 0.3
    spacing = min(0.5, thickness) * h
    ring = Body(
        "shell",
        Tube((0.5, 0.5), radius, radius + thickness * h),
        spacing,
        1e6 * ratio,
        (0.0, 0.0),
        LinearEos(1e6 * ratio),
        NoStrength(),
        None,
    )
    inside = Ball((0.5, 0.5), radius + 0.5 * thickness * h)
    regions = [(PureState(1.0, 1.0), None), (PureState(sqrt(ratio), ratio), inside)]
    scene = scene_of(
        scheme, 0.5, AIR, regions, ring, (0.0, 0.0), (1.0, 1.0), (ACROSS,) * 2, 3.0 * h / sqrt(1.4 * sqrt(ratio))
    )
    middle = radius + 0.5 * thickness * h
    return judge(scene, lambda s: mass_beyond(s, lambda x: np.hypot(x[0] - 0.5, x[1] - 0.5) > middle), moves=False)


def hit(scheme: CouplingScheme, pressure: float, cfl: float) -> Verdict:
    """A shock in water of so many pascals hits a steel plate of ten cells in water."""
    h, ahead = 1.0 / CELLS, PureState(1000.0, 1e5)
    behind = wave_into(ahead, WATER, pressure, RIGHTWARD).behind
    plate = Body("plate", Box((0.4,), (0.5,)), 0.5 * h, STEEL_DENSITY, (0.0,), STEEL, NoStrength(), None)
    regions = [(ahead, None), (behind, Box((0.0,), (0.35,)))]
    scene = scene_of(scheme, cfl, WATER, regions, plate, (0.0,), (1.0,), (CELLS,), 5e-5)
    return judge(scene, fluid_mass)


def carried(scheme: CouplingScheme, ratio: float, cfl: float) -> Verdict:
    """A wave in water takes along a plate two cells thick, so many times as dense as the water on both its sides."""
    h, ahead = 1.0 / CELLS, PureState(1000.0, 1e5)
    behind = wave_into(ahead, WATER, 1e6, RIGHTWARD).behind
    density = 1000.0 * ratio
    plate = Body(
        "plate", Box((0.41,), (0.41 + 2 * h,)), 0.5 * h, density, (0.0,), LinearEos(2.64e9), NoStrength(), None
    )
    regions = [(ahead, None), (behind, Box((0.0,), (0.35,)))]
    scene = scene_of(scheme, cfl, WATER, regions, plate, (0.0,), (1.0,), (CELLS,), 2e-4)
    return judge(scene, fluid_mass)


MAPS = (
    Map(
        "density",
        "Plate in gas, pressed by 10 : 1",
        "density of the body over that of the gas",
        (1.0, 10.0, 100.0, 1e3, 1e4),
        "CFL number",
        CFL,
        pushed,
    ),
    Map(
        "thickness",
        "Ring around compressed gas: walls at all angles",
        "pressure ratio",
        (10.0, 1e3, 1e5),
        "thickness of the wall in cells",
        (0.5, 1.0, 2.0, 4.0),
        shell,
    ),
    Map(
        "impact",
        "Shock in water hits a steel plate",
        "pressure [Pa]",
        (1e6, 1e7, 1e8, 1e9, 1e10),
        "CFL number",
        CFL,
        hit,
    ),
    Map(
        "lightness",
        "A wave in water takes a plate along",
        "density of the body over that of the water",
        (0.1, 0.3, 1.0, 3.0),
        "CFL number",
        CFL,
        carried,
    ),
)
STUDY = Stability("stability coupling", DIRECTORY, VERDICTS)


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Four runs of each map."""
    STUDY.run(communicator, SCHEMES, [corners(shown) for shown in MAPS], overrides)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run all schemes on all maps; leave a CSV file and a sheet per map in DIRECTORY."""
    STUDY.run(communicator, SCHEMES, MAPS, overrides)
