"""The history of a run: one row of numbers per logged step, as CSV."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from distfsi.output.interfaces import Communicator


class History:
    """Appends rows to a new CSV file whose header is `columns`, names with units such as "time [s]"; rank 0 writes."""

    def __init__(self, path: Path, columns: Sequence[str], communicator: Communicator):
        self._columns = list(columns)
        self._path = Path(path)
        self._writes = communicator.rank == 0
        if self._writes:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.unlink(missing_ok=True)
            self._write(self._columns)

    def append(self, values: Mapping[str, float | int | str]) -> None:
        """Write one row, a value for every column, so that it is in the file when this returns.

        Raises KeyError when a column has no value or a value no column.
        """
        if values.keys() != set(self._columns):
            raise KeyError(f"history needs {self._columns}, got {list(values)}")
        if self._writes:
            self._write([_exact(values[column]) for column in self._columns])

    def _write(self, row: Sequence[str]) -> None:
        with self._path.open("a", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(row)


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
