"""List the materials that an input can name, or show one with its sources.

A phase of the fluid or a body takes its equation of state, strength and failure from `material = "TNT"`; keys beside
the name change them. For a material: its numbers, where they come from, where they hold, what follows from them.

examples:
  distfsi materials
  distfsi materials TNT
  distfsi materials "steel 4340" --plot steel.png      with its Hugoniot and yield curves
"""

from __future__ import annotations

import argparse
from pathlib import Path

from distfsi.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="the material to show")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw its Hugoniot and yield curves as PNG")


def execute(arguments: argparse.Namespace) -> None:
    """Print the list or the sheet."""
    from distfsi.resources.material_sheet import draw, listed, sheet
    from distfsi.scene.materials import find, materials, unknown

    if arguments.name is None:
        if arguments.plot:
            raise InputError(["--plot: needs the name of a material"])
        print(listed(materials()))
        return
    material = find(arguments.name)
    if material is None:
        raise InputError([f"'{arguments.name}' {unknown(arguments.name, materials())}"])
    print(sheet(material))
    if arguments.plot:
        print(draw(material, arguments.plot))
