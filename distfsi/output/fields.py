"""Field files: cells and particles of one time each, as VTKHDF that ParaView opens, written by all ranks at once.

Cells are chunked with one chunk per block, so that a block is one piece of the file. A file is renamed to its final
name when it is complete and on disk, and only then is it listed in `cells.vtkhdf.series` or `particles.vtkhdf.series`
(ParaView's index of the times): whatever is listed is readable, whenever the run dies.

Format: VTKHDF 2.0, docs.vtk.org, "VTK file formats".
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from distfsi.output.files import write_text
from distfsi.output.interfaces import Blocks, Communicator, Grid
from distfsi.output.manifest import claim, owns, remove
from distfsi.output.quantities import UNITS
from distfsi.output.storage import MpiIo, Piece, Storage, create_dataset, on_root, write_complete

LARGEST_LAYER = 1000  # cells along an axis that a picture takes
KINDS = ("cells", "particles")
AXES = "distfsi axes"  # attribute of a cells file: the names of the axes where they are not x, y, z

Shapes = Mapping[str, tuple[tuple[int, ...], np.dtype]]  # of one cell's or particle's value, and its type, by name
Fill = Callable[[h5py.File, float], Mapping[str, h5py.Dataset]]


class FieldWriter:
    """Writes the field files of a run into `directory`.

    Those that are listed or the run's own (output/manifest.py) are removed; at a restart, which goes on with them, only
    those after `until` [s].
    """

    def __init__(
        self,
        directory: Path,
        blocks: Blocks,
        communicator: Communicator,
        storage: Storage | None = None,
        until: float | None = None,
    ):
        """Collective. `storage` None: MPI-IO. Raises OutputError on all ranks."""
        self._directory = Path(directory)
        self._blocks = blocks
        self._communicator = communicator
        self._storage = storage or MpiIo(communicator)
        self._times = on_root(communicator, self._directory, lambda: _keep_until(self._directory, until))

    def write(
        self,
        number: int,
        time: float,
        cells: Mapping[str, np.ndarray] | None,
        particles: Mapping[str, np.ndarray] | None,
    ) -> None:
        """Write the state at `time` [s] as files `number`; collective, every rank gives the same names and types.

        `cells`: own blocks without ghosts, (blocks, bz, by, bx) or (blocks, bz, by, bx, 3); what lies beyond the last
        active cell of a partly filled block is not part of the file. `particles`: own rows, (n,) or (n, 3), among them
        "position" (n, 3); the file holds the rows of rank 0, 1, ... None: the scene has no such thing. Raises
        OutputError on all ranks.
        """
        if cells is not None:
            self._publish("cells", number, time, *self._lay_out_cells(cells))
        if particles is not None:
            self._publish("particles", number, time, *self._lay_out_particles(particles))

    def _publish(self, kind: str, number: int, time: float, fill: Fill, pieces: Sequence[Piece]) -> None:
        """Write a file under a temporary name; make it visible, then listed, once it is complete."""
        path = self._directory / f"{kind}-{number:06d}.vtkhdf"
        times = self._times[kind]
        write_complete(self._storage, self._communicator, path, lambda file: fill(file, time), pieces)
        times[path.name] = float(time)
        on_root(self._communicator, path, lambda: _write_series(self._directory, kind, times))

    def _lay_out_cells(self, cells: Mapping[str, np.ndarray]) -> tuple[Fill, list[Piece]]:
        """How to fill a cells file, and this rank's pieces of it: its blocks.

        Unused axes are left out of the datasets and have no extent: VTK then shows a line or a flat image.
        """
        grid, used = self._blocks.grid, slice(3 - self._blocks.grid.dimensions, 3)
        chunk = tuple(self._blocks.block_cells)[::-1][used]
        shapes = {name: (array.shape[4:], array.dtype) for name, array in cells.items()}
        pieces = [
            (name, (*origin[::-1][used], *(0,) * len(block.shape[3:])), block.reshape(*chunk, *block.shape[3:]))
            for name, array in cells.items()
            for origin, block in zip(self._blocks.origin, array, strict=True)
        ]
        return partial(_fill_cells, grid, chunk, shapes), pieces

    def _lay_out_particles(self, particles: Mapping[str, np.ndarray]) -> tuple[Fill, list[Piece]]:
        """How to fill a particles file, and this rank's pieces of it: a run of rows of each column."""
        rank = self._communicator.rank
        counts = self._communicator.allgather(len(particles["position"]))
        start, stop = sum(counts[:rank]), sum(counts[: rank + 1])
        columns = {_point_data(name): (start, array) for name, array in particles.items()}
        columns["Vertices/Connectivity"] = (start, np.arange(start, stop))
        first = start + 1 if rank else 0  # one more end than vertices: rank 0 writes the leading zero
        columns["Vertices/Offsets"] = (first, np.arange(first, stop + 1))
        shapes = {name: (array.shape[1:], array.dtype) for name, (_, array) in columns.items()}
        pieces = [(name, (row, *(0,) * (array.ndim - 1)), array) for name, (row, array) in columns.items()]
        return partial(_fill_particles, sum(counts), shapes), pieces


def series(directory: Path, kind: str) -> list[tuple[float, Path]]:
    """Times [s] and files of `kind` ("cells" or "particles") of a run, in the order written; empty if it has none."""
    path = _series_path(Path(directory), kind)
    if not path.exists():
        return []
    return [(entry["time"], path.with_name(entry["name"])) for entry in json.loads(path.read_text())["files"]]


def read_cells(
    path: Path, names: Sequence[str] | None = None
) -> tuple[float, dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Time [s], fields (nz, ny, nx) or (nz, ny, nx, 3), lower corner (3,) and cell size (3,) [m] of a cells file. Of
    the fields only `names` are read, by default all."""
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        extent = root.attrs["WholeExtent"]
        shape = np.maximum(extent[1::2] - extent[::2], 1)[::-1]
        dimensions = np.count_nonzero(extent[1::2] > extent[::2])
        cells = root["CellData"]
        read = {name: cells[name] for name in (cells if names is None else names)}
        fields = {name: data[()].reshape(*shape, *data.shape[dimensions:]) for name, data in read.items()}
        return _read_time(root), fields, root.attrs["Origin"], root.attrs["Spacing"]


def read_layer(
    path: Path, normal: int, position: float | None = None, names: Sequence[str] | None = None
) -> tuple[float, dict[str, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Time [s], fields (nv, nh) or (nv, nh, 3) and corners, low and high (3,) [m], of a layer of cells of a cells file.

    It is the one that the plane normal to axis `normal` at `position` [m] (None: the middle) passes through; nh cells
    along the first of the other axes, nv along the second. Of the fields only `names` are read, by default all; of
    large layers only each so many cells, for more than LARGEST_LAYER along an axis are too fine to be seen. Raises
    ValueError when the plane passes by or there is nothing to cut, KeyError when there is no such field.
    """
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        cells = np.maximum(root.attrs["WholeExtent"][1::2], 1)
        low, spacing = root.attrs["Origin"], root.attrs["Spacing"]
        dimensions = np.count_nonzero(root.attrs["WholeExtent"][1::2])
        if position is not None and dimensions < 3:
            raise ValueError("only three dimensions can be cut")
        layer = cells[normal] // 2 if position is None else int(np.floor((position - low[normal]) / spacing[normal]))
        if not 0 <= layer < cells[normal]:
            raise ValueError(f"the plane at {position:g} m lies outside of the domain along {'xyz'[normal]}")
        others = [axis for axis in (2, 1, 0) if axis != normal]
        steps = [-(-cells[axis] // LARGEST_LAYER) if cells[others].min() > 1 else 1 for axis in others]
        chosen: list[slice | int] = [slice(None, None, step) for step in steps]
        chosen.insert(2 - normal, layer)
        shape = [-(-cells[axis] // step) for axis, step in zip(others, steps, strict=True)]
        data = root["CellData"]
        fields = {
            name: data[name][tuple(chosen[3 - dimensions :])].reshape(*shape, *data[name].shape[dimensions:])
            for name in (names if names is not None else data)
        }
        high = low + np.where(np.arange(3) < dimensions, cells * spacing, 0.0)
        low[normal] += layer * spacing[normal] * (normal < dimensions)
        high[normal] = low[normal] + spacing[normal] * (normal < dimensions)
        return _read_time(root), fields, (low, high)


def read_grid(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells, at least one, low corner and edges of a cell [m] along x, y, z of a cells file."""
    with h5py.File(path) as file:
        attributes = file["VTKHDF"].attrs
        return np.maximum(attributes["WholeExtent"][1::2], 1), attributes["Origin"], attributes["Spacing"]


def read_axes(path: Path) -> str:
    """Names of the axes of a cells file: those of its coordinates, filled up from x, y, z."""
    with h5py.File(path) as file:
        named = file["VTKHDF"].attrs.get(AXES, "")
        return named + "xyz"[len(named) :]


def axis_across(path: Path) -> int:
    """The axis across the only layer of a cells file; z if it has several."""
    cells, _, _ = read_grid(path)
    return 2 if cells[2] == 1 or cells.min() > 1 else int(np.argmin(cells))


def field_names(path: Path) -> list[str]:
    """Fields of a cells or particles file."""
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        return list(root["CellData" if "CellData" in root else "PointData"])


def read_particles(path: Path, names: Sequence[str] | None = None) -> tuple[float, dict[str, np.ndarray]]:
    """Time [s] and columns, (n,) or (n, 3), of a particles file; "position" [m] among them. Only `names` are read, by
    default all."""
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        wanted = ["position", *root["PointData"]] if names is None else names
        return _read_time(root), {name: root[_point_data(name)][()] for name in wanted}


def read_time(path: Path) -> float:
    """Time [s] of a field file."""
    with h5py.File(path) as file:
        return _read_time(file["VTKHDF"])


# ---- laying down files ----------------------------------------------------------------------------------------------


def _fill_cells(
    grid: Grid, chunk: tuple[int, ...], shapes: Shapes, file: h5py.File, time: float
) -> dict[str, h5py.Dataset]:
    """Lay down a cells file; its fields."""
    unused = 3 - grid.dimensions
    cells = grid.cells[: grid.dimensions]
    root = _create_root(file, "ImageData", time)
    root.attrs["WholeExtent"] = [v for n in cells for v in (0, n)] + [0, 0] * unused
    root.attrs["Origin"] = np.array(grid.lower, dtype=float)
    root.attrs["Spacing"] = np.array(grid.spacing, dtype=float)
    root.attrs["Direction"] = np.eye(3).ravel()
    if grid.coordinates.radial:
        root.attrs[AXES] = grid.coordinates.axes
    data = root.create_group("CellData")
    fields = {
        name: create_dataset(data, name, tuple(cells[::-1]) + parts, dtype, chunk + parts)
        for name, (parts, dtype) in shapes.items()
    }
    _note_units(fields)
    return fields


def _fill_particles(count: int, shapes: Shapes, file: h5py.File, time: float) -> dict[str, h5py.Dataset]:
    """Lay down a particles file, one vertex per particle; its columns."""
    root = _create_root(file, "PolyData", time)
    root["NumberOfPoints"] = [count]
    root.create_group("PointData")
    for topology in ("Vertices", "Lines", "Polygons", "Strips"):
        used = count if topology == "Vertices" else 0
        root[f"{topology}/NumberOfCells"] = [used]
        root[f"{topology}/NumberOfConnectivityIds"] = [used]
        if topology != "Vertices":
            root[f"{topology}/Offsets"] = np.zeros(1, dtype=np.int64)
            root[f"{topology}/Connectivity"] = np.zeros(0, dtype=np.int64)
    rows = {name: count + (name == "Vertices/Offsets") for name in shapes}
    fields = {name: create_dataset(root, name, (rows[name], *parts), dtype) for name, (parts, dtype) in shapes.items()}
    _note_units(fields)
    return fields


def _note_units(fields: Mapping[str, h5py.Dataset]) -> None:
    """Datasets of quantities say their units, as text that all programs read."""
    for name, dataset in fields.items():
        unit = "m" if name == "Points" else UNITS.get(name.rpartition("/")[2], "")
        if unit:
            dataset.attrs["units"] = unit.replace("³", "3")


def _create_root(file: h5py.File, kind: str, time: float) -> h5py.Group:
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = [2, 0]
    root.attrs.create("Type", kind.encode(), dtype=h5py.string_dtype("ascii", len(kind)))
    root["FieldData/TimeValue"] = [float(time)]
    return root


def _read_time(root: h5py.Group) -> float:
    return float(root["FieldData/TimeValue"][0])


def _point_data(name: str) -> str:
    return "Points" if name == "position" else f"PointData/{name}"


# ---- names and the index (rank 0) ------------------------------------------------------------------------------------


def _series_path(directory: Path, kind: str) -> Path:
    return directory / f"{kind}.vtkhdf.series"


def field_faults(directory: Path, until: float) -> list[str]:
    """What keeps the field files of a run from being continued after `until` [s]."""
    faults = []
    for kind in KINDS:
        index = _series_path(directory, kind)
        try:
            listed = series(directory, kind)
        except (OSError, ValueError, KeyError, TypeError) as error:
            faults.append(f"{index}: is no list of field files: {error}")
            continue
        faults += [f"{path}: is missing, or empty" for time, path in listed if time <= until and not _is_there(path)]
        if not listed and any(map(owns, directory.glob(f"{kind}-*.vtkhdf"))):
            faults.append(f"{index}: is missing, though there are field files")
    return faults


def _is_there(path: Path) -> bool:
    return path.is_file() and path.stat().st_size > 0


def _keep_until(directory: Path, until: float | None) -> dict[str, dict[str, float]]:
    """Remove the files after `until` [s], or all; the times of the others, by kind and name.

    They leave the index first: no listed file is ever missing. Files that are neither listed nor the run's own stay.
    """
    directory.mkdir(parents=True, exist_ok=True)
    kept: dict[str, dict[str, float]] = {}
    for kind in KINDS:
        listed = series(directory, kind)
        kept[kind] = {path.name: time for time, path in listed if until is not None and time <= until}
        if kept[kind]:
            _write_series(directory, kind, kept[kind])
        elif _series_path(directory, kind).exists():
            remove(_series_path(directory, kind))
        numbered = re.compile(rf"({kind}-\d{{6,}}\.vtkhdf)(\.tmp)?")
        found = {path.with_name(name[1]) for path in directory.iterdir() if (name := numbered.fullmatch(path.name))}
        for path in sorted(found & ({path for _, path in listed} | {path for path in found if owns(path)})):
            if path.name not in kept[kind]:
                remove(path)
    return kept


def _write_series(directory: Path, kind: str, times: Mapping[str, float]) -> None:
    path = _series_path(directory, kind)
    files = [{"name": name, "time": time} for name, time in times.items()]
    claim(path)
    write_text(path, json.dumps({"file-series-version": "1.0", "files": files}, indent=1) + "\n")
