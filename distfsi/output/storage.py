"""How the ranks write one HDF5 file together. Three ways, `[output] hdf5`; the datasets hold the same bytes by all.

Errors of the disk become OutputError, on every rank or on none: a rank that fails alone would leave the others waiting.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import h5py
import numpy as np

from distfsi.errors import InputError, OutputError
from distfsi.output.checksum import add_checksum
from distfsi.output.files import replace, unfinished
from distfsi.output.interfaces import Communicator
from distfsi.output.manifest import claim

LayDown = Callable[[h5py.File], Mapping[str, h5py.Dataset]]
ROOM = 2**20  # bytes, more than HDF5 needs besides the values
Piece = tuple[str, tuple[int, ...], np.ndarray]  # name of the dataset, index of the first value, values


class Storage(Protocol):
    """A way to write HDF5."""

    def write(self, path: Path, lay_down: LayDown, pieces: Sequence[Piece]) -> None:
        """Write a new file `path`; collective. Raises OutputError on all ranks.

        `lay_down`, called on rank 0, fills an open file and returns datasets of `create_dataset` by name.
        `pieces`: what this rank puts there, maybe nothing. A piece is one whole chunk, which may reach beyond the
        dataset's end, or, in a dataset without chunks, some rows.
        """


def storage(name: str, communicator: Communicator) -> Storage:
    """The storage called "mpi-io", "mpio" or "gather". Raises InputError when this h5py has no "mpio"."""
    if name == "mpio" and not h5py.get_config().mpi:
        remedy = 'launch/install-parallel-hdf5.sh builds one; "mpi-io" also writes from all ranks, and needs none'
        raise InputError([f'output.hdf5: "mpio" needs an h5py with parallel HDF5: {remedy}'])
    kinds: dict[str, type[MpiIo] | type[ParallelHdf5] | type[Gather]]
    kinds = {"mpi-io": MpiIo, "mpio": ParallelHdf5, "gather": Gather}
    return kinds[name](communicator)


def parallel_hdf5() -> str:
    """How this h5py writes from several ranks, in words."""
    able = "has" if h5py.get_config().mpi else "has no"
    return f"h5py {h5py.__version__} {able} parallel HDF5; all ranks write by MPI-IO either way"


def write_complete(
    storage: Storage,
    communicator: Communicator,
    path: Path,
    lay_down: LayDown,
    pieces: Sequence[Piece],
    with_checksum: bool = False,
) -> None:
    """Write a file (see Storage.write) that has its name only once it is complete and on disk; a failed one is removed.

    `with_checksum`: whoever reads it can tell whether it is what was written (output/checksum.py).
    Collective. Raises OutputError on all ranks.
    """
    temporary = unfinished(path)
    on_root(communicator, path, lambda: claim(path))
    try:
        storage.write(temporary, lay_down, pieces)
        if with_checksum:
            with naming(temporary):
                add_checksum(temporary, communicator)
    except OutputError:
        on_root(communicator, temporary, lambda: temporary.unlink(missing_ok=True))
        raise
    on_root(communicator, path, lambda: replace(temporary, path))


class MpiIo:
    """Rank 0 lays down the file, and all ranks write raw values to their final positions in it through MPI-IO."""

    def __init__(self, communicator: Communicator):
        self._communicator = communicator

    def write(self, path: Path, lay_down: LayDown, pieces: Sequence[Piece]) -> None:
        layouts = on_root(self._communicator, path, lambda: _create(path, lay_down))
        pieces = [piece for piece in pieces if piece[2].size]
        offsets = [layouts[name].offset(start) for name, start, _ in pieces]
        with naming(path):
            self._communicator.write_at(path, offsets, [np.ascontiguousarray(values) for _, _, values in pieces])


class Gather:
    """Rank 0 does all the writing, and receives what the other ranks have, one rank after the other."""

    def __init__(self, communicator: Communicator):
        self._communicator = communicator

    def write(self, path: Path, lay_down: LayDown, pieces: Sequence[Piece]) -> None:
        layouts = on_root(self._communicator, path, lambda: _create(path, lay_down))
        for rank in range(self._communicator.size):
            received = self._communicator.bring(pieces, rank)
            on_root(self._communicator, path, partial(_add, path, layouts, received))


class ParallelHdf5:
    """Rank 0 lays down the file and reserves its space, and all ranks write to it through HDF5's own MPI driver."""

    def __init__(self, communicator: Communicator):
        self._communicator = communicator

    def write(self, path: Path, lay_down: LayDown, pieces: Sequence[Piece]) -> None:
        names = on_root(self._communicator, path, lambda: _allocate(path, lay_down))

        def write() -> None:
            with h5py.File(path, "r+", driver="mpio", comm=self._communicator.world) as file:
                # Each by itself, not collectively: ranks have different numbers of pieces.
                for name, start, values in pieces:
                    _put(file[names[name]], start, values)
                file.flush()

        _, failure = _attempt(path, write)
        _raise_first(self._communicator.allgather(failure))


# ---- the file's layout -----------------------------------------------------------------------------------------------


def create_dataset(
    group: h5py.Group, name: str, shape: Sequence[int], dtype: np.dtype, chunks: Sequence[int] | None = None
) -> h5py.Dataset:
    """A dataset whose position in the file is settled at once and is not filled."""
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    return group.create_dataset(name, shape, dtype, chunks=chunks, fill_time="never", dcpl=layout)


class Layout:
    """Where in its file a dataset of `create_dataset` has its values."""

    def __init__(self, dataset: h5py.Dataset):
        self._itemsize = dataset.dtype.itemsize
        self._chunk = dataset.chunks or dataset.shape
        if dataset.chunks is None:
            self._bytes = np.full((1,) * dataset.ndim, dataset.id.get_offset() or 0)
            return
        self._bytes = np.zeros([-(-n // c) for n, c in zip(dataset.shape, self._chunk, strict=True)], dtype=np.int64)

        def note(stored: Any) -> None:
            self._bytes[tuple(np.floor_divide(stored.chunk_offset, self._chunk))] = stored.byte_offset

        if hasattr(dataset.id, "chunk_iter"):
            dataset.id.chunk_iter(note)
        else:  # HDF5 before 1.12.3, slow with many chunks
            for chunk in map(dataset.id.get_chunk_info, range(dataset.id.get_num_chunks())):
                note(chunk)

    def offset(self, start: Sequence[int]) -> int:
        """Byte offset of the value at index `start`."""
        chunk, inside = np.divmod(start, self._chunk)
        return int(self._bytes[tuple(chunk)] + np.ravel_multi_index(inside, self._chunk) * self._itemsize)


def _create(path: Path, lay_down: LayDown) -> dict[str, Layout]:
    with h5py.File(path, "w") as file:
        return {name: Layout(dataset) for name, dataset in lay_down(file).items()}


def _allocate(path: Path, lay_down: LayDown) -> dict[str, str]:
    """Create a file that has all the space it needs; where its datasets are.

    HDF5's MPI driver may notice nothing on a disk that runs full, and old versions crash when they close a file there.
    """
    path.write_bytes(bytes(ROOM))
    with h5py.File(path, "w") as file:
        names = {name: dataset.name for name, dataset in lay_down(file).items()}
    with path.open("r+b") as file:
        os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
        os.fsync(file.fileno())
    return names


def _add(path: Path, layouts: Mapping[str, Layout], pieces: Sequence[Piece]) -> None:
    """Write raw values to their positions."""
    with path.open("r+b") as file:
        for name, start, values in pieces:
            if values.size:
                file.seek(layouts[name].offset(start))
                file.write(np.ascontiguousarray(values).data)


def _put(dataset: h5py.Dataset, start: Sequence[int], values: np.ndarray) -> None:
    """Write the part of a piece that lies inside the dataset."""
    counts = [min(n, end - first) for n, end, first in zip(values.shape, dataset.shape, start, strict=True)]
    if values.size:
        target = tuple(slice(first, first + n) for first, n in zip(start, counts, strict=True))
        dataset[target] = values[tuple(map(slice, counts))]


# ---- errors ----------------------------------------------------------------------------------------------------------


def on_root(communicator: Communicator, path: Path, action: Callable[[], Any]) -> Any:
    """What `action`, which writes `path`, returns on rank 0, on every rank; its OSError is every rank's OutputError."""
    outcome = _attempt(path, action) if communicator.rank == 0 else None
    result, failure = communicator.broadcast(outcome)
    _raise_first([failure])
    return result


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Turn an OSError inside into an OutputError that names the file, the cause and the space left."""
    try:
        yield
    except (OSError, RuntimeError) as error:  # RuntimeError: HDF5, when it cannot close a file on a full disk
        raise OutputError(f"{path} could not be written: {_cause(error)}; {_free(path)}") from error


def _attempt(path: Path, action: Callable[[], Any]) -> tuple[Any, str]:
    """The result of an action, and why it failed (empty if it did not)."""
    try:
        with naming(path):
            return action(), ""
    except OutputError as error:
        return None, str(error)


def _raise_first(failures: Sequence[str]) -> None:
    for failure in filter(None, failures):
        raise OutputError(failure)


def _cause(error: OSError | RuntimeError) -> str:
    """The system's words for an error, also for one that HDF5 or MPI-IO wrap in theirs."""
    number = getattr(error, "errno", None) or next(iter(re.findall(r"errno = (\d+)", str(error))), None)
    return os.strerror(int(number)) if number else str(error)


def _free(path: Path) -> str:
    """How much space is left where a file lies or would lie."""
    folder = next(parent for parent in path.absolute().parents if parent.is_dir())
    return f"{shutil.disk_usage(folder).free / 1e6:,.1f} MB are free there"
