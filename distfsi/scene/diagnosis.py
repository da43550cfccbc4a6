"""From pydantic's errors to faults that a user understands."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from distfsi.scene.faults import Fault, Path, nearest, one_of

Json = Mapping[str, Any]

_LIMITS = {"greater_than": "> {gt:g}", "greater_than_equal": ">= {ge:g}", "less_than": "< {lt:g}"}
_LIMITS["less_than_equal"] = "<= {le:g}"


def diagnose(errors: Sequence[Any], data: Json, schema: Json) -> list[Fault]:
    """pydantic's `errors` about `data` as faults; the JSON `schema` knows the right words.

    A key that is missing because it is misspelt is told once.
    """
    unknown, rest, corrected = [], [], set()
    for error in errors:
        path = _path(error, data)
        if error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]:
            continue  # only because its entries are faulty, which is told already
        if error["type"] != "extra_forbidden":
            rest.append(_describe(error, path, data, schema))
            continue
        known = list(_node(path[:-1], data, schema).get("properties", ()))
        corrected.add(path[:-1] + (nearest(path[-1], known),))
        unknown.append(Fault(path, "unknown key" + one_of(known, path[-1])))
    return unknown + [fault for fault in rest if fault.path not in corrected]


def _path(error: dict[str, Any], data: Any) -> Path:
    """Where an error is, without the names of union members, which pydantic adds and which are no keys of `data`."""
    path: Path = ()
    for step in error["loc"]:
        if isinstance(data, dict) and step in data or isinstance(data, list) and step in range(len(data)):
            path, data = path + (step,), data[step]
    return path + error["loc"][-1:] if error["type"] == "missing" else path


def _describe(error: dict[str, Any], path: Path, data: Json, schema: Json) -> Fault:
    """What one error means."""
    kind, context, value = error["type"], error.get("ctx", {}), error["input"]
    given = _show(_at(path, data))
    if kind in _LIMITS:
        return Fault(path, f"{given}; must be {_LIMITS[kind].format(**context)}")
    match kind:
        case "missing":
            return Fault(path, f"is missing; expected {_meaning(path, data, schema)}")
        case "literal_error":
            return Fault(path, given + one_of(_quoted(context["expected"]), value))
        case "union_tag_invalid":
            is_word = isinstance(_at(path, data), str)  # which stands for a table
            path += () if is_word else tuple(_quoted(context["discriminator"]))
            return Fault(path, _show(context["tag"]) + one_of(_quoted(context["expected_tags"]), context["tag"]))
        case "union_tag_not_found":
            words = _discriminator(_property(path, data, schema)).get("mapping", ())
            return Fault(path + tuple(_quoted(context["discriminator"])), "is missing" + one_of(words, ""))
        case "model_attributes_type" | "model_type" | "dict_type":
            return Fault(path, f"{given}; expected a table")
        case "too_long":
            return Fault(path, f"has {len(value)} entries; at most {context['max_length']}")
        case "tuple_type":
            return Fault(path, f"{given}; expected a list")
        case "value_error":
            return Fault(path, str(context["error"]) if isinstance(value, dict) else f"{given} {context['error']}")
    message = error["msg"].replace("Input", "it").replace("Tuple", "it").replace(" after validation", "")
    return Fault(path, f"{given}; {message}")


def _at(path: Path, data: Any) -> Any:
    for step in path:
        items: dict[Any, Any] = data if isinstance(data, dict) else dict(enumerate(data))
        data = items.get(step)
    return data


def _quoted(text: str) -> list[str]:
    return re.findall(r"'([^']*)'", text)


def _show(value: Any) -> str:
    """A value about as it was written."""
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "..."


# ---- the JSON schema at a path ---------------------------------------------------------------------------------------


def _meaning(path: Path, data: Json, schema: Json) -> str:
    """What belongs at `path`, in words."""
    found = _property(path, data, schema)
    if "enum" in found:
        return "one of " + ", ".join(map(repr, found["enum"]))
    unit = found.get("unit", "1")
    return found.get("description", "a table") + (f" [{unit}]" if unit != "1" else "")


def _discriminator(node: Json) -> Json:
    """The discriminator of a property, also of one that may be absent."""
    options = [node, *node.get("anyOf", ())]
    return next((option["discriminator"] for option in options if "discriminator" in option), {})


def _child(node: Json, step: str | int) -> Json:
    """What the schema of a table or list says about one of its entries."""
    entries = node.get("prefixItems", ())
    if step in range(len(entries)):
        return entries[step]
    return node.get("properties", {}).get(step) or node.get("additionalProperties") or node.get("items") or {}


def _property(path: Path, data: Json, schema: Json) -> Json:
    """What the schema says about the key at `path`."""
    return _child(_node(path[:-1], data, schema), path[-1])


def _node(path: Path, data: Any, schema: Json) -> Json:
    """The schema of the table or list at `path`, with references and unions resolved as `data` chooses."""
    node = schema
    for step in path:
        data = data[step]
        node = _child(node, step)
        choice = _discriminator(node)
        if choice:
            word = data.get(choice["propertyName"]) if isinstance(data, dict) else None
            node = {"$ref": choice["mapping"].get(word, "")}
        for option in node.get("anyOf", ()):
            node = option if "$ref" in option else node
        if "$ref" in node:
            node = schema["$defs"].get(node["$ref"].rpartition("/")[2], {})
    return node
