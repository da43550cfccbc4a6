"""Run a scene with many values of its keys, and put the results into one table and one chart.

A value that varies is a range, `1..5 kg:5` for five values or `1..100:3 log`, or a list, `minmod | van_leer`; several
are combined each with each. `--table` takes a row per variant from a CSV file whose header has the keys. Each variant
runs in a folder of its own; those that are done are not run again, those that were stopped go on.

examples:
  distfsi sweep scene.toml --set charges.0.mass="1..5 kg:5" --jobs 2
  distfsi sweep scene.toml --set fluid.reconstruction="minmod | van_leer" --set domain.cells="100..400:4"
  distfsi sweep scene.toml --table designs.csv --list
  sbatch --array=1-5 launch/slurm/cpu.sbatch scene.toml --set charges.0.mass="1..5 kg:5"
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from distfsi.commands.ranks import load_once, reported_once, start_ranks
from distfsi.commands.words import positive

if TYPE_CHECKING:
    from distfsi.sweep import Sweep


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("input", type=Path, help="the scene, a TOML file")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUES", help="a value, a range or a list of a key"
    )
    parser.add_argument("--table", type=Path, metavar="FILE", help="designs: a CSV file, keys in its header")
    parser.add_argument("--jobs", type=positive, default=1, help="runs at a time (default: 1)")
    parser.add_argument("--threads", type=positive, help="threads of each run (default: the cores shared by the jobs)")
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="default: out/NAME-sweep")
    parser.add_argument("--list", action="store_true", help="show the variants, and run none")
    parser.add_argument(
        "--only", type=positive, metavar="N", help="run variant N alone, on the ranks that this command is started on"
    )


def execute(arguments: argparse.Namespace) -> None:
    """Run the variants, then collect."""
    from distfsi import sweep as sweeps

    folder = arguments.output or Path("out") / f"{arguments.input.stem}-sweep"
    sweep = sweeps.plan(arguments.input, folder, arguments.set, arguments.table)
    if arguments.list:
        for variant in sweep.variants:
            print(variant.directory, *(f"{key}={variant.settings[key]}" for key in sweep.varied))
        return
    if arguments.only:
        _run_only(sweep, arguments)
        return
    sweep.check()
    threads = arguments.threads or sweeps.threads_for(arguments.jobs)
    codes = sweeps.run_all(sweep, arguments.jobs, ("--threads", str(threads)))
    table = sweeps.collect(sweep)
    chart = sweeps.draw(sweep, table)
    print(f"{sum(code == 0 for code in codes)} of {len(codes)} variants done; results in {table}", end="")
    print(f", chart in {chart}" if chart else "")
    sys.exit(max(codes))


def _run_only(sweep: Sweep, arguments: argparse.Namespace) -> None:
    """One variant, as the command `run` runs a scene."""
    from distfsi.errors import InputError
    from distfsi.execution import run
    from distfsi.sweep import is_done

    communicator = start_ranks()
    with reported_once(communicator):
        if arguments.only > len(sweep.variants):
            raise InputError([f"--only {arguments.only}: there are {len(sweep.variants)} variants"])
        variant = sweep.variants[arguments.only - 1]
        if communicator.broadcast(communicator.rank == 0 and is_done(sweep, variant)):
            return
        scene = load_once(str(sweep.scene), variant.overrides, communicator)
        run(scene, communicator, arguments.threads, "auto")
