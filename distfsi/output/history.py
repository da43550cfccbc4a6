"""The history of a run: one row of numbers per logged step, as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from distfsi.errors import InputError
from distfsi.output.files import write_text
from distfsi.output.interfaces import Communicator
from distfsi.output.manifest import claim
from distfsi.output.storage import on_root


class History:
    """Appends rows to a CSV file whose header is `columns`, names with units such as "time [s]"; rank 0 writes.

    The file is new, or at a restart goes on after the last row whose first column is at most `until`.
    """

    def __init__(self, path: Path, columns: Sequence[str], communicator: Communicator, until: float | None = None):
        """Collective. Raises InputError when the file to go on with has other columns or a damaged row."""
        self._columns = list(columns)
        self._path = Path(path)
        self._communicator = communicator
        faults = on_root(communicator, self._path, lambda: self._begin(until))
        if faults:
            raise InputError(faults)

    def _begin(self, until: float | None) -> list[str]:
        """Lay down the file as it was at `until`; what is wrong with it, if anything."""
        kept, faults = _rows_until(self._path, self._columns, until)
        if not faults:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            claim(self._path)
            write_text(self._path, "".join([_line(self._columns), *kept]))
        return faults

    def append(self, values: Mapping[str, float | int | str]) -> None:
        """Write one row, a value for every column, so that it is in the file when this returns.

        Collective. Raises KeyError when a column has no value or a value no column, OutputError on all ranks.
        """
        if values.keys() != set(self._columns):
            raise KeyError(f"history needs {self._columns}, got {list(values)}")
        self.extend([[values[column] for column in self._columns]])

    def extend(self, rows: Sequence[Sequence[float | int | str]]) -> None:
        """Write the rows that rank 0 gives, a value for every column each, so that they are in the file on return.

        Collective. Raises OutputError on all ranks.
        """
        text = "".join(_line([_exact(value) for value in row]) for row in rows)
        on_root(self._communicator, self._path, lambda: self._add(text))

    def _add(self, text: str) -> None:
        with self._path.open("a", newline="") as file:
            file.write(text)


def history_faults(path: Path, columns: Sequence[str], until: float) -> list[str]:
    """What keeps a file from being continued after the last row whose first column is at most `until`."""
    return _rows_until(path, columns, until)[1]


def _rows_until(path: Path, columns: Sequence[str], until: float | None) -> tuple[list[str], list[str]]:
    """The rows of a file that stay, as they are, and what is wrong with it. A last row that was cut short is none."""
    if until is None or not path.exists():
        return [], []
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        header, *rows = [line for line in file if line.endswith("\n")] or [_line(columns)]
    if header != _line(columns):
        return [], [f"{path}: has other columns than this run writes; move it away before the restart"]
    kept, last = [], -math.inf
    for number, row in enumerate(rows, 2):
        values = next(csv.reader([row]))
        first = _number(values[0]) if len(values) == len(columns) else math.nan
        if not first >= last:
            return [], [f"{path}, line {number}: is no row of this file; move the file away before the restart"]
        if first > until:
            break
        kept.append(row)
        last = first
    return kept, []


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _line(row: Sequence[str]) -> str:
    """A row as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(row)
    return text.getvalue()


def _exact(value: float | int | str) -> str:
    """Text from which a float is read back to the last bit."""
    return str(value) if isinstance(value, str | int | np.integer) else repr(float(value))


def read_history(path: Path) -> dict[str, np.ndarray | list[str]]:
    """Columns of a history file by name: float arrays, or lists where a column holds words.

    A last row that a dying run left unfinished is dropped.
    """
    lines = Path(path).read_text().splitlines(keepends=True)
    header, *rows = csv.reader(line for line in lines if line.endswith("\n"))
    return {name: _column([row[i] for row in rows]) for i, name in enumerate(header)}


def _column(texts: list[str]) -> np.ndarray | list[str]:
    try:
        return np.array([float(text) for text in texts])
    except ValueError:
        return texts
