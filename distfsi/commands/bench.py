"""Measure the speed of this machine, as JSON.

Standard flows and solids, each the best of several runs; a few minutes on an idle machine. The result is kept, and
`distfsi check` then estimates times. `bench ranks` measures what MPI ranks cost instead: messages, waiting, uneven
shares.

examples:
  distfsi bench
  distfsi bench --only shock_bubble --threads 1
  mpiexec -n 4 distfsi bench ranks
"""

from __future__ import annotations

import argparse

from distfsi.commands.ranks import start_ranks


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("what", nargs="?", choices=("ranks",), help="ranks: messages, waiting and uneven shares")
    parser.add_argument("--threads", type=int, help="threads per rank")
    parser.add_argument("--only", metavar="TEXT", help="only benchmarks whose name contains TEXT")


def execute(arguments: argparse.Namespace) -> None:
    """Measure, and print JSON."""
    from distfsi.resources import bench, bench_ranks

    if arguments.what == "ranks":
        bench_ranks.main(start_ranks(), arguments.threads)
    else:
        bench.main(start_ranks(), arguments.threads, arguments.only)
