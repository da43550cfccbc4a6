"""`python -m distfsi input.toml` and the other commands."""

from __future__ import annotations

import argparse
import sys

from distfsi import __version__
from distfsi.errors import DistfsiError, InputError

COMMANDS = ("run", "check", "bench", "study")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    main = argparse.ArgumentParser(prog="distfsi", description="Shock waves and blasts that hit structures.")
    main.add_argument("--version", action="version", version=__version__)
    commands = main.add_subparsers(dest="command", required=True, metavar="{run,check,bench,study}")
    for name, text in (
        ("run", "run a scene (the command may be left out)"),
        ("check", "check a scene and tell what it costs"),
    ):
        command = commands.add_parser(name, help=text)
        command.add_argument("input", help="the scene, a TOML file")
        command.add_argument(
            "--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the input"
        )
        if name == "run":
            command.add_argument(
                "--threads", type=int, help="threads per rank (default: cores shared by the node's ranks)"
            )
    bench = commands.add_parser("bench", help="measure this machine's speed, as JSON")
    bench.add_argument("--threads", type=int, help="threads per rank")
    bench.add_argument("--only", metavar="PART", help="only benchmarks whose name holds PART")
    study = commands.add_parser("study", help="compare with reference answers")
    study.add_argument("name", choices=("steel_tube",), help="which study")
    study.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the input")
    return main


def main(words: list[str]) -> None:
    """Run the command line `words`."""
    if words and words[0] not in COMMANDS and not words[0].startswith("-"):
        words = ["run", *words]
    arguments = parser().parse_args(words)
    if arguments.command == "check":
        from distfsi.scene import load, report

        print(report(load(arguments.input, arguments.set)))
        return
    from distfsi.mesh.communicator import Communicator, check_launcher, install_abort_on_exception

    communicator = Communicator()
    check_launcher(communicator)
    install_abort_on_exception(communicator)
    if arguments.command == "run":
        from distfsi import simulation
        from distfsi.scene import load

        simulation.run(_load_once(load, arguments, communicator), communicator, arguments.threads)
    elif arguments.command == "bench":
        from distfsi.study import bench

        bench.main(communicator, arguments.threads, arguments.only)
    else:
        from distfsi.study import steel_tube

        steel_tube.main(communicator, arguments.set)


def _load_once(load, arguments, communicator):
    """The scene, read by rank 0 alone; its faults end all ranks, told once."""
    scene, faults = None, None
    if communicator.rank == 0:
        try:
            scene = load(arguments.input, arguments.set)
        except InputError as error:
            faults = error.faults
    scene, faults = communicator.broadcast((scene, faults))
    if faults:
        if communicator.rank == 0:
            print("\n".join(faults), file=sys.stderr, flush=True)
        sys.exit(InputError.exit_code)
    return scene


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except DistfsiError as error:
        if not isinstance(error, InputError):
            raise
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
