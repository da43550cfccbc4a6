"""Print the blast of a charge of TNT in air from the curves of Kingery and Bulmash (UFC 3-340-02).

Arrival, peak overpressure, impulse and duration of the positive phase at a distance from the center of a sphere in
free air, or of a hemisphere on the ground; reflected: at a large wall that the front meets head on. At sea level.

examples:
  distfsi blast --tnt "5 kg" --range "3 m"
  distfsi blast --tnt "10 kg" --range "3 m" --range "5 m" --surface
  distfsi blast --tnt "1 lb" --range 2 --plot blast.png      with the waves, and the curves over the distance
"""

from __future__ import annotations

import argparse
from pathlib import Path

from distfsi.commands.words import kilograms, metres
from distfsi.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("--tnt", type=kilograms, required=True, metavar="MASS", help='mass of TNT: 5, "5 kg", "11 lb"')
    parser.add_argument(
        "--range", type=metres, required=True, action="append", metavar="R", help="distance from the charge's center"
    )
    parser.add_argument("--surface", action="store_true", help="a hemisphere on the ground instead of a free sphere")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw waves and curves as PNG")


def execute(arguments: argparse.Namespace) -> None:
    """Print the table, and draw."""
    from distfsi.air_blast import FREE_AIR, SURFACE, air_blast
    from distfsi.resources.blast_sheet import draw, sheet

    burst, faults, blasts = SURFACE if arguments.surface else FREE_AIR, [], {}
    for distance in arguments.range:
        try:
            blasts[distance] = air_blast(arguments.tnt, distance, burst)
        except ValueError as error:
            faults.append(f"--range {distance:g} m: {error}")
    if faults:
        raise InputError(faults)
    print(sheet(burst, arguments.tnt, blasts))
    if arguments.plot:
        print(draw(burst, arguments.tnt, blasts, arguments.plot))
