"""A scene as text, by which a restart file knows the scene that it belongs to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from distfsi.errors import InputError

# What may change at a restart: as it likes, or so that the user is told.
FREE = ("title", "output", "gauges", "performance", "time.wall_clock_limit", "time.smallest_step")
REPORTED = ("time.end", "time.maximum_steps", "time.cfl")


def changes(was: Mapping[str, str], now: Mapping[str, str], path: Path) -> list[str]:
    """What has changed since the text `was` was written into the file `path` and bears on the results, although it may.

    Raises InputError with one line per key that differs and may not.
    """
    changed = {
        key: f"{key}: {now.get(key, 'absent')}; was {was.get(key, 'absent')} in {path}"
        for key in [*now, *(was.keys() - now.keys())]
        if now.get(key) != was.get(key) and not any(f"{key}.".startswith(f"{free}.") for free in FREE)
    }
    faults = [text for key, text in changed.items() if key not in REPORTED]
    if faults:
        may = f"{', '.join([*FREE, *REPORTED])}, and the numbers of ranks and threads"
        raise InputError([*faults, f"at a restart only these may change: {may}"])
    return list(changed.values())


def describe(scene: Any) -> dict[str, str]:
    """All that a scene says, value by value, under keys such as "fluid.phases.air.eos.gamma"."""
    return dict(_flat(scene, ()))


def _flat(value: Any, key: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    if is_dataclass(value):
        if key:
            yield ".".join(key), type(value).__name__
        for field in fields(value):
            if field.compare:
                yield from _flat(getattr(value, field.name), (*key, field.name))
    elif isinstance(value, tuple) and any(is_dataclass(entry) or isinstance(entry, tuple) for entry in value):
        for number, entry in enumerate(value):
            yield from _flat(entry, (*key, getattr(entry, "name", str(number))))
    else:
        yield ".".join(key), repr(value)
