"""Field files: cells and particles of one time each, as VTKHDF that ParaView opens, written by all ranks at once.

Rank 0 lays down an ordinary HDF5 file whose datasets have their final place on disk, and tells every rank the byte
offsets; all ranks then write their raw values there through MPI-IO. Cells are chunked with one chunk per block, so that
a block is one piece of the file. A file is renamed to its final name when it is complete and on disk, and only then is
it listed in `cells.vtkhdf.series` or `particles.vtkhdf.series` (ParaView's index of the times): whatever is listed is
readable, whenever the run dies.

Format: VTKHDF 2.0, docs.vtk.org, "VTK file formats".
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np

from distfsi.output.interfaces import Blocks, Communicator, Grid

KINDS = ("cells", "particles")


class FieldWriter:
    """Writes the field files of a new run into `directory`; those of an earlier run there are removed."""

    def __init__(self, directory: Path, blocks: Blocks, communicator: Communicator):
        self._directory = Path(directory)
        self._blocks = blocks
        self._communicator = communicator
        self._times: dict[str, dict[str, float]] = {kind: {} for kind in KINDS}
        if communicator.rank == 0:
            self._directory.mkdir(parents=True, exist_ok=True)
            for kind in KINDS:
                _remove_series(self._directory, kind)

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
        "position" (n, 3); the file holds the rows of rank 0, 1, ... None: the scene has no such thing.
        """
        if cells is not None:
            self._publish("cells", number, time, self._write_cells, cells)
        if particles is not None:
            self._publish("particles", number, time, self._write_particles, particles)

    def _publish(
        self,
        kind: str,
        number: int,
        time: float,
        write: Callable[[Path, float, Mapping[str, np.ndarray]], None],
        arrays: Mapping[str, np.ndarray],
    ) -> None:
        """Write a file under a temporary name; make it visible, then listed, once it is complete."""
        path = self._directory / f"{kind}-{number:06d}.vtkhdf"
        temporary = path.with_name(path.name + ".tmp")
        write(temporary, time, arrays)
        if self._communicator.rank == 0:
            _replace(temporary, path)
            self._times[kind][path.name] = float(time)
            _write_series(self._directory, kind, self._times[kind])

    def _write_cells(self, path: Path, time: float, cells: Mapping[str, np.ndarray]) -> None:
        grid = self._blocks.grid
        chunk = self._blocks.block_cells[::-1]
        offsets = None
        if self._communicator.rank == 0:
            offsets = _create_cells(path, time, grid, chunk, cells)
        offsets = self._communicator.broadcast(offsets)
        own = self._blocks.origin[:, ::-1] // chunk
        self._write_pieces(
            path,
            [
                (offsets[name][tuple(index)], block)
                for name, array in cells.items()
                for index, block in zip(own, array, strict=True)
            ],
        )

    def _write_particles(self, path: Path, time: float, particles: Mapping[str, np.ndarray]) -> None:
        rank = self._communicator.rank
        counts = self._communicator.allgather(len(particles["position"]))
        start, stop = sum(counts[:rank]), sum(counts[: rank + 1])
        columns = {_point_data(name): (start, array) for name, array in particles.items()}
        columns["Vertices/Connectivity"] = (start, np.arange(start, stop))
        first = start + 1 if rank else 0  # one more end than vertices: rank 0 writes the leading zero
        columns["Vertices/Offsets"] = (first, np.arange(first, stop + 1))
        offsets = None
        if rank == 0:
            offsets = _create_particles(path, time, sum(counts), {name: rows for name, (_, rows) in columns.items()})
        offsets = self._communicator.broadcast(offsets)
        self._write_pieces(
            path,
            [
                (offsets[name] + row * (array.nbytes // len(array)), array)
                for name, (row, array) in columns.items()
                if len(array)
            ],
        )

    def _write_pieces(self, path: Path, pieces: Sequence[tuple[int, np.ndarray]]) -> None:
        self._communicator.write_at(
            path, [int(offset) for offset, _ in pieces], [np.ascontiguousarray(array) for _, array in pieces]
        )


def series(directory: Path, kind: str) -> list[tuple[float, Path]]:
    """Times [s] and files of `kind` ("cells" or "particles") of a run, in the order written; empty if it has none."""
    path = _series_path(Path(directory), kind)
    if not path.exists():
        return []
    return [(entry["time"], path.with_name(entry["name"])) for entry in json.loads(path.read_text())["files"]]


def read_cells(path: Path) -> tuple[float, dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Time [s], fields (nz, ny, nx) or (nz, ny, nx, 3), lower corner (3,) and cell size (3,) [m] of a cells file."""
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        extent = root.attrs["WholeExtent"]
        shape = np.maximum(extent[1::2] - extent[::2], 1)[::-1]
        dimensions = np.count_nonzero(extent[1::2] > extent[::2])
        fields = {name: data[()].reshape(*shape, *data.shape[dimensions:]) for name, data in root["CellData"].items()}
        return _read_time(root), fields, root.attrs["Origin"], root.attrs["Spacing"]


def read_particles(path: Path) -> tuple[float, dict[str, np.ndarray]]:
    """Time [s] and columns, (n,) or (n, 3), of a particles file; "position" [m] among them."""
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        columns = {name: data[()] for name, data in root["PointData"].items()}
        return _read_time(root), {"position": root["Points"][()], **columns}


# ---- laying down files (rank 0) --------------------------------------------------------------------------------------


def _create_cells(
    path: Path, time: float, grid: Grid, chunk: tuple[int, ...], cells: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Lay down a cells file; byte offsets of the chunks of each field, by block index (z, y, x).

    Unused axes are left out of the datasets and have no extent: VTK then shows a line or a flat image.
    """
    unused = 3 - grid.dimensions
    used = slice(unused, 3)
    shape = tuple(grid.cells[::-1])
    offsets = {}
    with h5py.File(path, "w") as file:
        root = _create_root(file, "ImageData", time)
        root.attrs["WholeExtent"] = [v for n in shape[used][::-1] for v in (0, n)] + [0, 0] * unused
        root.attrs["Origin"] = np.array(grid.lower, dtype=float)
        root.attrs["Spacing"] = np.array(grid.spacing, dtype=float)
        root.attrs["Direction"] = np.eye(3).ravel()
        data = root.create_group("CellData")
        for name, array in cells.items():
            parts = array.shape[4:]
            dataset = _create_dataset(data, name, shape[used] + parts, array.dtype, chunk[used] + parts)
            offsets[name] = np.zeros([-(-n // c) for n, c in zip(shape, chunk, strict=True)], dtype=np.int64)
            _fill_chunk_offsets(dataset, offsets[name].reshape(offsets[name].shape[used]), chunk[used])
    return offsets


def _fill_chunk_offsets(dataset: h5py.Dataset, offsets: np.ndarray, chunk: tuple[int, ...]) -> None:
    def note(stored) -> None:
        offsets[tuple(i // c for i, c in zip(stored.chunk_offset, chunk, strict=False))] = stored.byte_offset

    dataset.id.chunk_iter(note)


def _create_particles(path: Path, time: float, count: int, columns: Mapping[str, np.ndarray]) -> dict[str, int]:
    """Lay down a particles file, one vertex per particle; byte offset of each column (0 if it holds nothing)."""
    with h5py.File(path, "w") as file:
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
        rows = {name: count + (name == "Vertices/Offsets") for name in columns}
        return {
            name: _create_dataset(root, name, (rows[name], *array.shape[1:]), array.dtype, None).id.get_offset() or 0
            for name, array in columns.items()
        }


def _create_root(file: h5py.File, kind: str, time: float) -> h5py.Group:
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = [2, 0]
    root.attrs.create("Type", kind.encode(), dtype=h5py.string_dtype("ascii", len(kind)))
    root["FieldData/TimeValue"] = [float(time)]
    return root


def _create_dataset(group: h5py.Group, name: str, shape, dtype, chunks) -> h5py.Dataset:
    """A dataset whose place in the file is settled at once and is not filled."""
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    return group.create_dataset(name, shape, dtype, chunks=chunks, fill_time="never", dcpl=layout)


def _read_time(root: h5py.Group) -> float:
    return float(root["FieldData/TimeValue"][0])


def _point_data(name: str) -> str:
    return "Points" if name == "position" else f"PointData/{name}"


# ---- names and the index (rank 0) ------------------------------------------------------------------------------------


def _series_path(directory: Path, kind: str) -> Path:
    return directory / f"{kind}.vtkhdf.series"


def _remove_series(directory: Path, kind: str) -> None:
    """Remove the index first, then what it lists: no listed file is ever missing."""
    _series_path(directory, kind).unlink(missing_ok=True)
    for pattern in (f"{kind}-[0-9]*.vtkhdf", f"{kind}-[0-9]*.vtkhdf.tmp"):
        for path in directory.glob(pattern):
            path.unlink()


def _write_series(directory: Path, kind: str, times: Mapping[str, float]) -> None:
    path = _series_path(directory, kind)
    temporary = path.with_name(path.name + ".tmp")
    files = [{"name": name, "time": time} for name, time in times.items()]
    temporary.write_text(json.dumps({"file-series-version": "1.0", "files": files}, indent=1) + "\n")
    _replace(temporary, path)


def _replace(temporary: Path, path: Path) -> None:
    """Give a complete file its final name so that it is found whole even after a crash of the machine."""
    _sync(temporary)
    os.replace(temporary, path)
    _sync(path.parent)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
