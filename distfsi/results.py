"""What a run has left in its directory, as arrays: history, gauges, fields of cells and particles."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from distfsi.errors import InputError
from distfsi.output.fields import field_names, read_axes, read_cells, read_grid, read_particles, read_time, series
from distfsi.output.history import read_history
from distfsi.output.journal import read_journal
from distfsi.output.quantities import UNITS
from distfsi.scene.description import Origin, Scene
from distfsi.scene.loader import scene_again

COMPONENTS = {3: ("_x", "_y", "_z"), 6: ("_xx", "_yy", "_zz", "_xy", "_yz", "_xz")}
WITH_UNIT = re.compile(r"(.+) \[(.*)\]")


class Table(Mapping[str, "np.ndarray | list[str]"]):
    """Columns of a CSV file by name, each (rows,): numbers, or words in a list.

    units: of the columns that have one, by name
    """

    def __init__(self, path: Path):
        """Raises InputError when there is no such file."""
        self.path = path
        try:
            columns = read_history(path)
        except OSError as error:
            raise InputError([f"{path}: cannot be read: {error.strerror}"]) from error
        self._columns: dict[str, np.ndarray | list[str]] = {}
        self.units: dict[str, str] = {}
        for title, column in columns.items():
            match = WITH_UNIT.fullmatch(title)
            name = match[1] if match else title
            self._columns[name] = column
            if match:
                self.units[name] = match[2]

    def __getitem__(self, name: str) -> Any:
        if name not in self._columns:
            raise KeyError(f"{self.path.name} has no column {name!r}, but {', '.join(self._columns)}")
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        return f"<{self.path.name}: {', '.join(self._columns)}>"

    def to_pandas(self) -> Any:
        """As a DataFrame of pandas, which has to be installed; its columns are named with their units."""
        units = {name: f" [{unit}]" for name, unit in self.units.items()}
        return import_module("pandas").DataFrame({name + units.get(name, ""): column for name, column in self.items()})


class Fields(Mapping[str, np.ndarray]):
    """Fields of a file by name, each read when it is asked for.

    time   [s]
    units  of the fields that have one, by name
    """

    def __init__(self, path: Path, names: Sequence[str], read: Callable[[Path, str], np.ndarray]):
        self.path, self.time = path, read_time(path)
        self._names, self._read = names, read
        self.units = {name: UNITS[name] for name in names if name in UNITS}

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._names:
            raise KeyError(f"{self.path.name} has no field {name!r}, but {', '.join(self._names)}")
        return self._read(self.path, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"<{self.path.name} at t = {self.time:g} s: {', '.join(self._names)}>"


class Cells(Fields):
    """Fields of all cells: scalars (nz, ny, nx), vectors (nz, ny, nx, 3); NaN where a body covers a cell.

    lower, spacing  (3,) [m] lower corner of the domain, size of a cell
    """

    def __init__(self, path: Path):
        super().__init__(path, field_names(path), lambda path, name: read_cells(path, [name])[1][name])
        self._cells, self.lower, self.spacing = read_grid(path)

    @cached_property
    def centers(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Middles of the cells [m] along x (nx,), y (ny,) and z (nz,), or along the axes of a radial domain."""
        x, y, z = (
            low + (np.arange(n) + 0.5) * h for low, n, h in zip(self.lower, self._cells, self.spacing, strict=True)
        )
        return x, y, z

    def to_xarray(self) -> Any:
        """As a Dataset of xarray, which has to be installed, with the middles of the cells as coordinates."""
        axes = read_axes(self.path)
        coordinates = {axis: (axis, x, {"units": "m"}) for axis, x in zip(axes, self.centers, strict=True)}
        fields = {}
        for name, values in self.items():
            names = (*axes[::-1], *(["component"] if values.ndim > 3 else []))
            fields[name] = (names, values, {"units": self.units[name]} if name in self.units else {})
        return import_module("xarray").Dataset(fields, coordinates, {"time": self.time})


class Particles(Fields):
    """Columns of all particles: scalars (n,), vectors (n, 3), the stress (n, 6) as xx, yy, zz, xy, yz, xz."""

    def __init__(self, path: Path):
        names = ["position", *field_names(path)]
        super().__init__(path, names, lambda path, name: read_particles(path, [name])[1][name])

    def to_pandas(self) -> Any:
        """As a DataFrame of pandas, which has to be installed; a vector makes a column per component."""
        columns: dict[str, np.ndarray] = {}
        for name, values in self.items():
            parts = COMPONENTS[values.shape[1]] if values.ndim > 1 else ("",)
            columns |= {name + part: column for part, column in zip(parts, np.atleast_2d(values.T), strict=True)}
        return import_module("pandas").DataFrame(columns)


class Results:
    """What a run has left in a directory, also while it goes on."""

    def __init__(self, directory: str | Path):
        """Raises InputError when no run has left anything there."""
        self.directory = Path(directory)
        if not read_journal(self.directory):
            raise InputError([f"{self.directory}: no run has left its run.json there"])

    def __repr__(self) -> str:
        return f"<{self.directory}: {self.status}>"

    @property
    def journal(self) -> dict[str, Any]:
        """What is known of the run as a whole: when, by whom, how it ended."""
        return read_journal(self.directory)

    @property
    def status(self) -> str:
        """ "running", "done", "stopped", "diverged" or "failed"."""
        return self.journal["status"]

    @cached_property
    def scene(self) -> Scene:
        """What was computed. Raises InputError when the run does not tell, or its input is valid no more."""
        if "input" not in self.journal:
            raise InputError([f"{self.directory}: run.json does not tell the input"])
        origin = self.journal["input"]
        return scene_again(Origin(origin["file"], origin["text"], tuple(origin["settings"])))

    @property
    def history(self) -> Table:
        """A row per logged step: time, time step, conserved totals."""
        return Table(self.directory / "history.csv")

    @property
    def performance(self) -> Table:
        """Seconds that each part of the steps took."""
        return Table(self.directory / "performance.csv")

    @property
    def gauges(self) -> dict[str, Table]:
        """Samples of the gauges that write tables, by name."""
        return {path.stem: Table(path) for path in sorted((self.directory / "gauges").glob("*.csv"))}

    def times(self, kind: str = "cells") -> np.ndarray:
        """(files,) [s] when "cells" or "particles" were written."""
        return np.array([time for time, _ in series(self.directory, kind)])

    def cells(self, time: float | None = None) -> Cells:
        """The cells nearest to a `time` [s]; None: the last ones. Raises InputError when there are none."""
        return Cells(self._nearest(self.directory, "cells", time))

    def particles(self, time: float | None = None) -> Particles:
        """The particles nearest to a `time` [s]; None: the last ones. Raises InputError when there are none."""
        return Particles(self._nearest(self.directory, "particles", time))

    def map(self, gauge: str, time: float | None = None) -> Cells:
        """The layer of cells that a gauge, of a plane or a surface, wrote nearest to a `time` [s]; None: the last one.
        Raises InputError when there is none."""
        return Cells(self._nearest(self.directory / "gauges" / gauge, "cells", time))

    def _nearest(self, directory: Path, kind: str, time: float | None) -> Path:
        files = series(directory, kind)
        if not files:
            raise InputError([f"{directory}: has no files of {kind}"])
        return files[-1][1] if time is None else min(files, key=lambda file: abs(file[0] - time))[1]
