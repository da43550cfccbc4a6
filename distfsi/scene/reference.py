"""The reference of the input, written from the schema: `python -m distfsi.scene.reference > docs/input.md`; and the
schema itself for editors: `distfsi schema > docs/distfsi.schema.json`."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

from distfsi.gauges import Gauge
from distfsi.laws.law import Afterburn, Burn, Failure, FluidEos, Law, PressureHistory, SolidEos, Source, Strength
from distfsi.laws.registry import laws_of
from distfsi.scene.composed_tables import TABLES
from distfsi.scene.loader import schema

Json = Mapping[str, Any]

INTRODUCTION = """# The input file

<!-- Written from the schema: python -m distfsi.scene.reference > docs/input.md -->

An input is a TOML file with `[domain]`, `[time]`, and `[fluid]`, `[solid]` or both. `inputs/` holds examples.

* A number is in SI units; a text carries its own: `"0.5 mm"`, `"7.81 GPa"`, `"1.225 kg/m3"`, `"477 J/(kg K)"`.
  Prefixes n u m c k M G go with m g s Hz N Pa bar J cal W; known besides: K t lb in ft l min h atm psi rad deg %.
  Temperatures are in K.
* A vector is a list with one entry per dimension of the domain; in one dimension a plain number will do.
* Any value can be set on the command line: `--set time.cfl=0.4 --set solid.bodies.tube.strength=none
  --set fluid.regions.1.density="1600 kg/m3"`; numbers in a path count the elements of a list from 0.
* All faults are told at once, each with its key, its line, what was expected and the nearest right word.

Keys without a default are needed. A phase of the fluid or a body with a `material` takes what it leaves out from the
data of the package: `distfsi materials` lists the names, `distfsi materials TNT` shows one with its sources.
"""


def _names(kind: type[Law]) -> tuple[str, ...]:
    """Of the tables of a kind of laws."""
    return tuple(law.__name__ for law in laws_of(kind))


SECTIONS = {
    "Top level": ("Input",),
    "`[domain]`": ("DomainInput",),
    "`[time]`": ("TimeInput",),
    "`[fluid]`": ("FluidInput",),
    "`[fluid.phases.NAME]`": ("NamedPhase", *_names(FluidEos)),
    "`[[fluid.regions]]`": ("RegionInput",),
    "`[fluid.detonation]`": ("DetonationInput",),
    "`burn` of the detonation": _names(Burn),
    "`[[fluid.detonation.detonators]]`": ("PointDetonator", "LineDetonator", "PlaneDetonator"),
    "`[[charges]]`": ("ChargeInput",),
    "`[fluid.afterburn]`": ("AfterburnSectionInput",),
    "`law` of the afterburn": _names(Afterburn),
    "`[fluid.map]`": ("MapInput",),
    "`[fluid.inflow.x_low]`, `x_high`, `y_low` ...": ("InflowStateInput",),
    "`history` of an inflow": _names(PressureHistory),
    "`[solid]`": ("SolidInput",),
    "`[solid.bodies.NAME]`": ("BodyInput",),
    "`[solid.bodies.NAME.bars]`": ("BarsInput",),
    "`[solid.bodies.NAME.bars.bond]`": ("BondInput",),
    "`[solid.rigid.NAME]`": ("RigidInput",),
    "`[[solid.rigid.NAME.supports]]`": ("SupportInput",),
    "`[solid.obstacles.NAME]`": ("ObstacleInput",),
    "`[solid.obstacles.NAME.motion]`": ("MotionInput",),
    "`eos` of a body": _names(SolidEos),
    "`strength` of a body": _names(Strength),
    "`failure` of a body": (*_names(Failure), "Scatter"),
    "Shapes": ("Box", "Ball", "HalfSpace", "Tube", "Cylinder"),
    "Shapes made of others, and from files": tuple(table.__name__ for table in TABLES),
    "`[sources.NAME]`": _names(Source),
    "`[loads.NAME]`": ("LoadInput",),
    "`[output]`": ("OutputInput",),
    "`[output.peaks]`": ("PeaksInput",),
    "`[gauges.NAME]`": _names(Gauge),
    "`[coupling]`": ("CouplingInput",),
    "`[performance]`": ("PerformanceInput",),
    "`[[stages]]`": ("StageInput",),
}
TABLE_HEAD = ["| key | value | default | meaning |", "|---|---|---|---|"]
LIMITS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}


def markdown() -> str:
    """The whole reference as Markdown."""
    whole = schema()
    definitions = whole["$defs"] | {"Input": whole}
    lines = [INTRODUCTION]
    for heading, names in SECTIONS.items():
        lines += [f"## {heading}", ""]
        for name in names:
            lines += [definitions[name]["description"], "", *_table(definitions[name]), ""]
    return "\n".join(lines)


def json_schema() -> str:
    """The JSON schema of the input as text."""
    named = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "distfsi input"}
    whole = deepcopy(schema())
    for table in (whole, *whole["$defs"].values()):
        for node in table.get("properties", {}).values():
            if "description" not in node:
                node["description"] = _meaning(node, table, whole["$defs"])
    return json.dumps(whole | named, indent=1, ensure_ascii=False) + "\n"


def _meaning(node: Json, table: Json, definitions: Json) -> str:
    """What a key without a description of its own means: one that chooses its table, what that is; one that holds a
    table, what this is."""
    if "const" in node:
        return str(table["description"])
    options = [node, *node.get("anyOf", ())]
    names = [option["$ref"].rpartition("/")[2] for option in options if "$ref" in option]
    return str(definitions[names[0]]["description"])


def _table(definition: Json) -> Iterator[str]:
    needed = dict.fromkeys(definition.get("required", ()), "needed")
    needed |= dict.fromkeys(definition.get("from_material", ()), "needed, or the material's")
    rows = [_row(key, node, needed.get(key)) for key, node in definition["properties"].items()]
    rows = [row for row in rows if row]
    yield from TABLE_HEAD + rows if rows else ()


def _row(key: str, node: Json, needed: str | None) -> str:
    """One key; sections, which have headings of their own, give no row."""
    if "description" not in node and "const" not in node:
        return ""
    default = node.get("default")
    shown = needed or ("" if default is None or isinstance(default, dict) else f"`{_toml(default)}`")
    return f"| `{key}` | {_values(node)} | {shown} | {node.get('description', 'chooses this one')} |"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else str(value)


def _values(node: Json) -> str:
    """What may stand behind the key."""
    if "const" in node:
        return f'`"{node["const"]}"`'
    if "enum" in node:
        return ", ".join(f'`"{word}"`' for word in node["enum"])
    if "prefixItems" in node:
        return "two of " + _values(node["prefixItems"][0])
    options = [node, *node.get("anyOf", ())]
    for option in options:
        if "discriminator" in option:
            choice = option["discriminator"]
            if "union" in choice["mapping"]:
                return "table of a shape"
            return f"table with `{choice['propertyName']}` " + ", ".join(f'`"{word}"`' for word in choice["mapping"])
        if "unit" in option:
            limits = [f"{sign} {option[key]:g}" for key, sign in LIMITS.items() if key in option]
            kind = "number" if option["unit"] == "1" else option["unit"]
            return ", ".join(["vector"] * ("array" in option["type"]) + [kind, *limits])
        if "integer" in option.get("type", ()):
            return "whole number" + ("s, one per axis" if "array" in option["type"] else "")
    types = {option.get("type") for option in options}
    if "boolean" in types:
        return "`true`, `false`" + (", table" if any("$ref" in option for option in options) else "")
    if "array" in types:
        return "list of vectors, " + items["unit"] if "unit" in (items := node.get("items", {})) else "list of tables"
    return "text" if "string" in types else "table"


if __name__ == "__main__":
    print(markdown())
