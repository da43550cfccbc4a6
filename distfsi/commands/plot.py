"""Draw the results of a run as PNG and GIF files.

Without options: maps of the pressure at all times with the particles on top, and the history. The files go into
`plots` in the run's output directory; their paths are printed.

examples:
  distfsi plot out/steel_tube
  distfsi plot out/steel_tube --field density --time "10 us"
  distfsi plot out/steel_tube --every 5 --particles von_mises --movie
  distfsi plot out/concrete_slab --slice "z=0.1 m"
  distfsi plot out/panel --gauges
"""

from __future__ import annotations

import argparse
from pathlib import Path

from distfsi.commands.words import plane, positive, seconds


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("directory", type=Path, help="output directory of a run")
    parser.add_argument("--field", metavar="NAME", help="field of the cells (default: pressure)")
    parser.add_argument("--particles", metavar="NAME", help="field that colors the particles")
    times = parser.add_mutually_exclusive_group()
    times.add_argument("--time", type=seconds, metavar="T", help='only the frame nearest to this time: 1e-5, "10 us"')
    times.add_argument("--every", type=positive, default=1, metavar="N", help="every N-th frame")
    parser.add_argument("--slice", type=plane, metavar="AXIS=POSITION", help='plane of a 3D run: z=0.1, "x=20 mm"')
    parser.add_argument("--gauges", action="store_true", help="the gauges in the place of fields and history")
    parser.add_argument("--mirror", action="store_true", help="both sides of the axis of an axisymmetric run")
    parser.add_argument("--movie", action="store_true", help="the frames as an animated GIF, too")


def execute(arguments: argparse.Namespace) -> None:
    """Draw, and print the paths."""
    from distfsi.output.plot import plot

    for path in plot(**{name: value for name, value in vars(arguments).items() if name != "execute"}):
        print(path)
