"""Compile the kernels of a scene, and compute nothing else.

Kernels are compiled once for each kind of scene and kept on disk ($DISTFSI_CACHE, else the user's cache folder): a run
finds them there, whatever the numbers of its scene are. A large job compiles on one node before all of them start.

examples:
  distfsi compile scene.toml
  DISTFSI_CACHE=/shared/kernels distfsi compile scene.toml
"""

from __future__ import annotations

import argparse

from distfsi.commands.ranks import load_once, reported_once, start_ranks
from distfsi.commands.words import add_overrides


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("input", help="the scene, a TOML file")
    add_overrides(parser)


def execute(arguments: argparse.Namespace) -> None:
    """Compile."""
    from distfsi.device.cache import cache_directory
    from distfsi.execution import compile_kernels

    communicator = start_ranks()
    with reported_once(communicator):
        made = compile_kernels(load_once(arguments.input, arguments.set, communicator), communicator)
        if communicator.rank == 0:
            print(f"{made} kernels compiled; all are in {cache_directory()}")
