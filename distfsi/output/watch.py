"""How a run goes, told from the files that it writes: `distfsi watch`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from distfsi.errors import InputError
from distfsi.output.history import read_history
from distfsi.output.info import WORDS
from distfsi.output.journal import read_journal
from distfsi.output.scales import scaled
from distfsi.output.status import read_status
from distfsi.output.tables import at_points, read_gauges
from distfsi.output.timeline import verdict

BARS = "▁▂▃▄▅▆▇█"
WIDTH = 40  # letters of a sparkline
GAUGES = 12  # that are shown, at most

Line = tuple[str, str]


def is_running(directory: Path) -> bool:
    """Whether a run goes on there, by its own word."""
    return read_journal(directory).get("status") == "running"


def lines(directory: Path) -> Iterator[Line]:
    """What there is to say of the run in a directory, in words by names. Raises InputError when there is no run."""
    journal, status = read_journal(directory), read_status(directory)
    if not journal:
        raise InputError([f"{directory}: no run has left its run.json there"])
    running = journal["status"] == "running"
    yield "run", str(journal.get("title", directory.name))
    yield "status", status.pop("status", journal["status"]) if running else WORDS[journal["status"]]
    yield from status.items()
    if "message" in journal:
        yield "because", journal["message"].splitlines()[0]
    history = directory / "history.csv"
    if history.exists():
        rows = read_history(history)
        if len(rows["step"]):
            yield "budget", verdict(rows)
    balance = directory / "balance.csv"
    if balance.exists():
        shares = read_history(balance)["busiest rank over mean"]
        if len(shares):
            yield "balance", f"the busiest rank computes {float(shares[-1]):.2f} times the mean"
    for name, table in list(at_points(read_gauges(directory)).items())[:GAUGES]:
        over = np.nan_to_num(np.asarray(table["overpressure [Pa]"]))
        size, unit = scaled("Pa", float(np.abs(over).max()))
        now, peak = over[-1] / size, over.max() / size
        yield f"gauge {name}", f"{sparkline(over)} now {now:.3g}, peak {peak:.3g} {unit}"


def sparkline(values: np.ndarray, width: int = WIDTH) -> str:
    """Values (n,) over time as a row of bars, the highest of each part of the time, from the lowest of all to the
    highest."""
    parts = np.array_split(values, min(width, len(values)))
    highest = np.array([part.max() for part in parts])
    low, high = float(highest.min()), float(highest.max())
    share = (highest - low) / (high - low) if high > low else np.zeros(len(highest))
    return "".join(BARS[round(each * (len(BARS) - 1))] for each in share.tolist())
