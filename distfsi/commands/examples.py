"""List the inputs that come with distfsi, or copy some of them into a folder.

examples:
  distfsi examples                           names, what they are, size and rough time on one core
  distfsi examples sod                       writes sod.toml here
  distfsi examples sod panel --to scenes     into a folder, which is made if need be
"""

from __future__ import annotations

import argparse
import difflib
from pathlib import Path

from distfsi.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="examples to copy")
    parser.add_argument("--to", type=Path, default=Path(), metavar="DIR", help="folder for the copies (default: here)")


def execute(arguments: argparse.Namespace) -> None:
    """List, or copy and print the paths of the copies."""
    from distfsi.scene.shipped import examples

    known = {example.name: example for example in examples()}
    if not arguments.names:
        print("\n".join(f"{e.name:17}{e.description}\n{'':17}{e.size}" for e in known.values()))
        return
    unknown = [name for name in arguments.names if name not in known]
    targets = {name: arguments.to / f"{name}.toml" for name in arguments.names}
    existing = [path for path in targets.values() if path.exists()]
    if unknown or existing:
        raise InputError([*(_unknown(name, list(known)) for name in unknown), *(f"{p}: exists" for p in existing)])
    arguments.to.mkdir(parents=True, exist_ok=True)
    for name, target in targets.items():
        target.write_text(_text(known[name].file), encoding="utf-8")
        print(target)


def _unknown(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, 1)
    return f"{name}: no such example" + (f"; did you mean '{near[0]}'?" if near else "; `distfsi examples` lists them")


def _text(file: Path) -> str:
    """The example without its first line, which names the schema by its place in the repository."""
    first, _, rest = file.read_text(encoding="utf-8").partition("\n")
    return rest if first.startswith("#:schema") else f"{first}\n{rest}"
