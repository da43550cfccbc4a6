"""Solids with exact or agreed answers: each runs an input and gives the figures that are compared."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import of_kind, present
from distfsi.scene import load
from distfsi.scene.description import Box, Cylinder, Tube
from distfsi.scene.shipped import shipped_inputs
from distfsi.simulation import Simulation

INPUTS = shipped_inputs()


@dataclass(frozen=True)
class Figure:
    """A number found, in SI units, beside the one expected; it holds within a relative `tolerance`."""

    name: str
    found: float
    expected: float
    tolerance: float

    @property
    def error(self) -> float:
        """Relative."""
        return self.found / self.expected - 1.0

    @property
    def held(self) -> bool:
        return abs(self.error) <= self.tolerance


Measure = Callable[[Simulation], list[Figure]]


@dataclass(frozen=True)
class Problem:
    """An input with an answer; `measure` runs it to its end. `spacing`: the key that says how fine it is, and its
    values [m] from coarse to fine."""

    name: str
    title: str
    input: str
    measure: Measure
    body: str
    spacings: tuple[float, ...]

    def start(self, spacing: float, settings: Sequence[str] = ()) -> Simulation:
        """The run of the problem at a spacing [m], on one thread, before its first step. Raises InputError."""
        sizes = [f"solid.bodies.{name}.spacing={spacing!r}" for name in self.body.split()]
        scene = load(INPUTS / self.input, [*sizes, *settings])
        return Simulation.of(scene, Communicator(), 1)


def by_id(simulation: Simulation) -> dict[str, np.ndarray]:
    """The particles in the order of their ids."""
    columns = present(simulation.solid).columns
    order = np.argsort(columns["id"])
    return {name: column[order] for name, column in columns.items()}


def energy(simulation: Simulation) -> float:
    """Kinetic plus internal energy [J]."""
    totals = present(simulation.solid).totals()
    return totals["kinetic"] + totals["internal"]


def kept_energy(simulation: Simulation, before: float) -> Figure:
    """Energy at the end over that at the start."""
    return Figure("energy", energy(simulation), before, 1e-10)


# ---- waves in one dimension ------------------------------------------------------------------------------------------


def _crossing(x: np.ndarray, u: np.ndarray, level: float) -> float:
    """The largest x at which u falls through a level."""
    last = np.flatnonzero(u > level)[-1]
    return float(x[last] + (u[last] - level) / (u[last] - u[last + 1]) * (x[last + 1] - x[last]))


def piston(simulation: Simulation) -> list[Figure]:
    """Speeds of precursor and plastic wave between half the time and the end, and the state behind the latter
    (ExactPack's elastic-plastic piston, hypoelastic)."""
    particle, speed = 29.5721, 100.0
    fronts = []
    for time in (0.5 * simulation.scene.time.end, simulation.scene.time.end):
        while simulation.time < time and not simulation.done:
            simulation.step()
        c = by_id(simulation)
        x, u = c["position"][:, 0], c["velocity"][:, 0]
        fronts.append((simulation.time, _crossing(x, u, 0.5 * particle), _crossing(x, u, 0.5 * (particle + speed))))
    (t0, *first), (t1, *second) = fronts
    precursor, plastic = ((b - a) / (t1 - t0) for a, b in zip(first, second, strict=True))
    behind = (x > 1e-3 + speed * t1 + 0.4 * (second[1] - 1e-3)) & (x < 0.9 * second[1])
    stress = c["pressure"][behind] - c["deviator"][behind, 0]
    return [
        Figure("precursor [m/s]", precursor, 6520.6597, 0.01),
        Figure("plastic wave [m/s]", plastic, 5505.5285, 0.01),
        Figure("density behind [kg/m3]", c["density"][behind].mean(), 2839.22682, 0.01),
        Figure("stress behind [Pa]", stress.mean(), 1.445555e9 + 2.0 / 3.0 * 260e6, 0.01),
    ]


def flyer(simulation: Simulation) -> list[Figure]:
    """Copper plates at 500 m/s: pressure, compression and energy of the plateau away from the heated contact."""
    before = energy(simulation)
    while not simulation.done:
        simulation.step()
    c = by_id(simulation)
    x = np.abs(c["position"][:, 0])
    plateau, settled = (x > 1e-3) & (x < 4e-3), (x > 3e-3) & (x < 4.5e-3)
    return [
        Figure("pressure [Pa]", c["pressure"][plateau].mean(), 9.62694e9, 0.01),
        Figure("compression", c["density"][plateau].mean() / 8930.0, 1.061546, 0.01),
        Figure("energy behind [J/kg]", c["energy"][settled].mean(), 31250.0, 0.02),
        kept_energy(simulation, before),
    ]


# ---- large strains ---------------------------------------------------------------------------------------------------


def taylor(simulation: Simulation) -> list[Figure]:
    """Length of the bar and radius of its foot at the end, of the surfaces beyond the outermost particles."""
    body = present(simulation.scene.solid).bodies[0]
    bar, spacing = of_kind(Cylinder, body.shape), body.spacing
    before, start = energy(simulation), by_id(simulation)["position"]
    from_axis, along = np.hypot(*start.T[1:]), np.unique(start[:, 0].round(9))
    top, foot = (np.isclose(start[:, 0], along[layer]) for layer in (-1, 0))
    rim = np.flatnonzero(foot & (from_axis > from_axis[foot].max() - 0.25 * spacing))
    ends = np.where([True, False, False], bar.end[0], start[top])
    edge = np.where([True, False, False], 0.0, start[rim] * bar.radius / from_axis[rim, None])
    while not simulation.done:
        simulation.step()
    now = by_id(simulation)["position"]
    length = carried(start, now, np.flatnonzero(top), ends, 1.5 * spacing)[:, 0].mean()
    radius = np.hypot(*carried(start, now, rim, edge, 1.5 * spacing).T[1:]).mean()
    return [
        Figure("length [m]", float(length), 21.46e-3, 0.03),  # 21.26 to 21.66 mm, and 2 %
        Figure("foot [m]", float(radius), 7.07e-3, 0.044),  # 6.9 to 7.24 mm, and 2 %
        kept_energy(simulation, before),
    ]


def carried(start: np.ndarray, now: np.ndarray, particles: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    """Where the material `points` (k, 3), each near one of the `particles`, have gone from `start` to `now`, both
    (n, 3) [m]: by the gradient that fits the neighbours within `reach`. All planes through the origin are mirrors."""
    mirrors = np.array(list(itertools.product((1.0, -1.0), repeat=3)))
    start, now = ((x * mirrors[:, None, :]).reshape(-1, 3) for x in (start, now))
    found = []
    for i, near, point in zip(particles, cKDTree(start).query_ball_point(start[particles], reach), points, strict=True):
        gradient = np.linalg.lstsq(start[near] - start[i], now[near] - now[i])[0]
        found.append(now[i] + (point - start[i]) @ gradient)
    return np.array(found)


def verney(simulation: Simulation) -> list[Figure]:
    """Least inner radius of the imploding shell (exact for an incompressible one)."""
    shell = of_kind(Tube, present(simulation.scene.solid).bodies[0].shape)
    before, radius = energy(simulation), np.hypot(*by_id(simulation)["position"].T)
    inner = np.isclose(radius, radius.min())
    inset = (
        radius[inner].mean() ** 2 - shell.inner_radius**2
    )  # times pi: area within the innermost particles, which stays
    smallest = np.inf
    while not simulation.done:
        simulation.step()
        smallest = min(smallest, np.hypot(*by_id(simulation)["position"][inner].T).mean() ** 2 - inset)
    return [Figure("least inner radius [m]", float(np.sqrt(smallest)), 40e-3, 0.01), kept_energy(simulation, before)]


# ---- bending ---------------------------------------------------------------------------------------------------------

CLAMPED = 1.875104068711961  # k L of the first mode


def cantilever(simulation: Simulation) -> list[Figure]:
    """Period of a plate's first mode from two zero crossings of its tip (Timoshenko's value; Gray et al. 2001)."""
    body = present(simulation.scene.solid).bodies[0]
    shape = of_kind(Box, body.shape)
    columns = present(simulation.solid).columns
    x = columns["position"][:, 0]
    mode = bending_mode(np.clip(x / shape.upper[0], 0.0, 1.0))
    speed = (of_kind(LinearEos, body.eos).bulk_modulus / body.density) ** 0.5
    columns["velocity"][:, 1] = np.where(columns["fixed"], 0.0, 0.01 * speed * mode)
    tip = by_id(simulation)["position"][:, 0] > shape.upper[0] - body.spacing
    rest, before, heights, times = by_id(simulation)["position"][tip, 1].mean(), energy(simulation), [0.0], [0.0]
    while not simulation.done:
        simulation.step()
        heights.append(by_id(simulation)["position"][tip, 1].mean() - rest)
        times.append(simulation.time)
    y = np.array(heights)
    down = 1 + np.flatnonzero((y[1:-1] > 0.0) & (y[2:] <= 0.0))[0]
    crossing = times[down] + y[down] / (y[down] - y[down + 1]) * (times[down + 1] - times[down])
    return [Figure("period [s]", 2.0 * crossing, 0.2565, 0.02), kept_energy(simulation, before)]


def bending_mode(s: np.ndarray) -> np.ndarray:
    """First mode of a clamped beam at s = x/L, 1 at the tip."""

    def shape(s: np.ndarray) -> np.ndarray:
        k = CLAMPED * s
        ratio = (np.cosh(CLAMPED) + np.cos(CLAMPED)) / (np.sinh(CLAMPED) + np.sin(CLAMPED))
        return np.cosh(k) - np.cos(k) - ratio * (np.sinh(k) - np.sin(k))

    return shape(s) / shape(np.array(1.0))


PISTON = Problem("piston", "Elastic-plastic piston", "piston.toml", piston, "bar", (2e-4, 1e-4, 5e-5))
FLYER = Problem("flyer", "Copper plates at 500 m/s", "plate_impact.toml", flyer, "left right", (2e-4, 1e-4, 5e-5))
VERNEY = Problem("verney", "Verney's imploding shell", "verney_shell.toml", verney, "shell", (4e-3, 2e-3, 1e-3))
TAYLOR = Problem("taylor", "Taylor bar at 227 m/s", "taylor_bar.toml", taylor, "bar", (1.07e-3, 0.8e-3, 0.4e-3))
CANTILEVER = Problem("cantilever", "Cantilever", "cantilever.toml", cantilever, "plate", (4e-3, 2e-3, 1e-3))
PROBLEMS = (FLYER, PISTON, VERNEY, TAYLOR, CANTILEVER)
