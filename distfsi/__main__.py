"""`python -m distfsi input.toml` and the other commands."""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from distfsi import __version__
from distfsi.errors import DistfsiError, InputError

if TYPE_CHECKING:
    from distfsi.mesh.communicator import Communicator

STUDIES = (  # modules of distfsi.study, with underscores in the place of blanks
    "steel_tube",
    "steel_tube fragments",
    "undex_2d",
    "shock_bubble",
    "shock_bubble_speed",
    "exact cases",
    "frontier fluid",
    "stability fluid",
    "kernels",
    "frontier solid",
    "stability solid",
    "frontier coupling",
    "stability coupling",
    "fragments",
    "tube_alone",
    "liftoff",
)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    main = argparse.ArgumentParser(prog="distfsi", description="Shock waves and blasts that hit structures.")
    main.add_argument("--version", action="version", version=__version__)
    commands = main.add_subparsers(dest="command", required=True, metavar="{" + ",".join(COMMANDS) + "}")
    run = commands.add_parser("run", help="run a scene (the command may be left out)")
    check = commands.add_parser("check", help="check a scene; tell what it costs and what it could do without")
    compiling = commands.add_parser("compile", help="compile what a scene needs, so that a run of it starts at once")
    for command in (run, check, compiling):
        command.add_argument("input", help="the scene, a TOML file")
        _add_overrides(command)
    run.add_argument("--threads", type=int, help="threads per rank (default: cores shared by the node's ranks)")
    run.add_argument("--gpu", action="store_true", help="compute on the node's GPUs")
    run.add_argument(
        "--gpu-aware-mpi",
        action="store_true",
        help="with --gpu: messages straight from the memory of the GPUs, if a trial shows that MPI takes it",
    )
    run.add_argument(
        "--restart",
        metavar="auto|FILE",
        help="go on from a restart file; auto: the newest in the output directory, else from the start",
    )
    check.add_argument("--ranks", type=_positive, default=1, help="MPI ranks of the run (default: 1)")
    check.add_argument("--threads", type=_positive, help="threads per rank (default: cores of this machine / ranks)")
    commands.add_parser("schema", help="print the JSON schema of the input, for editors")
    plot = commands.add_parser("plot", help="draw the results of a run as PNG files")
    _add_plot_options(plot)
    info = commands.add_parser("info", help="tell what an output directory holds")
    info.add_argument("directory", type=Path, help="output directory of a run")
    bench = commands.add_parser("bench", help="measure this machine's speed, as JSON; check then knows times")
    bench.add_argument("what", nargs="?", choices=("ranks",), help="ranks: messages, waiting and uneven shares instead")
    bench.add_argument("--threads", type=int, help="threads per rank")
    bench.add_argument("--only", metavar="PART", help="only benchmarks whose name holds PART")
    commands.add_parser("doctor", help="tell what a run would find: MPI, GPUs, HDF5, threads, room on the disk")
    study = commands.add_parser("study", help="compare with reference answers")
    study.add_argument("name", nargs="+", help="which study: " + ", ".join(STUDIES))
    study.add_argument("--quick", action="store_true", help="a small size that only shows that the study works")
    _add_overrides(study)
    return main


def _add_overrides(command: argparse.ArgumentParser) -> None:
    command.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the input")


def _add_plot_options(plot: argparse.ArgumentParser) -> None:
    plot.add_argument("directory", type=Path, help="output directory of a run")
    plot.add_argument("--field", metavar="NAME", help="field of the cells (default: pressure)")
    plot.add_argument("--particles", metavar="NAME", help="field that colors the particles")
    times = plot.add_mutually_exclusive_group()
    times.add_argument("--time", type=_seconds, metavar="T", help='only the frame nearest to it: 1e-5, "10 us"')
    times.add_argument("--every", type=_positive, default=1, metavar="N", help="each N-th frame")
    plot.add_argument("--slice", type=_plane, metavar="AXIS=PLACE", help='plane of a 3D run: z=0.1, "x=20 mm"')
    plot.add_argument("--gauges", action="store_true", help="the gauges instead of fields and history")
    plot.add_argument("--movie", action="store_true", help="the frames as an animated GIF, too")


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text}; must be >= 1")
    return number


def _seconds(text: str) -> float:
    return _quantity(text, "s")


def _plane(text: str) -> tuple[int, float]:
    axis, equals, place = text.partition("=")
    if axis not in ("x", "y", "z") or not equals:
        raise argparse.ArgumentTypeError(f"{text}; expected x=..., y=... or z=...")
    return "xyz".index(axis), _quantity(place, "m")


def _quantity(text: str, unit: str) -> float:
    """A number in `unit`, or a text with its own unit."""
    from distfsi.scene.units import to_si

    try:
        return float(text)
    except ValueError:
        pass
    try:
        return to_si(text, unit)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"'{text}' {error}") from error


# ---- commands --------------------------------------------------------------------------------------------------------


def run(arguments: argparse.Namespace) -> None:
    """Run a scene."""
    from distfsi.run import run
    from distfsi.scene import load

    communicator = _start_ranks()
    with _telling_once(communicator):
        scene = _load_once(load, arguments, communicator)
        gpus = arguments.gpu, arguments.gpu_aware_mpi
        run(scene, communicator, arguments.threads, arguments.restart, *gpus)


def compile_scene(arguments: argparse.Namespace) -> None:
    """Compile a scene's kernels."""
    from distfsi.device.cache import cache_directory
    from distfsi.run import compile_kernels
    from distfsi.scene import load

    communicator = _start_ranks()
    with _telling_once(communicator):
        made = compile_kernels(_load_once(load, arguments, communicator), communicator)
        if communicator.rank == 0:
            print(f"{made} kernels compiled; all are in {cache_directory()}")


def check(arguments: argparse.Namespace) -> None:
    """Print what a scene costs."""
    from distfsi.scene import load

    scene = load(arguments.input, arguments.set)

    from distfsi.commands.bench import kept_bench
    from distfsi.commands.check import report

    threads = arguments.threads or max(1, len(os.sched_getaffinity(0)) // arguments.ranks)
    print(report(scene, arguments.ranks, threads, kept_bench()))


def schema(arguments: argparse.Namespace) -> None:
    """Print the JSON schema of the input."""
    from distfsi.scene.reference import json_schema

    print(json_schema(), end="")


def plot(arguments: argparse.Namespace) -> None:
    """Draw results."""
    from distfsi.output.plot import plot

    for path in plot(**{name: value for name, value in vars(arguments).items() if name != "command"}):
        print(path)


def info(arguments: argparse.Namespace) -> None:
    """Print what an output directory holds."""
    from distfsi.output.info import describe

    print(describe(arguments.directory))


def bench(arguments: argparse.Namespace) -> None:
    """Measure this machine, or what its ranks cost."""
    from distfsi.commands import bench, bench_ranks

    if arguments.what == "ranks":
        bench_ranks.main(_start_ranks(), arguments.threads)
    else:
        bench.main(_start_ranks(), arguments.threads, arguments.only)


def study(arguments: argparse.Namespace) -> None:
    """Compare with reference answers."""
    name = " ".join(arguments.name)
    if name not in STUDIES:
        raise InputError([f"study {name}: no such study; expected one of {', '.join(STUDIES)}"])
    module = import_module(f"distfsi.study.{name.replace(' ', '_')}")
    if arguments.quick and not hasattr(module, "quick"):
        raise InputError([f"study {name}: has no quick size"])
    compare = module.quick if arguments.quick else module.main
    communicator = _start_ranks()
    with _telling_once(communicator):
        compare(communicator, arguments.set)


def doctor(arguments: argparse.Namespace) -> None:
    """Tell what a run would find."""
    from distfsi.commands import doctor

    doctor.main(_start_ranks())


COMMANDS = {
    "run": run,
    "compile": compile_scene,
    "check": check,
    "schema": schema,
    "plot": plot,
    "info": info,
    "bench": bench,
    "doctor": doctor,
    "study": study,
}


def main(words: list[str]) -> None:
    """Run the command line `words`."""
    if words and words[0] not in COMMANDS and not words[0].startswith("-"):
        words = ["run", *words]
    arguments = parser().parse_args(words)
    COMMANDS[arguments.command](arguments)


def _start_ranks() -> Communicator:
    from distfsi.mesh.communicator import Communicator, check_launcher, install_abort_on_exception

    communicator = Communicator()
    check_launcher(communicator)
    install_abort_on_exception(communicator)
    return communicator


def _load_once(load, arguments, communicator):
    """The scene, read by rank 0 alone; its faults are raised on all ranks."""
    scene, faults = None, None
    if communicator.rank == 0:
        try:
            scene = load(arguments.input, arguments.set)
        except InputError as error:
            faults = error.faults
    scene, faults = communicator.broadcast((scene, faults))
    if faults:
        raise InputError(faults)
    return scene


@contextmanager
def _telling_once(communicator):
    """An error that all ranks raise ends all of them, told by rank 0."""
    try:
        yield
    except DistfsiError as error:
        if communicator.rank == 0:
            print(error, file=sys.stderr, flush=True)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except DistfsiError as error:
        if not isinstance(error, InputError):
            raise
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
