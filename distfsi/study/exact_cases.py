"""Cases with exact answers, all in one table: tubes, point blasts, a wall that cold gas runs into, an interface that
moves, a shock along the grid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.errors import InputError
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.study.problems import INPUTS, centers, fields, riemann_of, start
from distfsi.study.profiles import Profile

COARSE, MIDDLE, FINE = 250, 400, 1000  # cells of a tube: for the order, for the shock, for plateaus and the order


def _states(interface: float, time: float, left: Sequence[float], right: Sequence[float]) -> tuple[str, ...]:
    """Settings of sod.toml that make it another tube; sides as (density, velocity, pressure)."""
    sides = enumerate((left, right))
    values = zip(("density", "velocity", "pressure"), zip(*(side for _, side in sides), strict=True), strict=True)
    settings = [f"fluid.regions.{k}.{name}={value}" for name, pair in values for k, value in enumerate(pair)]
    return (*settings, f"fluid.regions.1.shape.point={interface}", f"time.end={time}", "fluid.reconstruction=van_leer")


TUBES: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "Sod": ("sod.toml", ("fluid.reconstruction=van_leer",)),
    "Toro 1": ("sod.toml", _states(0.3, 0.2, (1.0, 0.75, 1.0), (0.125, 0.0, 0.1))),
    "Toro 3": ("sod.toml", _states(0.5, 0.012, (1.0, 0.0, 1000.0), (1.0, 0.0, 0.01))),
    "Toro 4": ("sod.toml", _states(0.4, 0.035, (5.99924, 19.5975, 460.894), (5.99242, -6.19633, 46.0950))),
    "Toro 5": ("sod.toml", _states(0.8, 0.012, (1.0, -19.59745, 1000.0), (1.0, -19.59745, 0.01))),
    "Lax": ("sod.toml", _states(0.5, 0.15, (0.445, 0.698, 3.528), (0.5, 0.0, 0.571))),
    "pressure ratio 1e5": ("sod.toml", _states(0.5, 0.0012, (1.0, 0.0, 1e5), (1.0, 0.0, 1.0))),
    "pressure ratio 1e11": ("sod.toml", _states(0.5, 2e-6, (1.0, 0.0, 1e10), (0.125, 0.0, 0.1))),
    "water, air of 50 kg/m3": ("water_air.toml", ()),
    "water, air of 1.2 kg/m3": ("water_air.toml", ("fluid.regions.1.density=1.2",)),
    "TNT, air": ("tnt_air.toml", ()),
    "LeBlanc": ("leblanc.toml", ()),
}
"""Toro, Riemann Solvers and Numerical Methods for Fluid Dynamics, 3rd ed., Table 4.1; Lax; Saurel and Abgrall, SIAM J.
Sci. Comput. 21 (1999) 1115, and others."""


def finished(name: str, settings: Sequence[str]) -> Simulation:
    """An input at its end. Raises Diverged."""
    simulation = start(load(INPUTS / name, settings))
    while not simulation.done:
        simulation.step()
    return simulation


def tube_line(title: str, cells: Sequence[int], overrides: Sequence[str]) -> str:
    """Shock, plateaus and orders of a tube on three meshes."""
    name, settings = TUBES[title]
    profiles = []
    for number in cells:
        simulation = finished(name, [*settings, f"domain.cells={number}", *overrides])
        profiles.append(Profile.of(simulation, *riemann_of(simulation.scene)))
    coarse, middle, fine = profiles
    order = np.log(coarse.errors() / fine.errors()) / np.log(cells[2] / cells[0])
    off = [(p.shock()[0] - p.shock()[1]) for p in (middle, fine)]
    orders = "".join(f"{n:7.2f}" for n in order)
    plateau = 100 * fine.plateau_error()
    return f"{title:26}{off[0] / middle.spacing:+10.2f}{off[1] / fine.spacing:+10.2f}{plateau:11.2f} %{orders}"


@dataclass(frozen=True)
class Blast:
    """Sedov's blast in some dimensions: energy, and radius of the shock at time 1 in air of density 1."""

    energy: float
    radius: float
    cells: int
    quick_cells: int


BLASTS = {1: Blast(2 * 0.0673185, 0.5, 200, 50), 2: Blast(0.311357, 0.75, 120, 30), 3: Blast(0.851072, 1.0, 104, 12)}
DEPOSIT = 2.5  # radius of the heated ball, in cells


def blast_line(dimensions: int, cells: int) -> str:
    """Radius of the shock of Sedov's blast, from the mean pressure of rings, and the largest density."""
    D, blast = dimensions, BLASTS[dimensions]
    size = 1.2 * blast.radius
    hot = DEPOSIT * size / cells
    ends = ", ".join(f'{axis}=["symmetry", "outflow"]' for axis in "xyz"[:D])
    box = f"lower={[0.0] * D}, upper={[size] * D}, cells={[cells] * D}"
    settings = [f"domain={{{box}, {ends}}}"]
    settings += [f"fluid.regions.1.shape.center={[0.0] * D}", f"fluid.regions.1.shape.radius={hot}"]
    one, two = (
        present(start(load(INPUTS / "sedov.toml", [*settings, f"fluid.regions.1.pressure={p}"])).fluid).totals()[0][-1]
        for p in (1.0, 2.0)
    )
    pressure = blast.energy / 2**D / (two - one)  # the cells that the ball covers in part do not add up to it exactly
    simulation = finished("sedov.toml", [*settings, f"fluid.regions.1.pressure={pressure}"])
    r, p = radial_mean(simulation, "pressure")
    behind = 2.0 / 2.4 * (2.0 / (D + 2.0) * blast.radius) ** 2
    off = 100 * (half_way(r, p, 0.5 * behind) / blast.radius - 1.0)
    densest = fields(simulation)["density"].max()
    return f"Sedov {D}D, {cells} cells: radius of the shock {off:+.2f} %, largest density {densest:.2f} of 6"


def radial_mean(simulation: Simulation, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean of a field in rings as wide as a cell: their radii and values; up to the nearest side of the domain."""
    grid = np.meshgrid(*centers(simulation)[::-1], indexing="ij")
    r = np.sqrt(sum(x**2 for x in grid)).ravel()
    h, upper = simulation.scene.domain.spacing[0], min(simulation.scene.domain.upper)
    ring, count = (r / h).astype(int), int(round(upper / h))
    number = np.bincount(ring)[:count]
    return h * (np.arange(count) + 0.5), np.bincount(ring, fields(simulation)[name].ravel())[:count] / number


def half_way(r: np.ndarray, values: np.ndarray, level: float) -> float:
    """Where `values`, linear between points, last fall below a level."""
    last = np.flatnonzero(values > level)[-1]
    return r[last] + (r[1] - r[0]) * (values[last] - level) / (values[last] - values[last + 1])


def other_lines(quick: bool) -> Iterator[str]:
    """Noh's wall, the moving interface, and the shock along the grid with two fluxes."""
    cells = 50 if quick else 200
    simulation = finished("noh.toml", [f"domain.cells={cells}"])
    x, density = centers(simulation)[0], fields(simulation)["density"][0, 0]
    off = (half_way(x, density, 2.5) - 0.2) * cells
    yield f"Noh, {cells} cells: shock off by {off:+.2f} cells, density at the wall {density[0]:.3f} of 4 (wall heating)"
    found = fields(finished("interface.toml", []))
    p, u = np.abs(found["pressure"] / 1e5 - 1.0).max(), np.abs(found["velocity"][..., 0] / 1e3 - 1.0).max()
    yield f"water in air at 1000 m/s, once around: pressure to {p:.1e}, velocity to {u:.1e}"
    for riemann in ("adaptive", "hllc"):
        run = ["domain.cells=[240,20]", "domain.upper=[240,20]", "time.end=33"] if quick else []
        across = np.abs(
            fields(finished("carbuncle.toml", [f"fluid.riemann={riemann}", *run]))["velocity"][..., 1]
        ).max()
        yield f"shock along the grid, {riemann}: largest transverse velocity {across:.1e} c"


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The same on few cells."""
    _study(communicator, overrides, (25, 40, 100), True)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run and print all; overrides are for the tubes."""
    _study(communicator, overrides, (COARSE, MIDDLE, FINE), False)


def _study(communicator: Communicator, overrides: Sequence[str], cells: tuple[int, int, int], quick: bool) -> None:
    if communicator.size > 1:
        raise InputError(["study exact cases: runs on one rank"])
    with threadpool_limits(1):
        print(f"{'':26}{'shock off [cells]':>20}{'plateaus':>13}{'order of rho, u, p':>21}")
        print(f"{'cells':26}{cells[1]:10}{cells[2]:10}{cells[2]:13}{f'{cells[0]} to {cells[2]}':>21}")
        for title in TUBES:
            print(tube_line(title, cells, overrides), flush=True)
        for dimensions, blast in BLASTS.items():
            print(blast_line(dimensions, blast.quick_cells if quick else blast.cells), flush=True)
        for line in other_lines(quick):
            print(line, flush=True)
