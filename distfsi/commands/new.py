"""Write a commented scene of a blast by the mass of a charge of TNT and its distance.

In free air, or with --wall of a charge on the ground before a wall. Cells, domain and end time suit the blast, by the
curves of UFC 3-340-02. On a terminal it asks for what is not given.

examples:
  distfsi new --tnt "5 kg" --range "3 m" --wall -o wall.toml
  distfsi new --tnt "11 lb" --range "20 ft" --no-wall
  distfsi new                                       asks
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from distfsi.commands.words import kilograms, metres, positive
from distfsi.errors import InputError

OUTPUT = Path("blast.toml")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("--tnt", type=kilograms, metavar="MASS", help='mass of TNT: 5, "5 kg", "11 lb"')
    parser.add_argument("--range", type=metres, metavar="R", help="distance from the charge's center")
    parser.add_argument(
        "--wall", action=argparse.BooleanOptionalAction, help="the charge on the ground, and a wall at that distance"
    )
    parser.add_argument("--cells", type=positive, metavar="N", help="cells from the charge to the wall (default: 125)")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=f"the new file (default: {OUTPUT})")


def execute(arguments: argparse.Namespace) -> None:
    """Write the scene, and say what to do with it."""
    from distfsi.resources.new_scene import Blast, write_scene

    asks = sys.stdin.isatty() and sys.stdout.isatty() and None in (arguments.tnt, arguments.range)
    if asks:
        _ask(arguments)
    faults = [f"--{name}: is missing" for name in ("tnt", "range") if getattr(arguments, name) is None]
    if arguments.cells and not arguments.wall:
        faults.append("--cells: is of a scene with --wall; in free air they follow from the charge")
    if faults:
        raise InputError(faults)
    blast = Blast(arguments.tnt, arguments.range, bool(arguments.wall), arguments.cells or Blast.cells)
    path = write_scene(blast, arguments.output or OUTPUT)
    print(f"{path}\n  distfsi check {path}     what it will cost\n  distfsi {path}           runs it")


def _ask(arguments: argparse.Namespace) -> None:
    """Ask for each thing that is not given."""
    questions: list[tuple[str, str, Callable[[str], Any], str]] = [
        ("tnt", "Mass of TNT", kilograms, "5 kg"),
        ("range", "Distance from the charge", metres, "3 m"),
        ("wall", "A wall there, and the charge on the ground (yes or no)", _yes, "yes"),
        ("cells", "Cells between charge and wall", positive, "125"),
        ("output", "File to write", Path, str(OUTPUT)),
    ]
    for name, question, kind, usual in questions:
        while getattr(arguments, name) is None and not (name == "cells" and not arguments.wall):
            answer = input(f"{question} [{usual}]: ").strip() or usual
            try:
                setattr(arguments, name, kind(answer))
            except (ValueError, argparse.ArgumentTypeError) as error:
                print(f"  {error}")


def _yes(text: str) -> bool:
    if text.lower() not in ("y", "yes", "n", "no"):
        raise ValueError(f"{text}; yes or no")
    return text.lower() in ("y", "yes")
