"""Many runs of one scene with other values: their settings, the runs, and one table and one chart of what they gave.

A value of a setting that varies is a range, `1..5 kg:5` (five values, evenly spaced) or `1..100:3 log` (by equal
factors), or a list, `minmod | van_leer`. Several settings that vary are combined each with each; a table of designs has
a row per variant instead.
"""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.errors import InputError
from distfsi.output.charts import Chart, Curve, draw_charts
from distfsi.output.journal import read_journal
from distfsi.results import Results, Table
from distfsi.scene import load

RANGE = re.compile(r"\s*([^.\s][^\s]*?)\s*\.\.\s*([^\s:]+)\s*([^:]*?)\s*:\s*(\d+)\s*(log)?\s*")
LARGEST = 10_000  # variants of a sweep
CHARTS, COLUMNS = 12, 3  # at most, and side by side
TIME = "time"
FREE = ("time.wall_clock_limit", "performance.")  # what may differ when a variant is asked for again


@dataclass(frozen=True)
class Variant:
    """A run of a sweep: its `settings` by key, as text, and its own directory."""

    number: int
    settings: Mapping[str, str]
    directory: Path

    @property
    def overrides(self) -> tuple[str, ...]:
        """What is laid over the scene."""
        return (*(f"{key}={value}" for key, value in self.settings.items()), f"output.directory={self.directory}")


@dataclass(frozen=True)
class Sweep:
    """A scene's input file, and its variants in one folder; `varied`: the keys that differ among them."""

    scene: Path
    folder: Path
    variants: Sequence[Variant]
    varied: Sequence[str]

    def check(self) -> None:
        """Raise InputError with the faults of all variants."""
        faults: dict[str, list[str]] = {}
        for variant in self.variants:
            try:
                load(self.scene, variant.overrides)
            except InputError as error:
                for fault in error.faults:
                    faults.setdefault(fault, []).append(variant.directory.name)
        if faults:
            raise InputError([f"{fault} (in {', '.join(names)})" for fault, names in faults.items()])


def plan(scene: Path, folder: Path, settings: Sequence[str], table: Path | None = None) -> Sweep:
    """The variants of a scene: each combination of the values of its settings ("key=values"), or each row of a table of
    designs, whose header has the keys, with them.

    Raises InputError when a range or the table is none, or nothing varies.
    """
    values: dict[str, list[str]] = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals:
            raise InputError([f"--set: '{setting}'; expected key.path=values"])
        values[key.strip()] = values_of(text)
    designs = _designs(table) if table else [{}]
    count = len(designs) * int(np.prod([len(several) for several in values.values()], dtype=float))
    if not 1 < count <= LARGEST:
        expected = f"a range such as 1..5:3, a list such as a | b, or a table; at most {LARGEST} variants"
        raise InputError([f"{count} variant(s); a sweep needs something that varies: {expected}"])
    chosen = [design | dict(zip(values, each, strict=True)) for design in designs for each in product(*values.values())]
    width = max(3, len(str(count)))
    varied = [key for key in chosen[0] if len({one[key] for one in chosen}) > 1]
    numbered = enumerate(chosen, 1)
    return Sweep(scene, folder, [Variant(n, one, folder / f"{n:0{width}d}") for n, one in numbered], varied)


def values_of(text: str) -> list[str]:
    """The values that a text stands for. Raises InputError when a range is none."""
    if "|" in text:
        return [part.strip() for part in text.split("|")]
    if ".." not in text or text.lstrip()[:1] in "[{\"'":
        return [text.strip()]
    match = RANGE.fullmatch(text)
    try:
        low, high, unit, count, log = match.groups() if match else ("",) * 5
        spaced = np.geomspace if log else np.linspace
        values = spaced(float(low), float(high), int(count))
    except ValueError as error:
        raise InputError([f"'{text}' is no range; expected such as 1..5 kg:5, or 1..100:3 log"]) from error
    return [f"{value:.12g} {unit}".strip() for value in values]


def _designs(path: Path) -> list[dict[str, str]]:
    """The rows of a table of designs."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            header, *rows = [row for row in csv.reader(file) if row] or [[]]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError([f"{path}: cannot be read: {error}"]) from error
    faults = [f"{path}: row {n} has {len(row)} values for {len(header)} keys" for n, row in enumerate(rows, 1)
              if len(row) != len(header)]  # fmt: skip
    if faults or not rows:
        raise InputError(faults or [f"{path}: has no rows below its keys"])
    return [{key.strip(): value.strip() for key, value in zip(header, row, strict=True)} for row in rows]


# ---- the runs --------------------------------------------------------------------------------------------------------


def is_done(sweep: Sweep, variant: Variant) -> bool:
    """Whether a variant has run to its end as it is now."""
    journal = read_journal(variant.directory)
    known = journal.get("input")
    if journal.get("status") != "done" or known is None:
        return False
    text = sweep.scene.read_text(encoding="utf-8-sig").replace("\r\n", "\n")
    return known["text"] == text and _bearing(known["settings"]) == _bearing(variant.overrides)


def _bearing(settings: Sequence[str]) -> list[str]:
    """Those settings that bear on the results."""
    return [setting for setting in settings if not setting.startswith(FREE)]


def run_all(sweep: Sweep, jobs: int, words: Sequence[str]) -> list[int]:
    """Run what is not done yet, so many runs at a time, each by the command `run` with these `words`; it goes on from
    where it was stopped. What runs say goes into FOLDER/NNN.log. The exit codes."""
    sweep.folder.mkdir(parents=True, exist_ok=True)

    def run_one(variant: Variant) -> int:
        name = variant.directory.name
        if is_done(sweep, variant):
            print(f"{name}: done before", flush=True)
            return 0
        settings = [word for text in variant.overrides for word in ("--set", text)]
        command = [sys.executable, "-m", "distfsi", "run", str(sweep.scene), *settings, "--restart", "auto", *words]
        log = sweep.folder / f"{name}.log"
        with log.open("w") as file:
            code = subprocess.run(command, stdout=file, stderr=subprocess.STDOUT, check=False).returncode
        last = (log.read_text().strip().splitlines() or [""])[-1] if code else ""
        shown = ", ".join(f"{key} = {variant.settings[key]}" for key in sweep.varied)
        print(f"{name}: {shown}: {f'exit code {code}, {log}: {last}' if code else 'done'}", flush=True)
        return code

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(run_one, sweep.variants))


def threads_for(jobs: int) -> int:
    """Threads of each of so many runs at a time."""
    return max(1, len(os.sched_getaffinity(0)) // jobs)


# ---- what they gave --------------------------------------------------------------------------------------------------


def collect(sweep: Sweep) -> Path:
    """Write FOLDER/sweep.csv: a row per variant with its settings, how it ended, and the value of largest magnitude in
    each column of its gauges. Returns its path."""
    rows = [dict(_row(sweep, variant)) for variant in sweep.variants]
    columns = list(dict.fromkeys(name for row in rows for name in row))
    path = sweep.folder / "sweep.csv"
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)
    return path


def _row(sweep: Sweep, variant: Variant) -> Iterator[tuple[str, Any]]:
    yield "variant", variant.directory.name
    yield from ((key, variant.settings[key]) for key in sweep.varied)
    journal = read_journal(variant.directory)
    yield "status", journal.get("status", "not begun")
    yield "seconds", journal.get("seconds", "")
    if not journal:
        return
    for gauge, table in Results(variant.directory).gauges.items():
        yield from ((f"{gauge} {column}", value) for column, value in largest_of(table))


def largest_of(table: Table) -> Iterator[tuple[str, float]]:
    """The value of largest magnitude in each column of numbers, whose name gets its unit."""
    for name, column in table.items():
        if name == TIME or not isinstance(column, np.ndarray) or not np.isfinite(column).any():
            continue
        unit = f" [{table.units[name]}]" if name in table.units else ""
        yield f"{name}{unit}", float(column[np.nanargmax(np.abs(column))])


def draw(sweep: Sweep, table: Path) -> Path | None:
    """Draw FOLDER/sweep.png: each result over the first key whose values are numbers, a curve for each combination of
    the others. Its path; None when there is nothing to draw."""
    with table.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["status"] == "done"]
    numeric = [key for key in sweep.varied if all(_number(row[key]) is not None for row in rows)]
    if not rows or not numeric:
        return None
    key, *_ = numeric
    unit = rows[0][key].partition(" ")[2]
    label = f"{key} [{unit}]" if unit else key
    others = [other for other in sweep.varied if other != key]
    results = [name for name in rows[0] if name not in {"variant", "status", "seconds", *sweep.varied}]
    results = [name for name in results if len({row[name] for row in rows}) > 1][:CHARTS]
    charts = []
    for name in results:
        curves: dict[str, list[tuple[float, float]]] = {}
        for row in rows:
            if row[name]:
                curve = curves.setdefault(", ".join(row[other] for other in others), [])
                curve.append((_number(row[key]) or 0.0, float(row[name])))
        lines = [
            Curve(np.array([x for x, _ in points]), np.array([y for _, y in points]), text or None, "o-")
            for text, points in ((text, sorted(points)) for text, points in curves.items())
        ]
        title, _, unit = name.partition(" [")
        charts.append(Chart(title, label, f"[{unit}" if unit else "", lines))
    if not charts:
        return None
    return draw_charts(sweep.folder / "sweep.png", charts, min(COLUMNS, len(charts)))


def _number(text: str) -> float | None:
    try:
        return float(text.partition(" ")[0])
    except ValueError:
        return None
