"""Remove the results of earlier runs that new ones have set aside.

A run moves what an earlier one has left in its output directory to `earlier-1`, `earlier-2` ... in it. This removes
these folders; the results of the last run, and files that no run has made, stay.

examples:
  distfsi clean out/steel_tube
  distfsi clean out/steel_tube --dry-run     say what would be removed
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("directory", type=Path, help="output directory of a run")
    parser.add_argument("--dry-run", action="store_true", help="remove nothing, only say what would be")


def execute(arguments: argparse.Namespace) -> None:
    """Remove, and say how much. Raises InputError when there is no such directory."""
    from distfsi.errors import InputError
    from distfsi.output.manifest import discard, earlier_results
    from distfsi.output.scales import format_bytes

    if not arguments.directory.is_dir():
        raise InputError([f"{arguments.directory}: is no directory"])
    found = earlier_results(arguments.directory)
    for path, size in found:
        if arguments.dry_run:
            print(f"{path}: {format_bytes(size)}")
        else:
            rest = "" if discard(path) else "; files in it that no run has made stay"
            print(f"{path}: {format_bytes(size)} removed{rest}")
    if not found:
        print(f"{arguments.directory}: nothing was set aside")
