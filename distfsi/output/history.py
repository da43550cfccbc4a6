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
        self._file = None
        if communicator.rank == 0:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            self._file = Path(path).open("w", newline="")
            self._write(self._columns)

    def append(self, values: Mapping[str, float | int | str]) -> None:
        """Write one row, a value for every column, so that it is in the file when this returns.

        Raises KeyError when a column has no value or a value no column.
        """
        if values.keys() != set(self._columns):
            raise KeyError(f"history needs {self._columns}, got {list(values)}")
        self._write([_exact(values[column]) for column in self._columns])

    def _write(self, row: Sequence[str]) -> None:
        if self._file is not None:
            csv.writer(self._file, lineterminator="\n").writerow(row)
            self._file.flush()


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
