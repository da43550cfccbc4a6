"""Check a scene and estimate what its run will cost.

All faults of the input are listed at once, with their lines. For a sound input: cells, particles, memory, bytes of
output, time steps, and advice on what the scene pays for without using it. `distfsi bench` measures this machine once;
then `check` estimates the time, too. `--picture` draws regions, bodies with their particles, and gauges.

examples:
  distfsi check scene.toml
  distfsi check scene.toml --ranks 8 --threads 4
  distfsi check scene.toml --picture
  distfsi check scene.toml --set domain.cells=[400,400]
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from distfsi.commands.words import add_overrides, positive


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("input", help="the scene, a TOML file")
    add_overrides(parser)
    parser.add_argument("--ranks", type=positive, default=1, help="MPI ranks of the run (default: 1)")
    parser.add_argument(
        "--picture",
        nargs="?",
        const="",
        metavar="FILE",
        help="draw the scene, too: sections, and where vtk is installed a view in 3D (default: NAME-scene.png)",
    )
    parser.add_argument("--threads", type=positive, help="threads per rank (default: cores of this machine / ranks)")


def execute(arguments: argparse.Namespace) -> None:
    """Print the report."""
    from distfsi.scene import load

    scene = load(arguments.input, arguments.set)

    from distfsi.resources.bench import kept_bench
    from distfsi.resources.report import report

    threads = arguments.threads or max(1, len(os.sched_getaffinity(0)) // arguments.ranks)
    for each in (*scene.stages, scene):
        print(report(each, arguments.ranks, threads, kept_bench()))
    if arguments.picture is not None:
        from distfsi.resources.scene_picture import draw_scene

        name = arguments.picture or f"{Path(arguments.input).stem}-scene.png"
        print("\n".join(map(str, draw_scene(scene, Path(name)))))
