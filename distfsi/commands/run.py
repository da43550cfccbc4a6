"""Run a scene. The word `run` may be left out.

Fields, history, restart files and a summary picture go into the scene's output directory, out/NAME unless the scene
names another. The same input gives the same bits on any number of ranks and threads.

examples:
  distfsi run scene.toml
  distfsi run scene.toml --set domain.cells=[400,400] --set output.directory=out/fine
  mpiexec -n 4 distfsi run scene.toml --threads 2
  distfsi run scene.toml --restart auto      continue from the newest restart file
  mpiexec -n 4 distfsi run scene.toml --gpu
"""

from __future__ import annotations

import argparse

from distfsi.commands.ranks import load_once, reported_once, start_ranks
from distfsi.commands.words import add_overrides, positive


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("input", help="the scene, a TOML file")
    add_overrides(parser)
    parser.add_argument(
        "--threads", type=positive, help="threads per rank (default: the node's cores shared by its ranks)"
    )
    parser.add_argument("--gpu", action="store_true", help="compute on the node's GPUs")
    parser.add_argument(
        "--gpu-aware-mpi",
        action="store_true",
        help="with --gpu: send messages straight from GPU memory, if a trial shows that MPI can",
    )
    parser.add_argument(
        "--restart",
        metavar="auto|FILE",
        help="continue from a restart file; auto: the newest in the output directory, or from the start without one",
    )


def execute(arguments: argparse.Namespace) -> None:
    """Run the scene."""
    from distfsi.execution import run

    communicator = start_ranks()
    with reported_once(communicator):
        scene = load_once(arguments.input, arguments.set, communicator)
        gpus = arguments.gpu, arguments.gpu_aware_mpi
        run(scene, communicator, arguments.threads, arguments.restart, *gpus)
