"""Write the report of a run: one HTML file that needs no network.

Key results come first: the blast at gauges, beside the curves of UFC 3-340-02 where one charge in air makes these
apply, how far bodies have moved, fragments. Then the scene as it was posed, with the sources of its materials;
pictures; conservation; warnings; what the run cost; how to repeat it. A run does not write it: it takes seconds.

examples:
  distfsi report out/steel_tube                     writes out/steel_tube/report.html
  distfsi report out/steel_tube -o tube.html
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("directory", type=Path, help="output directory of a run")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="the file to write (default: report.html in the directory)"
    )


def execute(arguments: argparse.Namespace) -> None:
    """Write the report, and print its path."""
    from distfsi.report.report import write_report

    print(write_report(arguments.directory, arguments.output))
