"""Maps of where methods survive: a run for every pair of two hardnesses, judged, for each method."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from distfsi.errors import InputError
from distfsi.mesh.communicator import Communicator
from distfsi.output.verdicts import VerdictMap, draw_verdicts

Verdict = tuple[int, str]  # its number among a study's verdicts, the first of which is the best; and why


@dataclass(frozen=True)
class Plane:
    """A hardness (rows) by another (columns)."""

    name: str
    title: str
    row_label: str
    rows: tuple[float, ...]
    column_label: str
    columns: tuple[float, ...]


@dataclass(frozen=True)
class Map(Plane):
    """Runs over two hardnesses; judge(method, row, column) makes one."""

    judge: Callable[[Any, float, float], Verdict]


def corners(shown: Map) -> Map:
    """A map of four runs of another."""
    rows, columns = ((values[0], values[min(2, len(values) - 1)]) for values in (shown.rows, shown.columns))
    return replace(shown, rows=rows, columns=columns)


@dataclass(frozen=True)
class Stability:
    """A study: its name, where its files go, and its verdicts, the best first, with their colors."""

    name: str
    directory: Path
    verdicts: Mapping[str, str]

    def run(
        self, communicator: Communicator, methods: Mapping[str, Any], maps: Sequence[Map], overrides: Sequence[str]
    ) -> None:
        """Run all methods, by name, on the maps; leave a CSV file and a sheet per map."""
        if communicator.size > 1 or overrides:
            raise InputError([f"study {self.name}: runs on one rank and takes no overrides"])
        self.directory.mkdir(parents=True, exist_ok=True)
        lines = []
        with threadpool_limits(1):
            for shown in maps:
                print(f"\n{shown.title}: {shown.row_label} by {shown.column_label}")
                sheets = []
                for name, method in methods.items():
                    found = {(r, c): shown.judge(method, r, c) for r in shown.rows for c in shown.columns}
                    print(self._summary(name, found), flush=True)
                    numbers = np.array([[found[r, c][0] for c in shown.columns] for r in shown.rows])
                    sheets.append(VerdictMap(name, numbers))
                    lines += [
                        [shown.name, name, f"{r:g}", f"{c:.3g}", *self._in_words(v)] for (r, c), v in found.items()
                    ]
                rows, columns = ([f"{v:.3g}" for v in values] for values in (shown.rows, shown.columns))
                labels = (shown.row_label, rows), (shown.column_label, columns)
                draw_verdicts(
                    self.directory / f"{shown.name}.png", shown.title, sheets, *labels, self.verdicts, across=2
                )
        with (self.directory / "stability.csv").open("w", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["map", "method", "row", "column", "verdict", "why"])
            table.writerows(lines)
        print(f"\nmaps and table in {self.directory}", flush=True)

    def _summary(self, name: str, found: Mapping[tuple[float, float], Verdict]) -> str:
        """How often each verdict fell, and where and why it was not the best."""
        numbers = [number for number, _ in found.values()]
        counts = ", ".join(f"{numbers.count(n)} {verdict}" for n, verdict in enumerate(self.verdicts) if n in numbers)
        bad = [f"{r:g} by {c:g}: {why}" for (r, c), (number, why) in found.items() if number]
        return f"  {name:20} {counts}" + "".join(f"\n      {text}" for text in bad[:6])

    def _in_words(self, verdict: Verdict) -> tuple[str, str]:
        return list(self.verdicts)[verdict[0]], verdict[1]
