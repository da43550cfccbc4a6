"""What the package knows of a named material: its numbers with their sources, what follows from them, and curves."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.laws.law import FluidEos, SolidEos, Strength
from distfsi.laws.solid.metal import Metal
from distfsi.scene.materials import Material, Part, laws
from distfsi.scene.shocks import Shocked, chapman_jouguet, fluid_hugoniot, shocked, solid_hugoniot
from distfsi.scene.thermodynamics import energy, pressure, sound_speed_squared
from distfsi.scene.units import to_si

WIDTH = 120
COMPRESSIONS = (1.02, 1.05, 1.1, 1.2, 1.3)  # densities of the table behind shocks over that in front
RATES = (1e-3, 1.0, 1e3, 1e5)  # of the curves of metals [1/s]
LARGEST_STRAIN, LARGEST_PRESSURE = 0.5, 1e9  # of the curves of metals, and of those of concrete and glass [Pa]
STRONGEST_SHOCK = 2e11  # of the curves [Pa]


def listed(every: tuple[Material, ...]) -> str:
    """The names of all materials, by kind, with what they are."""
    lines: list[str | None] = []
    kind = ""
    for material in every:
        if material.kind != kind:
            kind = material.kind
            lines += ["" if lines else None, f"{kind}"]
        lines.append(f"  {material.name:20}{material.description}")
    return "\n".join(line for line in lines if line is not None)


def sheet(material: Material) -> str:
    """The numbers of a material, each part with its source, and what follows from them."""
    lines = [f"{material.name}: {material.description}"]
    if material.aliases:
        lines.append(f"also: {', '.join(material.aliases)}")
    if material.density is not None:
        lines.append(f"density = {material.density}")
    for name, part in material.parts.items():
        lines += ["", f"[{name}]", *_part(part)]
    return "\n".join([*lines, "", "computed from these numbers:", *_consequences(material)])


def _part(part: Part) -> Iterator[str]:
    for key, value in part.values.items():
        yield f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value:g}"
    for key, text in part.about.items():
        yield from textwrap.wrap(f"# {key}: {text}", WIDTH, subsequent_indent="#   ")


def _consequences(material: Material) -> Iterator[str]:
    density, rest_pressure, speed = at_rest(material)
    yield f"  sound speed at rest {speed:.0f} m/s at {density:.6g} kg/m3"
    given = material.detonation
    if given is not None:
        found = detonation(material)
        specific = given.energy / given.density / 1e6
        yield f"  detonation at {found.front:.0f} m/s (source: {given.speed:.0f})"
        yield f"  detonation pressure {found.pressure / 1e9:.2f} GPa (source: {given.pressure / 1e9:.2f})"
        yield f"  products behind the front {found.density:.0f} kg/m3, {found.velocity:.0f} m/s"
        yield f"  energy {specific:.3f} MJ/kg; released at its own density it makes {rest_pressure / 1e9:.2f} GPa"
        return
    yield "  shocks into it:  density over that before, pressure [GPa], speed of the shock and behind it [m/s]"
    for compression in COMPRESSIONS:
        state = behind_shock(material, compression)
        if state is not None:
            yield f"    {compression:4.2f} {state.pressure / 1e9:10.4g} {state.front:9.0f} {state.velocity:8.0f}"


def at_rest(material: Material) -> tuple[float, float, float]:
    """Density [kg/m3], pressure [Pa] and sound speed [m/s] before anything happens; of a solid that of the bulk."""
    law = laws(material)
    if material.is_solid:
        density = to_si(material.density, "kg/m3")
        eos: Any = law["eos"]
        return density, 0.0, float(eos.reference_sound_speed(density))
    fluid, state = law["fluid"], material.state
    assert isinstance(fluid, FluidEos)
    density = to_si(state["density"], "kg/m3")
    p = to_si(state["pressure"], "Pa") if "pressure" in state else pressure(fluid, density, state["energy"])
    return density, p, sqrt(sound_speed_squared(fluid, density, p))


def detonation(material: Material) -> Shocked:
    """The Chapman-Jouguet state of an explosive."""
    fluid, given = laws(material)["fluid"], material.detonation
    assert isinstance(fluid, FluidEos) and given is not None
    return chapman_jouguet(fluid, given.density, given.energy / given.density)


def behind_shock(material: Material, compression: float) -> Shocked | None:
    """Behind a shock that makes the material so many times denser; None where there is no such shock."""
    density, p, _ = at_rest(material)
    behind, law = density * compression, laws(material)
    if material.is_solid:
        eos = law["eos"]
        assert isinstance(eos, SolidEos)
        found = solid_hugoniot(eos, density, behind)
    else:
        fluid = law["fluid"]
        assert isinstance(fluid, FluidEos)
        if behind >= fluid.maximum_density:
            return None
        found = fluid_hugoniot(fluid, density, energy(fluid, density, p), p, behind)
    return shocked(density, p, behind, found) if p < found < np.inf else None


# ---- curves ----------------------------------------------------------------------------------------------------------


def draw(material: Material, path: Path) -> Path:
    """Draw the Hugoniot (of an explosive that of its products) and, of a solid, the yield stress; returns `path`."""
    from distfsi.output.charts import Chart, Curve, draw_charts

    x, y, label = _hugoniot_curve(material)
    charts = [Chart(f"{material.name}: {label}", "density [kg/m3]", "pressure [GPa]", [Curve(x, y / 1e9)])]
    strength = laws(material).get("strength")
    if isinstance(strength, Strength):
        title, curves = _yield_curves(strength)
        drawn = [Curve(x, y / 1e6, label) for label, x, y in curves]
        charts.append(Chart(f"{material.name}: yield stress", title, "yield stress [MPa]", drawn))
    return draw_charts(path, charts, len(charts))


def _hugoniot_curve(material: Material) -> tuple[np.ndarray, np.ndarray, str]:
    density, rest_pressure, _ = at_rest(material)
    given, law = material.detonation, laws(material)
    if given is not None:
        fluid = law["fluid"]
        assert isinstance(fluid, FluidEos)
        x = np.linspace(1.0, 1.6, 121) * given.density
        y = [fluid_hugoniot(fluid, given.density, given.energy / given.density, 0.0, rho) for rho in x]
        return x, np.array(y), "Hugoniot of its products"
    states = [behind_shock(material, float(compression)) for compression in np.linspace(1.001, 6.0, 1000)]
    kept: list[Shocked] = []
    for state in states:
        if state is None or state.pressure > STRONGEST_SHOCK or (kept and state.pressure < kept[-1].pressure):
            break
        kept.append(state)
    points = [(density, rest_pressure), *((state.density, state.pressure) for state in kept)]
    return *np.array(points).T, "Hugoniot"


def _yield_curves(strength: Any) -> tuple[str, list[tuple[str, np.ndarray, np.ndarray]]]:
    """The axis, and curves with their labels: of metals over plastic strain at several rates, else over pressure."""
    if isinstance(strength, Metal):
        x, cold = np.linspace(1e-4, LARGEST_STRAIN, 200), getattr(strength, "room_temperature", 0.0)
        step = 1e-9
        found = [(f"{r:g} 1/s", x, np.array([strength.flow(e, step, step / r, cold)[0] for e in x])) for r in RATES]
        return "plastic strain", found
    x = np.linspace(0.0, LARGEST_PRESSURE, 200)
    words = (("intact", 0.0), ("crushed", 1.0))
    return "pressure [Pa]", [(word, x, np.array([strength.yield_stress(p, 1.0, d) for p in x])) for word, d in words]
