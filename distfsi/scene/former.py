"""Words of earlier inputs: read for one release more, each with a note that tells the word of now."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from distfsi.scene.faults import Fault, Path

UNTIL = "0.3.0"
"""The version that no longer reads them."""

FORMER_KEYS: dict[Path, str] = {
    ("solid", "bodies", "*", "strength", "least_failure_strain"): "minimum_failure_strain",
}
FORMER_VALUES: dict[Path, dict[str, str]] = {
    ("coupling", "scheme"): {"paper": "immersed_boundary", "stairs": "staircase"},
}


def replace_former_words(data: dict[str, Any]) -> list[Fault]:
    """Change `data` in place to the words of now; a note for each that was changed, at its former path."""
    notes = []
    for pattern, now in FORMER_KEYS.items():
        for table, path in _tables(data, pattern[:-1]):
            if pattern[-1] in table and now not in table:
                table[now] = table.pop(pattern[-1])
                notes.append(Fault((*path, pattern[-1]), f"is called {now} now; the former word is read until {UNTIL}"))
    for pattern, words in FORMER_VALUES.items():
        for table, path in _tables(data, pattern[:-1]):
            given = table.get(pattern[-1])
            if isinstance(given, str) and given in words:
                now = table[pattern[-1]] = words[given]
                notes.append(Fault((*path, pattern[-1]), f"'{given}' is called '{now}' now; read until {UNTIL}"))
    return notes


def _tables(data: Any, pattern: Path, path: Path = ()) -> Iterator[tuple[dict[str | int, Any], Path]]:
    """The tables at a path, in which "*" stands for any name, and their paths."""
    if not isinstance(data, dict):
        return
    if not pattern:
        yield data, path
    for name in data if pattern[:1] == ("*",) else pattern[:1]:
        yield from _tables(data.get(str(name)), pattern[1:], (*path, name))
