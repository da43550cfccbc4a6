"""Couplings with exact or independent answers: each runs an input and gives the figures that are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.study.references import STEEL_TUBE
from distfsi.study.solids import INPUTS, Figure, Measure


@dataclass(frozen=True)
class Problem:
    """An input with an answer; `measure` runs it to its end. `spacings` [m]: cell sizes from coarse to fine; width [m]:
    that they divide."""

    name: str
    title: str
    input: str
    measure: Measure
    bodies: tuple[str, ...]
    width: float
    spacings: tuple[float, ...]
    settings: tuple[str, ...] = ()
    dimensions: int = 1

    def start(self, spacing: float, per_cell: float, settings: Sequence[str] = ()) -> Simulation:
        """The run with cells of this size and so many particles to each, before its first step. Raises InputError."""
        cells = [round(self.width / spacing)] * self.dimensions
        sizes = [f"solid.bodies.{body}.spacing={spacing / per_cell!r}" for body in self.bodies]
        scene = load(INPUTS / self.input, [*self.settings, f"domain.cells={cells}", *sizes, *settings])
        return Simulation.of(scene, Communicator(), 1)


def kept_mass(simulation: Simulation) -> Figure:
    """What the coupling has left of the fluid's mass, over that."""
    coupling = present(simulation.coupling)
    made = sum(amounts[0] for amounts in coupling.budget_by_cause().values())
    mass = present(simulation.fluid).totals(coupling.volume)[0][0]
    return Figure("mass", 1.0 + made / mass, 1.0, 1e-12)


def piston(simulation: Simulation) -> list[Figure]:
    """A piston at the speed of sound: the force on its two faces, how it swings about its mean, and the pressure before
    it (exact for a gas with gamma 1.4)."""
    ahead, behind, end = 3.472666530, 0.2097152, simulation.scene.time.end
    solid, forces = present(simulation.solid), []
    while not simulation.done:
        simulation.step()
        if simulation.time > 0.4 * end:
            forces.append(-simulation.blocks.sum(solid.given.sum(axis=1))[0] / simulation.dt)
    force, exact = np.array(forces), ahead - behind
    x, p = _profile(simulation, 2)
    before = (x > 1.2 + end + 0.05) & (x < 1.2 + 1.76619 * end - 0.1)
    return [
        Figure("force", float(force.mean()), exact, 5e-3),
        Figure("noise of the force", exact + float(force.std()), exact, 5e-3),
        Figure("pressure", float(p[before].mean()), ahead, 5e-3),
        kept_mass(simulation),
    ]


def free_plate(simulation: Simulation) -> list[Figure]:
    """Gas drives a plate into a vacuum: its velocity (exact), and the mass of the gas."""
    while not simulation.done:
        simulation.step()
    totals = present(simulation.solid).totals()
    return [Figure("velocity", totals["momentum"][0] / totals["mass"], 0.3909302681, 5e-3), kept_mass(simulation)]


def taylor_plate(simulation: Simulation) -> list[Figure]:
    """A plate thrown by an exponential wave in water: its largest velocity, and when it has it (Taylor, 1941)."""
    arrival = 0.3 / (4.4 * 601e6 / 1000.0) ** 0.5
    solid, time, velocity = present(simulation.solid), [], []
    while not simulation.done:
        simulation.step()
        body = solid.body_totals(1)
        time.append(simulation.time - arrival)
        velocity.append(float(body["momentum"][0] / body["mass"][0]))
    largest = int(np.argmax(velocity))
    return [
        Figure("largest velocity [m/s]", velocity[largest], 0.123, 0.02),
        Figure("its time [s]", time[largest], 69.31e-6, 0.02),
    ]


def tube(simulation: Simulation) -> list[Figure]:
    """The steel tube without strength at 10 us: inner radius and mean velocity (1-D computation)."""
    while not simulation.done:
        simulation.step()
    c = present(simulation.solid).columns
    start, x = np.hypot(*c["reference"].T), c["position"]
    radius = np.hypot(*x.T)
    first, spacing = start < start.min() * (1.0 + 1e-6), present(simulation.scene.solid).bodies[0].spacing
    inner = radius[first].mean() - 0.5 * spacing * start.min() / radius[first].mean()
    reference = next(r for r in STEEL_TUBE if r.time == 10e-6)
    return [
        Figure("inner radius [m]", inner, reference.inner_radius, 0.02),
        Figure(
            "velocity [m/s]", float(((c["velocity"] * x).sum(axis=1) / radius).mean()), reference.mean_velocity, 0.02
        ),
    ]


def _profile(simulation: Simulation, variable: int) -> tuple[np.ndarray, np.ndarray]:
    """Cell centers and a primitive variable of a run in one dimension and one block."""
    fluid = present(simulation.fluid)
    (x, *_), state = simulation.blocks.cell_centers(0), fluid.cells(0)[:, 0, 0]
    return np.asarray(x), np.array(fluid.model.formula("primitives")(tuple(state)))[variable]


PISTON = Problem(
    "piston",
    "Piston through gas at rest (force, noise, pressure, mass)",
    "gas_piston.toml",
    piston,
    ("piston",),
    3.0,
    (0.04, 0.02, 0.01),
    ("performance.block_cells=512",),
)
FREE_PLATE = Problem(
    "free_plate",
    "Free plate driven by gas (velocity, mass)",
    "free_plate.toml",
    free_plate,
    ("plate",),
    4.0,
    (0.1, 0.05, 0.025),
)
TAYLOR_PLATE = Problem(
    "taylor_plate",
    "Taylor's plate in water (largest velocity, its time)",
    "taylor_plate.toml",
    taylor_plate,
    ("driver", "plate"),
    0.5,
    (0.01, 0.005),
)
TUBE = Problem(
    "tube",
    "Steel tube at 10 us (radius, velocity)",
    "steel_tube.toml",
    tube,
    ("tube",),
    0.06,
    (2e-3, 1e-3),
    ("solid.form=total_lagrangian", "solid.bodies.tube.strength=none", "domain.upper=[0.06,0.06]", "time.end=1e-5"),
    2,
)
PROBLEMS = (PISTON, FREE_PLATE, TAYLOR_PLATE, TUBE)
