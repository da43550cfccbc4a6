"""Values from the command line, `key.path=value`, laid over the tables of the input."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from typing import Any

from distfsi.scene.faults import Fault, Path, dotted, one_of

NAMED: dict[Path, str] = {
    ("fluid", "phases"): "phase",
    ("solid", "bodies"): "body",
    ("solid", "rigid"): "rigid body",
    ("solid", "obstacles"): "obstacle",
}  # tables of names, which an override cannot add to
TABLES: set[Path] = {*NAMED, ("gauges",), ("sources",), ("loads",)}  # all tables of names
SHOWN = 100  # letters of a setting in a fault
REMOVED = "none"  # the value that removes a table


def apply(data: dict[str, Any], overrides: Iterable[str]) -> tuple[list[Path], list[Fault]]:
    """Change `data` in place; returns the paths that were set and the faults of the rest.

    A value is read as TOML, and as a plain string where it is none; numbers in a path index lists. `none` removes a
    whole section, or a table of those that have names.
    """
    paths, faults = [], []
    for text in overrides:
        key, equals, value = text.partition("=")
        path = tuple(int(part) if _is_index(part) else part for part in key.strip().split("."))
        if not equals or "" in path:
            faults.append(Fault(("--set",), f"'{text[:SHOWN]}'; expected key.path=value"))
        elif (trouble := _set(data, path, _value(value.strip()))) is None:
            paths.append(path)
        else:
            faults.append(Fault(("--set",), f"'{text[:SHOWN]}'; {trouble}"))
    return paths, faults


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):  # no TOML, a number of thousands of digits, brackets in too many brackets
        return text


def _is_table(data: Any, step: str | int) -> bool:
    return isinstance(data, dict) and isinstance(data.get(step), dict)


def _is_index(part: str) -> bool:
    return part.isdecimal() and len(part) < 10


def _set(data: Any, path: Path, value: Any) -> str | None:
    """Set one value; returns what is wrong with the path, if anything."""
    for n, step in enumerate(path):
        last = n == len(path) - 1
        if isinstance(data, list):
            if step not in range(len(data)):
                return f"{dotted(path[:n])} has elements 0 to {len(data) - 1}"
        elif not isinstance(data, dict):
            return f"{dotted(path[:n])} is no table"
        else:
            step = str(step)
            if path[:n] in NAMED and step not in data:
                return f"no such {NAMED[path[:n]]}" + one_of(data, step)
            if not last:
                data.setdefault(step, {})
        if last and value == REMOVED and _is_table(data, step) and (n == 0 or path[:n] in TABLES):
            del data[step]
        elif last:
            data[step] = value
        else:
            data = data[step]
    return None
