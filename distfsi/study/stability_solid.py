"""Where each form of the solid survives: tension, impact, thin plates, long time steps; and why it fails where it does.

A run has survived when it reaches its end with a valid state, its energy kept and, where nothing can break, in one
piece: all bonds whole or, where there are none, no particle out of touch with the others. No body is in another one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from distfsi.errors import Diverged
from distfsi.laws.solid.eos.mie_grueneisen import MieGrueneisen
from distfsi.laws.solid.strength.johnson_cook import JohnsonCook
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.scene.description import Ball, Body, Box, Domain, Output, Packing, Performance, Scene, Solid, Time
from distfsi.simulation import Simulation
from distfsi.study.solids import energy
from distfsi.study.stability import Map, Stability, corners

DIRECTORY = Path("out/study_stability_solid")
COPPER = MieGrueneisen(3940.0, 1.489, 0.0, 0.0, 2.0, 0.47)
STRONG = JohnsonCook(45e9, 90e6, 292e6, 0.31, 0.025, 1.09, 1.0, 294.0, 1356.0, 385.0, 0.9)
DENSITY, WIDTH = 8930.0, 1e-2
Form = Mapping[str, Any]  # what a description of a solid says of it
FORMS: dict[str, Form] = {
    "total Lagrangian": {"form": "total_lagrangian"},
    "updated Lagrangian": {"form": "updated_lagrangian"},
    "updated, artificial stress": {"form": "updated_lagrangian", "artificial_stress": 0.3},
}
SURVIVED, BROKEN, LEAKED, FAILED, PASSED = range(5)
VERDICTS = {
    "survived": "tab:green",
    "broke without a reason": "tab:orange",
    "lost its energy": "tab:olive",
    "failed": "tab:red",
    "got into each other": "tab:purple",
}
APART = 1.6  # of the spacing, stretched as the body is: farther from all others means broken off
CLOSEST = 0.25  # spacings between particles of bodies that are not in each other, compressed as they may be
SHRINKS = 30.0  # times, the stable step until a run has failed
FACTORS = (0.1, 0.2, 0.33, 0.5, 0.67, 0.83, 1.0)  # of the stable step, over 0.3


def scene_of(form: Form, bodies: Sequence[Body], size: float) -> Scene:
    """Bodies in a box that reaches `size` [m] to all sides."""
    lower, upper = (-size, -size), (size, size)
    return Scene(
        "stability",
        Domain(lower, upper, (8, 8), (("outflow", "outflow"),) * 2),
        Time(1.0, 0.5, None),
        None,
        Solid(tuple(bodies), 1.3, 0.5, 1.0, **form),
        Output("", 0.0, 1),
        Performance((8, 8), (8, 8)),
    )


def plate(name: str, lower: tuple[float, float], upper: tuple[float, float], spacing: float, speed: float) -> Body:
    """A copper plate that flies along x [m/s]."""
    return Body(name, Box(lower, upper), spacing, DENSITY, (speed, 0.0), COPPER, STRONG, None)


def advance(simulation: Simulation, end: float, factor: float = 1.0) -> tuple[int, str]:
    """Run to `end` [s] with the stable step times `factor`; FAILED and why, or SURVIVED."""
    solid = present(simulation.solid)
    before, time, first = energy(simulation), 0.0, 0.0
    try:
        while time < end:
            solid.prepare()
            stable = solid.time_step()[0]
            first = first or stable
            if not SHRINKS * stable > first:
                return FAILED, "the time step shrinks"
            dt = min(factor * stable, end - time)
            solid.advance(dt)
            solid.migrate()
            time += dt
        solid.check(time)
    except Diverged as error:
        return FAILED, str(error).partition(":")[0]
    drift = abs(energy(simulation) / before - 1.0)
    return (SURVIVED, "") if drift < 1e-8 else (LEAKED, f"energy {drift:.1e}")


def pieces(position: np.ndarray, stretch: np.ndarray, spacing: float) -> int:
    """Number of groups of particles that are within reach of each other once the stretch is taken out."""
    pairs = cKDTree(position / stretch).query_pairs(APART * spacing, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), dtype=bool), tuple(pairs.T)), (len(position), len(position)))
    return connected_components(links, directed=False, return_labels=False)


def stretched(form: Form, strain: float, through: float) -> tuple[int, str]:
    """A plate, so many particles thick, that flies apart evenly to an engineering strain at 1e5/s."""
    spacing, rate = WIDTH / 20.0, 1e5
    half = 0.5 * through * spacing
    body = plate("plate", (-0.5 * WIDTH, -half), (0.5 * WIDTH, half), spacing, 0.0)
    simulation = Simulation.of(scene_of(form, [body], 20.0 * WIDTH), Communicator(), 1)
    solid = present(simulation.solid)
    c = solid.columns
    start = c["position"].copy()
    c["velocity"] = np.stack([rate * c["position"][:, 0], np.zeros(len(start))], axis=1)
    c["fixed"] = np.abs(start[:, 0]) > 0.5 * WIDTH - 2.6 * spacing
    verdict, why = advance_driven(simulation, strain / rate)
    if verdict != SURVIVED:
        return verdict, why
    bonded = solid.pieces()
    if bonded is not None:
        found = len(bonded["piece"])
    else:
        found = pieces(solid.columns["position"], np.array([1.0 + strain, 1.0]), spacing)
    return (SURVIVED, "") if found == 1 else (BROKEN, f"{found} pieces")


def advance_driven(simulation: Simulation, end: float) -> tuple[int, str]:
    """As advance(), with the work of what holds the ends counted."""
    before = energy(simulation)
    verdict, why = advance(simulation, end)
    if verdict != LEAKED:
        return verdict, why
    drift = abs((energy(simulation) - present(simulation.solid).gravity_work()) / before - 1.0)
    return (SURVIVED, "") if drift < 1e-8 else (LEAKED, f"energy {drift:.1e}")


def impact(form: Form, speed: float, factor: float, through: float = 8.0) -> tuple[int, str]:
    """Two plates that meet at a speed [m/s], computed for the time a shock takes through them."""
    spacing = 1.25e-4 * 8.0 / through
    thick, wide = 1e-3, 2e-3
    bodies = (
        plate("left", (-thick, -0.5 * wide), (0.0, 0.5 * wide), spacing, 0.5 * speed),
        plate("right", (0.0, -0.5 * wide), (thick, 0.5 * wide), spacing, -0.5 * speed),
    )
    simulation = Simulation.of(scene_of(form, bodies, 10.0 * thick), Communicator(), 1)
    return advance(simulation, 2.0 * thick / 4000.0, factor)


def oblique(form: Form, speed: float, angle: float) -> tuple[int, str]:
    """Two discs, 16 particles across, that meet at a speed [m/s], at an angle [deg] to the line through their
    middles."""
    radius, turn = 0.5e-3, np.radians(angle)
    spacing = radius / 8.0
    packing: Packing = "rings" if form["form"] == "total_lagrangian" else "lattice"
    bodies = [
        replace(
            plate(name, (0.0, 0.0), (0.0, 0.0), spacing, 0.0),
            shape=Ball((-sign * radius, 0.0), radius),
            velocity=(0.5 * sign * speed * np.cos(turn), 0.5 * sign * speed * np.sin(turn)),
            packing=packing,
        )
        for name, sign in (("left", 1.0), ("right", -1.0))
    ]
    return meeting(form, bodies, 4.0 * radius / 4000.0)


def unlike(form: Form, speed: float, ratio: float) -> tuple[int, str]:
    """Two plates that meet at a speed [m/s], the particles of one being closer by a ratio."""
    thick, wide, spacing = 1e-3, 1e-3, 1.25e-4
    bodies = [
        plate("left", (-thick, -0.5 * wide), (0.0, 0.5 * wide), spacing, 0.5 * speed),
        plate("right", (0.0, -0.5 * wide), (thick, 0.5 * wide), spacing / ratio, -0.5 * speed),
    ]
    return meeting(form, bodies, 2.0 * thick / 4000.0)


def meeting(form: Form, bodies: Sequence[Body], end: float) -> tuple[int, str]:
    """Two bodies until `end` [s], which must not get into each other."""
    simulation = Simulation.of(scene_of(form, bodies, 1e-2), Communicator(), 1)
    verdict, why = advance(simulation, end)
    if verdict != SURVIVED:
        return verdict, why
    c = present(simulation.solid).columns
    first, second = (c["position"][c["body"] == b] for b in (0, 1))
    near, _ = cKDTree(first).query(second)
    closest = near.min() / min(body.spacing for body in bodies)
    return (SURVIVED, "") if closest > CLOSEST else (PASSED, f"particles {closest:.2g} spacings from each other")


def thin(form: Form, speed: float, through: float) -> tuple[int, str]:
    """The same of plates that are so many particles thick."""
    return impact(form, speed, 1.0, through)


SPEEDS = (100.0, 300.0, 1000.0, 2000.0, 3000.0)
MAPS = (
    Map(
        "tension",
        "Copper plate stretched without failure",
        "strain",
        (0.1, 0.3, 0.6, 1.0, 2.0),
        "particles across",
        (1.0, 2.0, 4.0, 8.0),
        stretched,
    ),
    Map(
        "step",
        "Copper plates meet",
        "speed [m/s]",
        SPEEDS,
        "time step over 0.3 h/c",
        tuple(f / 0.3 for f in FACTORS),
        impact,
    ),
    Map(
        "thickness",
        "Copper plates meet",
        "speed [m/s]",
        SPEEDS,
        "particles across",
        (1.0, 2.0, 4.0, 8.0),
        thin,
    ),
    Map(
        "angle",
        "Copper discs meet",
        "speed [m/s]",
        SPEEDS,
        "angle to the line through their middles [deg]",
        (0.0, 20.0, 40.0, 60.0),
        oblique,
    ),
    Map(
        "ratio",
        "Copper plates of unlike particles meet",
        "speed [m/s]",
        SPEEDS,
        "ratio of the spacings",
        (1.0, 2.0, 4.0),
        unlike,
    ),
)


STUDY = Stability("stability solid", DIRECTORY, VERDICTS)


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The corners of the maps."""
    STUDY.run(communicator, FORMS, [corners(shown) for shown in MAPS], overrides)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run both forms on all maps; leave a CSV file and a sheet per map in DIRECTORY."""
    STUDY.run(communicator, FORMS, MAPS, overrides)
