"""Where each method of the fluid survives: maps of hard Riemann problems, and why it fails where it does.

Every run is a tube of few cells until its fastest wave has gone most of the way to an end. It has survived when it
reaches the end with a valid state in every cell; with help, if fluxes were limited or steps redone on the way. What
survives but swings (its velocity varies much more along the tube than the exact one) counts as a case of its own.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import sqrt
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.errors import Diverged, InputError
from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.output.verdicts import VerdictMap, draw_verdicts
from distfsi.scene import load
from distfsi.scene.description import FluidState, HalfSpace, Phase, Region, Scene
from distfsi.simulation import Simulation
from distfsi.study.choices import Method, name_of, settings, varied_alone
from distfsi.study.exact import RIGHTWARD, ExactEos, Material, PureState, exact_riemann, wave_into
from distfsi.study.problems import INPUTS, centers, fields, start
from distfsi.study.references import AIR, WATER
from distfsi.study.stability import Plane

DIRECTORY = Path("out/study_stability_fluid")
CELLS = 50
WAY = 0.4  # that the fastest wave goes, in lengths of the tube
MAXIMUM_STEPS = 20.0  # times those that the fastest wave should need
SWINGS = 1.5  # total variation of the velocity over the exact one
HELIUM = IdealGas(5.0 / 3.0)

SURVIVED, HELPED, SWUNG, FAILED = range(4)
VERDICTS = {
    "survived": "tab:green",
    "survived with help": "tab:olive",
    "survived, but swings": "tab:orange",
    "failed": "tab:red",
}
CFL = (0.1, 0.3, 0.5, 0.7, 0.9, 1.0, 1.1, 1.2)


@dataclass(frozen=True)
class Tube:
    """Two states that meet in the middle of a tube of length one."""

    left: PureState
    right: PureState
    eos_left: ExactEos
    eos_right: ExactEos


@dataclass(frozen=True)
class Map(Plane):
    """Tubes over two hardnesses; the CFL number is either a column's or `cfl`."""

    tube: Callable[[float, float], Tube]
    cfl: float | None = None

    def cfl_of(self, column: float) -> float:
        """The CFL number of a column."""
        return column if self.cfl is None else self.cfl


@dataclass(frozen=True)
class Verdict:
    """What became of a run; why it failed, or what helped it."""

    number: int
    why: str = ""


def gas_against_gas(ratio: float, _: float) -> Tube:
    """Air of one density whose pressures have a ratio."""
    return Tube(PureState(1.0, ratio), PureState(1.0, 1.0), AIR, AIR)


def water_against_air(ratio: float, _: float) -> Tube:
    """Water at 1 GPa against air of 1.2 kg/m3 at a pressure so many times lower."""
    return Tube(PureState(1000.0, 1e9), PureState(1.2, 1e9 / ratio), WATER, AIR)


def shock_at_contact(density_ratio: float, mach: float) -> Tube:
    """A shock in air just when it meets helium of a density in the ratio to that of the air ahead."""
    ahead = PureState(1.0, 1.0)
    behind = wave_into(ahead, AIR, 1.0 + 2.8 / 2.4 * (mach**2 - 1.0), RIGHTWARD).behind
    return Tube(behind, PureState(density_ratio, 1.0), AIR, HELIUM)


def gas_torn_apart(strength: float, _: float) -> Tube:
    """Air torn apart at a velocity in units of that at which a vacuum opens (Toro's 123 problem: 0.535)."""
    velocity = strength * 2.0 / 0.4 * sqrt(1.4 * 0.4)
    return Tube(PureState(1.0, 0.4, -velocity), PureState(1.0, 0.4, velocity), AIR, AIR)


PRESSURE_RATIOS = tuple(10.0**n for n in range(12))
DENSITY_RATIOS = tuple(10.0**n for n in range(-4, 5))
MACH_NUMBERS = (1.2, 1.5, 2.0, 3.0, 6.0, 10.0, 20.0, 50.0)
STRENGTHS = (0.2, 0.535, 0.8, 0.9, 0.95, 1.0, 1.2)
MAPS = (
    Map(
        "pressure_gas",
        "Air against air, one phase",
        "pressure ratio",
        PRESSURE_RATIOS,
        "CFL number",
        CFL,
        gas_against_gas,
    ),
    Map(
        "pressure_water",
        "Water at 1 GPa against air of 1.2 kg/m3",
        "pressure ratio",
        PRESSURE_RATIOS,
        "CFL number",
        CFL,
        water_against_air,
    ),
    Map(
        "density_mach",
        "Shock in air meets helium, CFL number 0.9",
        "density ratio",
        DENSITY_RATIOS,
        "Mach number",
        MACH_NUMBERS,
        shock_at_contact,
        0.9,
    ),
    Map(
        "torn_apart",
        "Air torn apart (123 problem)",
        "velocity over that which opens a vacuum",
        STRENGTHS,
        "CFL number",
        CFL,
        gas_torn_apart,
    ),
)


def fastest_wave(tube: Tube) -> float:
    """Largest velocity of a wave of a tube [m/s]; where a vacuum opens, of its states."""
    sides = ((tube.left, tube.eos_left), (tube.right, tube.eos_right))
    speeds = [abs(s.velocity) + float(Material(eos).sound_speed(s.density, s.pressure)) for s, eos in sides]
    try:
        solution = exact_riemann(tube.left, tube.right, tube.eos_left, tube.eos_right)
    except ValueError:
        return max(speeds)
    waves = (solution.left_wave, solution.right_wave)
    return max(*speeds, *(abs(speed) for wave in waves for speed in (wave.head, wave.tail)))


@cache
def _base(input_name: str, method: tuple[tuple[str, str], ...]) -> Scene:
    return load(INPUTS / input_name, settings(dict(method)))


def scene_of(tube: Tube, cfl: float, method: Method) -> Scene:
    """The tube computed with a method, the default but for what the method says. Raises InputError."""
    eos = (tube.eos_left,) if tube.eos_left == tube.eos_right else (tube.eos_left, tube.eos_right)
    base = _base("sod.toml" if len(eos) == 1 else "water_air.toml", tuple(method.items()))
    left, right = (
        FluidState(phase, side.density, side.pressure, (side.velocity,))
        for phase, side in ((0, tube.left), (len(eos) - 1, tube.right))
    )
    regions = (Region(left, None), Region(right, HalfSpace((0.5,), (-1.0,))))
    phases = tuple(Phase(f"phase {number}", one) for number, one in enumerate(eos))
    return replace(
        base,
        domain=replace(base.domain, cells=(CELLS,)),
        time=replace(base.time, end=WAY / fastest_wave(tube), cfl=cfl),
        fluid=replace(present(base.fluid), phases=phases, regions=regions),
    )


def judge(tube: Tube, cfl: float, method: Method) -> Verdict:
    """Run a tube; what becomes of it."""
    simulation = start(scene_of(tube, cfl, method))
    limit = MAXIMUM_STEPS * WAY * CELLS / cfl
    try:
        while not simulation.done:
            simulation.step()
            if simulation.steps > limit:
                return Verdict(FAILED, "the time step shrinks")
        simulation.check()
    except Diverged as error:
        return Verdict(FAILED, _cause(error))
    if _swings(simulation, tube):
        return Verdict(SWUNG)
    faces, redone = present(simulation.fluid).limited_faces(), present(simulation.fluid).rejected_steps
    return Verdict(HELPED, f"{faces} limited faces; {redone} redone steps") if faces or redone else Verdict(SURVIVED)


def _cause(error: Diverged) -> str:
    """What is wrong, without where and when."""
    state = str(error).rpartition(": ")[2].split(", ")
    wrong = [value for value in state if value.endswith("nan") or " -" in value and "velocity" not in value]
    return "; ".join(wrong) or str(error)


def _swings(simulation: Simulation, tube: Tube) -> bool:
    """Whether the velocity varies much more along the tube than the exact one; never where there is none."""
    try:
        solution = exact_riemann(tube.left, tube.right, tube.eos_left, tube.eos_right)
    except ValueError:
        return False
    exact = solution.sample((centers(simulation)[0] - 0.5) / simulation.time)[1]
    found = fields(simulation)["velocity"][0, 0, :, 0]
    noise = 1e-6 * fastest_wave(tube)
    return float(np.abs(np.diff(found)).sum()) > SWINGS * float(np.abs(np.diff(exact)).sum()) + noise


def explore(shown: Map, method: Method) -> list[list[Verdict]]:
    """The verdicts (rows, columns) of a method on a map."""
    return [[judge(shown.tube(row, c), shown.cfl_of(c), method) for c in shown.columns] for row in shown.rows]


# ---- what is shown ---------------------------------------------------------------------------------------------------


def draw(shown: Map, found: Mapping[str, list[list[Verdict]]]) -> None:
    """The maps of all methods on one sheet."""
    maps = [
        VerdictMap(name, np.array([[verdict.number for verdict in row] for row in rows]))
        for name, rows in found.items()
    ]
    rows, columns = ([f"{value:g}" for value in values] for values in (shown.rows, shown.columns))
    path = DIRECTORY / f"{shown.name}.png"
    draw_verdicts(path, shown.title, maps, (shown.row_label, rows), (shown.column_label, columns), VERDICTS)


def summary(name: str, rows: list[list[Verdict]]) -> str:
    """How often each verdict fell, and why runs failed."""
    verdicts = [verdict for row in rows for verdict in row]
    counts = Counter(verdict.number for verdict in verdicts)
    reasons = Counter(verdict.why for verdict in verdicts if verdict.number == FAILED)
    words = ", ".join(f"{counts[number]} {verdict}" for number, verdict in enumerate(VERDICTS) if counts[number])
    why = "".join(f"; {count} x {reason}" for reason, count in reasons.most_common(2))
    return f"  {name:28} {words}{why}"


def write(found: Mapping[str, Mapping[str, list[list[Verdict]]]], maps: Sequence[Map]) -> None:
    """All verdicts as CSV."""
    names = list(VERDICTS)
    with (DIRECTORY / "stability.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["map", "method", "row", "column", "CFL number", "verdict", "why"])
        for shown in maps:
            for method, rows in found[shown.name].items():
                for value, row in zip(shown.rows, rows, strict=True):
                    for column, verdict in zip(shown.columns, row, strict=True):
                        at = (f"{value:g}", f"{column:g}", f"{shown.cfl_of(column):g}")
                        table.writerow([shown.name, method, *at, names[verdict.number], verdict.why])


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The default alone on the ends of the maps."""
    maps = [replace(shown, rows=shown.rows[:: len(shown.rows) - 1], columns=shown.columns[2:5:2]) for shown in MAPS]
    _study(communicator, [{}], maps, overrides)


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Run the default and every choice alone on all maps; leave a CSV file and a sheet per map in DIRECTORY."""
    _study(communicator, [{}, *varied_alone()], MAPS, overrides)


def _study(
    communicator: Communicator, methods: Sequence[Method], maps: Sequence[Map], overrides: Sequence[str]
) -> None:
    if communicator.size > 1 or overrides:
        raise InputError(["study stability fluid: runs on one rank and takes no overrides"])
    found: dict[str, dict[str, list[list[Verdict]]]] = {}
    with threadpool_limits(1):
        for shown in maps:
            print(f"\n{shown.title}: {shown.row_label} by {shown.column_label}")
            found[shown.name] = {}
            for method in methods:
                name = name_of(method) or "default"
                try:
                    found[shown.name][name] = explore(shown, method)
                except InputError as error:
                    print(f"  {name:28} not for this: {error}")
                    continue
                print(summary(name, found[shown.name][name]), flush=True)
            draw(shown, found[shown.name])
    write(found, maps)
    print(f"\nmaps and table in {DIRECTORY}", flush=True)
