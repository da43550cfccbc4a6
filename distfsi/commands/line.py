"""The command line `distfsi COMMAND ...`.

Each command is a file of this folder. It has a docstring (the first line is the command's summary, the whole its help),
`add_arguments(parser)` and `execute(arguments)`, and imports what computes only when it is executed, so that help comes
at once.
"""

from __future__ import annotations

import argparse
import difflib
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from distfsi import __version__
from distfsi.errors import DistfsiError, InputError
from distfsi.interrupts import interrupts

COMMANDS = (
    "run",
    "new",
    "sweep",
    "check",
    "compile",
    "watch",
    "plot",
    "report",
    "info",
    "clean",
    "examples",
    "materials",
    "blast",
    "study",
    "bench",
    "doctor",
    "schema",
)

DESCRIPTION = "Shock waves and blasts that hit structures."
EXAMPLES = """\
examples:
  distfsi examples sod                 copy an example into this folder
  distfsi sod.toml                     run it (the same as `distfsi run sod.toml`)
  mpiexec -n 4 distfsi sod.toml        run it on four MPI ranks
  distfsi check sod.toml               what it will cost
  distfsi plot out/sod                 draw its results
  distfsi report out/sod               a report on them, as one HTML file

`distfsi COMMAND --help` explains a command.
exit codes: 0 done, 2 wrong input, 3 the state became unphysical, 74 results could not be written, 75 stopped early
"""


def parser() -> argparse.ArgumentParser:
    """The parser of the whole command line; what it returns holds the command's `execute`."""
    as_written = argparse.RawDescriptionHelpFormatter
    main = argparse.ArgumentParser("distfsi", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=as_written)
    main.add_argument("--version", action="version", version=__version__)
    commands = main.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name in COMMANDS:
        module = import_module(f"distfsi.commands.{name}")
        summary, _, rest = str(module.__doc__).partition("\n")
        one = commands.add_parser(name, help=summary, description=summary, epilog=rest, formatter_class=as_written)
        module.add_arguments(one)
        one.set_defaults(execute=module.execute)
    return main


def main(words: Sequence[str]) -> None:
    """Execute the command line `words`. Raises DistfsiError, and SystemExit where ranks have told it already."""
    if near := _mistyped(words[0] if words else ""):
        parser().error(f"there is neither a command nor a file {words[0]!r}; did you mean the command {near!r}?")
    arguments = parser().parse_args(with_command(words))
    arguments.execute(arguments)


def _mistyped(word: str) -> str | None:
    """The command that a word is meant to be, if it is none, and no input file, but resembles one."""
    if word in COMMANDS or word.startswith("-") or "." in word or os.sep in word or os.path.exists(word):
        return None
    return next(iter(difflib.get_close_matches(word.lower(), COMMANDS, n=1)), None)


def with_command(words: Sequence[str]) -> list[str]:
    """The words, `run` before them where they begin with no command."""
    is_scene = words and words[0] not in COMMANDS and not words[0].startswith("-")
    return ["run", *words] if is_scene else list(words)


def command() -> None:
    """The console command: `main` on the words of the process; a wrong input ends it with exit code 2.

    A run listens to signals before it imports what takes time.
    """
    words = with_command(sys.argv[1:])
    if words[:1] == ["run"]:
        interrupts.begin_program()
    try:
        main(words)
    except DistfsiError as error:
        if not isinstance(error, InputError):  # only this rank may have met it: the exception hook ends the others
            raise
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
    except BrokenPipeError:  # who reads the output has gone: `distfsi examples | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
