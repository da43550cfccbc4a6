"""Faults of an input and how they are told: file, key, line, what was given, what was expected, the nearest word."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

Path = tuple[str | int, ...]

LONGEST_WORD = 100  # of which something near is sought

_HEADER = re.compile(r"\s*(\[\[?)([^\[\]]+)\]\]?\s*(?:#.*)?")
_KEY = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")
_PART = re.compile(r"""[\w-]+|"[^"]*"|'[^']*'""")


class Fault(NamedTuple):
    """One thing that is wrong at `path`, told in words."""

    path: Path
    text: str


def nearest(word: Any, words: Iterable[str]) -> str | None:
    """The one of `words` that resembles `word` most, if any does, whatever is written in capitals."""
    known = list(words)
    lowered = {each.lower(): each for each in known}
    found = difflib.get_close_matches(str(word)[:LONGEST_WORD], known, n=1)
    if not found:
        found = [lowered[near] for near in difflib.get_close_matches(str(word)[:LONGEST_WORD].lower(), lowered, n=1)]
    return next(iter(found), None)


def one_of(words: Iterable[str], given: Any) -> str:
    """'; expected one of ...', with the nearest of `words` to `given`."""
    words = list(words)
    near = nearest(given, words)
    return f"; expected one of {', '.join(map(repr, words))}" + (f"; did you mean {near!r}?" if near else "")


def dotted(path: Path) -> str:
    """A path as it is written after --set."""
    return ".".join(map(str, path))


class Locations:
    """Where the keys of a TOML text stand; keys in `overridden` came from the command line."""

    def __init__(self, file: str, text: str, overridden: Iterable[Path]):
        self.file = file
        self.lines = key_lines(text)
        self.overridden = set(overridden)

    def line(self, path: Path) -> int:
        """Line of the key at `path`, or of the table that lacks it; 0 when it is nowhere in the file."""
        return next((self.lines[prefix] for prefix in _prefixes(path) if prefix in self.lines), 0)

    def tell(self, faults: Iterable[Fault]) -> list[str]:
        """The lines of an InputError for `faults`, in the order of the file."""
        return [self._tell(fault) for fault in sorted(faults, key=lambda fault: self.line(fault.path))]

    def _tell(self, fault: Fault) -> str:
        if not fault.path:
            return f"{self.file}: {fault.text}"
        line = self.line(fault.path)
        where = f" (line {line})" if line else ""
        if self.overridden.intersection(_prefixes(fault.path)):
            where = " (--set)"
        return f"{self.file}: {dotted(fault.path)}{where}: {fault.text}"


def _prefixes(path: Path) -> list[Path]:
    """`path`, its parent, its parent's parent ..."""
    return [path[:n] for n in range(len(path), 0, -1)]


def key_lines(text: str) -> dict[Path, int]:
    """Line number of each table header and of each key that starts a line."""
    lines: dict[Path, int] = {}
    elements: dict[Path, int] = {}  # index of the latest element of each array of tables
    table: Path = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.fullmatch(line):
            table = _inside(_parts(header[2]), elements)
            if header[1] == "[[":
                elements[table] = elements.get(table, -1) + 1
                lines.setdefault(table, number)
                table += (elements[table],)
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault(table + _parts(key[1]), number)
    return lines


def _parts(text: str) -> Path:
    return tuple(part.strip("\"'") for part in _PART.findall(text))


def _inside(parts: Path, elements: Mapping[Path, int]) -> Path:
    """A header's path; a table below an array of tables belongs to the array's latest element."""
    path: Path = ()
    for n, part in enumerate(parts):
        path += (part,)
        if path in elements and n < len(parts) - 1:
            path += (elements[path],)
    return path
