"""The history of a run: one row of numbers per logged step, as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from distfsi.errors import InputError
from distfsi.output.interfaces import Communicator
from distfsi.output.storage import on_root, replace


class History:
    """Appends rows to a CSV file whose header is `columns`, names with units such as "time [s]"; rank 0 writes.

    The file is new, or at a restart goes on after the last row whose first column is at most `until`.
    """

    def __init__(self, path: Path, columns: Sequence[str], communicator: Communicator, until: float | None = None):
        """Collective. Raises InputError on all ranks when the file to go on with has other columns."""
        self._columns = list(columns)
        self._path = Path(path)
        self._communicator = communicator
        faults = on_root(communicator, self._path, lambda: self._begin(until))
        if faults:
            raise InputError(faults)

    def _begin(self, until: float | None) -> list[str]:
        """Lay down the file as it was at `until`; what is wrong with it, if anything."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        going_on = until is not None and self._path.exists()
        lines = [line for line in self._read_lines() if line.endswith("\n")] if going_on else []
        header, *rows = lines or [_line(self._columns)]
        if header != _line(self._columns):
            return [f"{self._path}: has other columns than this run writes; move it away before the restart"]
        kept = [row for row in rows if until is not None and float(next(csv.reader([row]))[0]) <= until]
        temporary = self._path.with_name(self._path.name + ".tmp")
        temporary.write_text("".join([header, *kept]), newline="")
        replace(temporary, self._path)
        return []

    def _read_lines(self) -> list[str]:
        with self._path.open(newline="") as file:
            return file.readlines()

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
