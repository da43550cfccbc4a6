"""Say what an output directory holds and how its run ended.

example:
  distfsi info out/steel_tube
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("directory", type=Path, help="output directory of a run")


def execute(arguments: argparse.Namespace) -> None:
    """Print the description."""
    from distfsi.output.info import describe

    print(describe(arguments.directory))
