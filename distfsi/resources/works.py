"""Standard scenes: the work that benchmarks time. Lengths are in cells, so that a cell has the size one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.laws.law import FluidEos
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.eos.mie_grueneisen import MieGrueneisen
from distfsi.laws.solid.failure.johnson_cook import JohnsonCookFailure
from distfsi.laws.solid.scatter import Scatter
from distfsi.laws.solid.strength.johnson_cook import JohnsonCook
from distfsi.laws.solid.strength.perfectly_plastic import PerfectlyPlastic
from distfsi.narrowing import present
from distfsi.scene import description as scene
from distfsi.scene.build import BLOCK_CELLS, TILE_CELLS

Precision = Literal["float64", "float32"]
AIR, HELIUM, WATER = IdealGas(1.4), IdealGas(1.67), StiffenedGas(4.4, 6e8)
TNT = Jwl(1630.0, 3.712e11, 3.21e9, 4.15, 0.95, 0.3)
COPPER = MieGrueneisen(3940.0, 1.489, 0.0, 0.0, 1.99, 0.0)
COPPER_STRENGTH = JohnsonCook(46e9, 90e6, 292e6, 0.31, 0.025, 1.09, 1.0, 293.0, 1356.0, 383.0, 0.9)
SMOOTHING = 1.3
BURNT_TNT, AMBIENT_AIR = (1630.0, 8.376e9), (1.225, 101325.0)  # density, pressure


def gases(
    cells: tuple[int, ...],
    eos: tuple[FluidEos, ...],
    inner: tuple[float, float],
    outer: tuple[float, float],
    precision: Precision = "float64",
) -> scene.Scene:
    """A ball of one material (density, pressure) in another, in a closed box; the standard fluid work."""
    D = len(cells)
    rest = (0.0,) * D
    phases = tuple(scene.Phase(f"phase {k}", e) for k, e in enumerate(eos))
    outside = scene.FluidState(len(eos) - 1, *outer, rest)
    inside = scene.FluidState(0, *inner, rest)
    ball = scene.Ball(tuple(0.5 * n for n in cells), 0.25 * min(cells))
    regions = (scene.Region(outside, None), scene.Region(inside, ball))
    fluid = scene.Fluid(phases, regions, "minmod", 1e-6, ((None, None),) * D, precision)
    domain = scene.Domain(rest, tuple(float(n) for n in cells), cells, (("wall", "wall"),) * D)
    return _endless(domain, fluid, None)


def copper(particles: int, dimensions: int, form: scene.SolidForm = "updated_lagrangian") -> scene.Scene:
    """A cube of elastic-plastic copper, so many particles long, that moves freely; the standard solid work."""
    D, side = dimensions, 0.5 * particles
    domain = scene.Domain(
        (-0.5 * side,) * D, (1.5 * side,) * D, (max(4, particles),) * D, (("outflow", "outflow"),) * D
    )
    return _endless(domain, None, _cube((0.0,) * D, (side,) * D, form))


def blast_on_copper(cells: int, dimensions: int, thickness: float | None = None) -> scene.Scene:
    """Copper in the way of exploding TNT, a cube or a plate `thickness` cells thick; the standard coupled works."""
    D, side = dimensions, 0.25 * cells
    blast = gases((cells,) * D, (TNT, AIR), BURNT_TNT, AMBIENT_AIR)
    cube = _cube((0.75 * cells,) + (0.375 * cells,) * (D - 1), (thickness or side,) + (side,) * (D - 1))
    domain = scene.Domain(blast.domain.lower, blast.domain.upper, blast.domain.cells, (("outflow", "outflow"),) * D)
    return _endless(domain, blast.fluid, cube)


def blast_on_plates(cells: int, dimensions: int, side: float, count: int, pitch: float) -> scene.Scene:
    """The same with `count` plates of two cells, so wide and a `pitch` apart [cells], one behind the other."""
    one = blast_on_copper(cells, dimensions, 2.0)
    low, across = 0.75 * cells, (0.5 * (cells - side),) * (dimensions - 1)
    plates = [
        replace(body, name=f"plate {n}")
        for n in range(count)
        for body in _cube((low + n * pitch, *across), (2.0,) + (side,) * (dimensions - 1)).bodies
    ]
    return replace(one, solid=replace(present(one.solid), bodies=tuple(plates)))


def bursting_ball() -> scene.Scene:
    """Half a ball of bonded particles that flies apart at a symmetry plane: bonds are cut, there is debris; beside it a
    cube without bonds."""
    failure = JohnsonCookFailure(0.15, 0.0, 0.0, 0.0, 0.0, 1.0, 2e8, 0.0, Scatter(10.0, 0.1, 1))
    eos, strength = LinearEos(3.25e9), PerfectlyPlastic(0.7e9, 2e7)
    rest, shape = (0.0,) * 3, scene.Ball((0.0,) * 3, 0.4)
    ball = scene.Body("ball", shape, 0.1, 2000.0, rest, eos, strength, None, failure, radial_velocity=300.0)
    cube = scene.Box((0.6,) * 3, (0.8,) * 3)
    beside = scene.Body("cube", cube, 0.1, 2000.0, rest, eos, strength, None, form="updated_lagrangian")
    free: tuple[scene.BoundaryKind, scene.BoundaryKind] = ("outflow", "outflow")
    domain = scene.Domain((-1.0, -1.0, 0.0), (1.0,) * 3, (16,) * 3, (free, free, ("symmetry", "outflow")))
    return _endless(domain, None, scene.Solid((ball, beside), SMOOTHING, 1.0, 2.0))


def _cube(
    lower: tuple[float, ...], sides: tuple[float, ...], form: scene.SolidForm = "updated_lagrangian"
) -> scene.Solid:
    """Copper with two particles per cell along each axis."""
    D = len(lower)
    shape = scene.Box(lower, tuple(a + side for a, side in zip(lower, sides, strict=True)))
    velocity = (10.0,) + (0.0,) * (D - 1)
    body = scene.Body("cube", shape, 0.5, 8930.0, velocity, COPPER, COPPER_STRENGTH, None)
    return scene.Solid((body,), SMOOTHING, 1.0, 2.0, form=form)


def _endless(domain: scene.Domain, fluid: scene.Fluid | None, solid: scene.Solid | None) -> scene.Scene:
    D = domain.dimensions
    performance = scene.Performance(BLOCK_CELLS[D - 1], TILE_CELLS[D - 1])
    time, output = scene.Time(np.inf, 0.5, None), scene.Output("", 0.0, 1)
    return scene.Scene("bench", domain, time, fluid, solid, output, performance)


TWO_GASES = (HELIUM, AIR), (0.138, 1.0), (1.0, 2.0)
FLUIDS: dict[str, Callable[[], scene.Scene]] = {
    "shock_bubble_1d": lambda: gases((65536,), *TWO_GASES),
    "shock_bubble_2d": lambda: gases((1300, 356), *TWO_GASES),
    "shock_bubble_2d_float32": lambda: gases((1300, 356), *TWO_GASES, "float32"),
    "shock_bubble_3d": lambda: gases((128, 96, 96), *TWO_GASES),
    "water_air_2d": lambda: gases((1024, 512), (WATER, AIR), (1000.0, 1e8), (1.2, 1e5)),
    "tnt_air_2d": lambda: gases((1024, 512), (TNT, AIR), BURNT_TNT, AMBIENT_AIR),
    "euler_2d": lambda: gases((1024, 512), (AIR,), (1.0, 10.0), (1.0, 1.0)),
}
SIZES = {
    f"shock_bubble_2d_{name}_cells": lambda cells=cells: gases(cells, *TWO_GASES)
    for name, cells in (("1e5", (384, 260)), ("1e6", (1280, 780)), ("1e7", (3968, 2520)))
}
"""The same flow from small to large: what a cell costs should not depend on how many there are."""
SOLIDS = {
    "copper_block_1d": lambda: copper(4096, 1),
    "copper_block_2d": lambda: copper(128, 2),
    "copper_block_3d": lambda: copper(32, 3),
    "bonded_copper_block_2d": lambda: copper(128, 2, "total_lagrangian"),
    "bonded_copper_block_3d": lambda: copper(32, 3, "total_lagrangian"),
}
SOLID_SIZES = {
    f"{kind}_block_3d_{name}_particles": lambda side=side, form=form: copper(side, 3, form)
    for kind, form in (("copper", "updated_lagrangian"), ("bonded_copper", "total_lagrangian"))
    for name, side in (("4e4", 34), ("2.5e5", 63), ("2e6", 126))
}
"""The same solid from small to large; two million particles with bonds take 16 GB."""
COUPLED = {
    "blast_on_copper_2d": lambda: blast_on_copper(256, 2),
    "blast_on_copper_3d": lambda: blast_on_copper(48, 3),
    "blast_on_plate_2d": lambda: blast_on_copper(256, 2, 2.0),
    "blast_on_plate_3d": lambda: blast_on_copper(48, 3, 2.0),
    "blast_on_plates_2d": lambda: blast_on_plates(256, 2, 64.0, 8, 7.0),
    "blast_on_plates_3d": lambda: blast_on_plates(48, 3, 18.0, 2, 6.0),
}
"""Of the last two's cells about 5 % are around walls."""
SMALLEST = {
    "fluid": lambda: gases((8, 8), *TWO_GASES),
    "solid": lambda: copper(8, 2),
    "coupled": lambda: blast_on_copper(16, 2),
}
