"""Watch a run while it goes on: progress, time step and its limit, gauges, conservation, memory, balance.

On a terminal it is drawn anew until the run ends or Ctrl-C; elsewhere it is said once. The run's own lines are in
status.txt in its directory, for `cat` on a cluster.

example:
  distfsi watch out/steel_tube
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

SECONDS = 1.0  # between looks


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("directory", type=Path, help="output directory of a run")


def execute(arguments: argparse.Namespace) -> None:
    """Show the run."""
    from distfsi.output.watch import is_running, lines

    directory: Path = arguments.directory
    if not (sys.stdout.isatty() and is_running(directory)):
        for name, text in lines(directory):
            print(f"{name:<20}{text}")
        return
    _follow(directory)


def _follow(directory: Path) -> None:
    """Draw the lines anew until the run ends."""
    import time
    from contextlib import suppress

    from rich.live import Live

    from distfsi.output.watch import is_running

    with suppress(KeyboardInterrupt), Live(_table(directory), refresh_per_second=2) as live:
        while is_running(directory):
            time.sleep(SECONDS)
            live.update(_table(directory))


def _table(directory: Path) -> Any:
    from rich.table import Table
    from rich.text import Text

    from distfsi.output.watch import lines

    table = Table(show_header=False, box=None)
    for name, text in lines(directory):
        table.add_row(Text(name, style="bold"), Text(text, overflow="ellipsis", no_wrap=True))
    return table
