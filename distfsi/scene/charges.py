"""Charges by what people know: an explosive by its name, a mass, a shape and a place.

A charge becomes a region of the fluid, of exactly its mass whatever the cells, and a detonator, if it needs one.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any, Literal

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from distfsi.scene.faults import Fault, Path, one_of
from distfsi.scene.materials import Material, find, materials, unknown
from distfsi.scene.units import to_si
from distfsi.scene.values import Delay, Direction, Mass, Position, PositiveNumber, Table

BURNS_AT_ONCE = "instant"
SHAPES = {  # of charges, by dimensions and symmetry of the domain
    (3, "planar"): ("sphere", "hemisphere", "cylinder", "box"),
    (2, "axisymmetric"): ("sphere", "hemisphere", "cylinder"),
    (1, "spherical"): ("sphere",),
}


class ChargeInput(Table):
    """A charge of an explosive, in three dimensions or in spherical or axisymmetric coordinates. Its phase is that of
    the material, if the fluid has it, else a new one of that name."""

    material: str = Field(description="name of an explosive (`distfsi materials`)")
    mass: Mass = Field(description="its mass; of a hemisphere that of the half that is there")
    center: Position = Field(description="its center; of a hemisphere that of its flat side, on an end of the domain")
    shape: Literal["sphere", "hemisphere", "cylinder", "box"] = Field("sphere", description="its shape")
    axis: Direction = Field((0.0, 0.0, 1.0), description="of a cylinder: the direction of its axis")
    length_over_diameter: PositiveNumber = Field(1.0, description="of a cylinder")
    proportions: Direction = Field((1.0, 1.0, 1.0), description="of a box: its edges to each other")
    burn: Literal["lighting_times", "instant"] = Field(
        "lighting_times", description="from its detonator on, or all at once at the start"
    )
    detonator: Position | None = Field(None, description="where it is lit; default its center")
    delay: Delay = Field(0.0, description="when it is lit")

    @model_validator(mode="after")
    def _has_edges(self) -> ChargeInput:
        if min(self.proportions) <= 0.0:
            raise ValueError("proportions must be positive")
        return self


def add_charges(data: dict[str, Any]) -> tuple[list[Fault], list[Fault]]:
    """Put regions, phases and detonators of the `charges` of an input into its `fluid`; faults, and what is to be told.

    Charges that are wrong in themselves are left to the check of their tables.
    """
    charges, fluid = data.get("charges"), data.setdefault("fluid", {}) if data.get("charges") else None
    if not isinstance(charges, list) or not isinstance(fluid, dict) or not _takes_charges(fluid):
        return [], []  # what is wrong there is told of these tables
    domain = data.get("domain")
    domain = domain if isinstance(domain, dict) else {}
    cells = domain.get("cells")
    dimensions = len(cells) if isinstance(cells, list) else 1
    shapes = SHAPES.get((dimensions, str(domain.get("symmetry", "planar"))))
    if shapes is None:
        text = "a mass needs three dimensions, or spherical or axisymmetric coordinates; else give a region"
        return [Fault(("charges",), text)], []
    if "map" in fluid:
        text = "the run that is mapped holds its charge already; leave it out, or give another one as a region"
        return [Fault(("charges",), text)], []
    faults, notes = [], []
    for n, table in enumerate(charges):
        path: Path = ("charges", n)
        try:
            charge = TypeAdapter(ChargeInput).validate_python(table, context={"dimensions": dimensions})
        except ValidationError:
            continue
        material = find(charge.material)
        if material is None or material.detonation is None:
            explosives = [each for each in materials() if each.detonation]
            faults.append(Fault((*path, "material"), f'"{charge.material}" {unknown(charge.material, explosives)}'))
            continue
        if charge.shape not in shapes:
            faults.append(Fault((*path, "shape"), f'"{charge.shape}"' + one_of(shapes, charge.shape) + " here"))
            continue
        notes.append(Fault(path, _add_charge(charge, material, fluid)))
    return faults, notes


def _takes_charges(fluid: dict[str, Any]) -> bool:
    """Whether what charges are added to is of the right kind as far as it is there."""
    detonation = fluid.get("detonation", {})
    wanted = ((fluid.get("regions", []), list), (fluid.get("phases", {}), dict), (detonation, dict))
    if not all(isinstance(found, kind) for found, kind in wanted):
        return False
    return isinstance(detonation.get("detonators", []), list)


def _add_charge(charge: ChargeInput, material: Material, fluid: dict[str, Any]) -> str:
    """Put one charge into the fluid; what it is, in words."""
    explosive = material.detonation
    assert explosive is not None
    phase = _phase(material, fluid)
    shape, size = _shape(charge, charge.mass / explosive.density)
    fluid.setdefault("regions", []).append({"phase": phase, "shape": shape})
    if charge.burn != BURNS_AT_ONCE:
        detonation = fluid.setdefault("detonation", {"phase": phase})
        detonation.setdefault("detonators", []).append(
            {"kind": "point", "position": [*(charge.detonator or charge.center)], "delay": charge.delay}
        )
    return f"{charge.mass:g} kg of {material.name}, a {charge.shape} {size}; {equivalence(material, charge.mass)}"


def _phase(material: Material, fluid: dict[str, Any]) -> str:
    """The name of the fluid's phase of a material, which is added if there is none."""
    phases = fluid.setdefault("phases", {})
    for name, table in phases.items():
        if isinstance(table, dict) and find(str(table.get("material"))) is material:
            return str(name)
    name = material.name.lower().replace(" ", "_")
    phases[name] = {"material": material.name}
    return name


def _shape(charge: ChargeInput, volume: float) -> tuple[dict[str, Any], str]:
    """The table of the shape of a charge of this volume [m3], and its size in words."""
    center = charge.center
    match charge.shape:
        case "sphere" | "hemisphere":
            whole = 2.0 * volume if charge.shape == "hemisphere" else volume
            radius = (3.0 * whole / (4.0 * pi)) ** (1.0 / 3.0)
            return {"kind": "ball", "center": [*center], "radius": radius}, f"of radius {1e3 * radius:.4g} mm"
        case "cylinder":
            radius = (volume / (2.0 * pi * charge.length_over_diameter)) ** (1.0 / 3.0)
            length = 2.0 * radius * charge.length_over_diameter
            norm = sum(a * a for a in charge.axis) ** 0.5
            if len(center) == 2:
                low, high = ([r, center[1] + s * 0.5 * length] for s, r in ((-1.0, 0.0), (1.0, radius)))
                table: dict[str, Any] = {"kind": "box", "lower": low, "upper": high}
                return table, f"of radius {1e3 * radius:.4g} mm and length {1e3 * length:.4g} mm"
            half = [0.5 * length * a / norm for a in charge.axis]
            start, end = ([c + s * h for c, h in zip(center, half, strict=True)] for s in (-1.0, 1.0))
            table = {"kind": "cylinder", "start": start, "end": end, "radius": radius}
            return table, f"of radius {1e3 * radius:.4g} mm and length {1e3 * length:.4g} mm"
    a, b, c = charge.proportions
    edge = (volume / (a * b * c)) ** (1.0 / 3.0)
    edges = [edge * each for each in charge.proportions]
    lower, upper = ([x + s * e for x, e in zip(center, edges, strict=True)] for s in (-0.5, 0.5))
    return {"kind": "box", "lower": lower, "upper": upper}, "of " + " x ".join(f"{1e3 * e:.4g}" for e in edges) + " mm"


def equivalence(material: Material, mass: float) -> str:
    """What mass of TNT makes the same blast, in words: by measured pressures and impulses, or else by energy."""
    explosive, tnt = material.detonation, find("TNT")
    assert explosive is not None and tnt is not None and tnt.detonation is not None
    energy = explosive.energy / explosive.density / (tnt.detonation.energy / tnt.detonation.density)
    part = material.parts.get("tnt_equivalent")
    measured: Mapping[str, Any] = part.values if part else {}
    words = [f"{to_si(factor, '1') * mass:.4g} kg by {kind}" for kind, factor in measured.items()]
    return "TNT equivalent " + ", ".join([*words, f"{energy * mass:.4g} kg by energy of detonation"])
