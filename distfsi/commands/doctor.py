"""Say what a run would find here: MPI, GPUs, HDF5, threads, free disk space.

Start it like the run itself, with the same launcher and number of ranks.

examples:
  distfsi doctor
  mpiexec -n 4 distfsi doctor
"""

from __future__ import annotations

import argparse

from distfsi.commands.ranks import start_ranks


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command takes nothing."""


def execute(arguments: argparse.Namespace) -> None:
    """Print what all ranks found."""
    from distfsi.resources import machine

    machine.main(start_ranks())
