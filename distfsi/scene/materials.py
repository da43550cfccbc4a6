"""Materials by name: data of the package, each with its source, which fill in what a table of the input leaves out.

A file of distfsi/materials/ is one material. Its tables are the parts of it: `fluid` (an equation of state, and
`state`, what it is at before anything happens), or `eos`, `strength` and `failure` of a solid; of explosives
`detonation` as its source gives it, and `tnt_equivalent`. Each part says its source, how that was checked, range and
caveat.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from pydantic import TypeAdapter

from distfsi.laws.law import Law
from distfsi.scene.faults import Fault, Path, nearest
from distfsi.scene.law_tables import FailureInput, PhaseInput, SolidEosInput, StrengthInput
from distfsi.scene.units import to_si

ABOUT = ("source", "checked", "range", "caveat")  # what a part says of itself
ATMOSPHERE = 101325.0  # [Pa]
SOLID_PARTS = ("eos", "strength", "failure")


@dataclass(frozen=True)
class Part:
    """Keys and values of one part of a material, as an input would give them, and what is said of them."""

    values: Mapping[str, Any]
    about: Mapping[str, str]


@dataclass(frozen=True)
class Detonation:
    """What the source of an explosive gives: density [kg/m3], energy [J/m3], speed [m/s], pressure [Pa]."""

    density: float
    energy: float
    speed: float
    pressure: float


@dataclass(frozen=True)
class Material:
    """A named material; `kind` is what it is listed under, `density` [kg/m3] that of a solid at rest."""

    name: str
    aliases: tuple[str, ...]
    kind: str
    description: str
    parts: Mapping[str, Part]
    density: Any = None

    @property
    def is_solid(self) -> bool:
        """Whether bodies can be made of it, and not phases of the fluid."""
        return "eos" in self.parts

    @property
    def detonation(self) -> Detonation | None:
        """Of an explosive, as its source gives it."""
        if "detonation" not in self.parts:
            return None
        units = {"density": "kg/m3", "energy": "Pa", "speed": "m/s", "pressure": "Pa"}
        values = self.parts["detonation"].values
        return Detonation(**{key: to_si(values[key], unit) for key, unit in units.items()})

    @property
    def state(self) -> dict[str, Any]:
        """Keys of a region of the fluid that holds it before anything happens; of an explosive all energy released."""
        explosive = self.detonation
        if explosive is not None:
            return {"density": explosive.density, "energy": explosive.energy / explosive.density}
        return dict(self.parts["state"].values)

    @property
    def unburnt(self) -> dict[str, Any]:
        """The same of an explosive that has not burnt yet."""
        explosive = self.detonation
        return self.state if explosive is None else {"density": explosive.density, "pressure": ATMOSPHERE}


@cache
def materials() -> tuple[Material, ...]:
    """All materials of the package, by kind and name."""
    folder = resources.files("distfsi") / "materials"
    texts = [file.read_text(encoding="utf-8") for file in folder.iterdir() if file.name.endswith(".toml")]
    return tuple(sorted(map(_material, texts), key=lambda each: (each.kind, each.name.lower())))


def _material(text: str) -> Material:
    data = tomllib.loads(text)
    tables = {key: data.pop(key) for key in [*data] if isinstance(data[key], dict)}
    parts = {
        name: Part(
            {key: value for key, value in table.items() if key not in ABOUT},
            {key: table[key] for key in ABOUT if key in table},
        )
        for name, table in tables.items()
    }
    return Material(**data | {"aliases": tuple(data["aliases"])}, parts=parts)


def find(name: object) -> Material | None:
    """The material of this name or alias, whatever its case, blanks and hyphens; None if there is none."""
    return next((each for each in materials() if _plain(name) in map(_plain, (each.name, *each.aliases))), None)


def unknown(name: object, fitting: Iterable[Material]) -> str:
    """What to say of a name that none of the `fitting` materials has."""
    names = {each.lower(): each for material in fitting for each in (material.name, *material.aliases)}
    near = nearest(str(name).lower(), names)
    hint = f"did you mean '{names[near]}'? " if near else ""
    return f"names no such material; {hint}`distfsi materials` lists them"


def _plain(name: object) -> str:
    return re.sub(r"[^a-z0-9.]", "", str(name).lower())


# ---- filling in ------------------------------------------------------------------------------------------------------


def fill(data: Mapping[str, Any]) -> tuple[list[Fault], list[Path]]:
    """Put into tables of the input `data` that name a material what they leave out; returns the faults of the
    names, and the tables that therefore stay incomplete.

    Of a phase: its equation of state; of its states: density, and pressure or energy; of a body: density, eos, strength
    and failure, each as a whole, or, where the input gives the same kind, what that leaves out.
    """
    fluid, solid = _table(data, "fluid"), _table(data, "solid")
    faults = []
    for path, table in _tables(("solid", "bodies"), solid.get("bodies")):
        faults += _fill_body(path, table)
    named: dict[str, Material] = {}
    for path, table in _tables(("fluid", "phases"), fluid.get("phases")):
        faults += _fill_phase(path, table, named)
    incomplete = [fault.path[:-1] for fault in faults]
    detonation = _table(fluid, "detonation")
    explosive = str(detonation.get("phase"))
    if explosive in named:
        _fill_burn(detonation, named[explosive])
    for path, state in _states(fluid):
        phase = str(state.get("phase"))
        if phase in named:
            _fill_state(state, named[phase].unburnt if phase == explosive else named[phase].state)
        elif ("fluid", "phases", phase) in incomplete:
            incomplete.append(path)
    return faults, incomplete


def _table(data: Mapping[str, Any], key: str) -> dict[str, Any]:
    found = data.get(key)
    return found if isinstance(found, dict) else {}


def _tables(path: Path, tables: object) -> Iterator[tuple[Path, dict[str, Any]]]:
    """The tables of a table of names that name a material."""
    for name, table in tables.items() if isinstance(tables, dict) else ():
        if isinstance(table, dict) and "material" in table:
            yield (*path, name), table


def _states(fluid: Mapping[str, Any]) -> Iterator[tuple[Path, dict[str, Any]]]:
    regions = fluid.get("regions")
    found: list[tuple[Path, Any]] = [
        (("fluid", "regions", n), each) for n, each in enumerate(regions if isinstance(regions, list) else ())
    ]
    found += [(("fluid", "inflow", name), each) for name, each in _table(fluid, "inflow").items()]
    yield from ((path, each) for path, each in found if isinstance(each, dict))


def _named(path: Path, name: object, solid: bool) -> tuple[Material | None, list[Fault]]:
    material = find(name)
    at = (*path, "material")
    if material is None:
        return None, [Fault(at, f'"{name}" ' + unknown(name, [m for m in materials() if m.is_solid == solid]))]
    if material.is_solid != solid:
        what = "solid, and no fluid" if material.is_solid else "fluid, and no solid"
        return None, [Fault(at, f'"{name}" is a {what}')]
    return material, []


def _fill_phase(path: Path, table: dict[str, Any], named: dict[str, Material]) -> list[Fault]:
    material, faults = _named(path, table["material"], solid=False)
    if material is None:
        return faults
    law = material.parts["fluid"].values
    if table.get("eos", law["eos"]) != law["eos"]:
        return [Fault((*path, "eos"), f"\"{table['eos']}\"; '{material.name}' is of the eos '{law['eos']}'; give one")]
    named[str(path[-1])] = material
    _complete(table, law)
    return []


def _fill_burn(table: dict[str, Any], material: Material) -> None:
    given = material.detonation
    burn = table.setdefault("burn", {})
    if given is not None and isinstance(burn, dict):
        values = {"density": given.density, "energy": given.energy / given.density}
        _complete(burn, {"kind": "programmed", **values, "speed": given.speed, "pressure": given.pressure})


def _fill_state(state: dict[str, Any], values: Mapping[str, Any]) -> None:
    given = {"pressure", "energy"} & state.keys()
    _complete(state, {key: value for key, value in values.items() if key == "density" or not given})


def _fill_body(path: Path, table: dict[str, Any]) -> list[Fault]:
    material, faults = _named(path, table["material"], solid=True)
    if material is None:
        return faults
    table.setdefault("density", material.density)
    for name in SOLID_PARTS:
        law = material.parts[name].values if name in material.parts else None
        given = table.get(name)
        if law is None:
            continue
        if given is None:
            table[name] = dict(law)
        elif isinstance(given, dict) and given.get("kind", law["kind"]) == law["kind"]:
            _complete(given, law)
    return []


def _complete(table: dict[str, Any], values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        table.setdefault(key, value)


# ---- laws of a material ----------------------------------------------------------------------------------------------


def laws(material: Material) -> dict[str, Law]:
    """The laws of a material by its part: "fluid", or "eos", "strength" and "failure", built from its numbers."""
    kinds: dict[str, Any] = {
        "fluid": PhaseInput,
        "eos": SolidEosInput,
        "strength": StrengthInput,
        "failure": FailureInput,
    }
    tables = {name: part.values for name, part in material.parts.items() if name in kinds}
    return {name: TypeAdapter(kinds[name]).validate_python(table).build() for name, table in tables.items()}
