"""Restart files: the whole state of a run after a step, from which any number of ranks goes on to the same bits.

A file holds the snapshots of the run's parts as `/PART/KIND/NAME`. How an array is cut among the ranks depends on its
kind:

    cells      own blocks (local blocks, ..., bz, by, bx); in the file one array (..., nz, ny, nx), a chunk per block
    particles  own rows; in the file all rows, of which each rank reads an equal share
    sums       rows of contributions to a total; if blocks or tiles have changed, the first row gets the total
    values     the same on all ranks
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from distfsi.errors import InputError
from distfsi.output.interfaces import Blocks, Communicator, FilledBlocks
from distfsi.output.storage import Piece, Storage, create_dataset, on_root, write_complete

FORMAT = 2
KEPT = 2  # restart files in an output directory
# What may change at a restart: as it likes, or so that the user is told.
FREE = ("title", "output", "gauges", "performance", "time.wall_clock_limit", "time.smallest_step")
REPORTED = ("time.end", "time.maximum_steps", "time.cfl")

Snapshot = Mapping[str, Mapping[str, np.ndarray]]


# ---- writing ---------------------------------------------------------------------------------------------------------


class RestartWriter:
    """Writes `restart-STEP.h5` into a run's directory and keeps the last two.

    Those of an earlier run there are removed; at a restart only those after step `until`.
    """

    def __init__(
        self,
        directory: Path,
        scene: Any,
        blocks: Blocks,
        communicator: Communicator,
        storage: Storage,
        until: int | None = None,
    ):
        """Collective. Raises OutputError on all ranks."""
        self._directory, self._scene = Path(directory), json.dumps(describe(scene))
        self._blocks, self._communicator, self._storage = blocks, communicator, storage
        on_root(communicator, self._directory, lambda: _remove_after(self._directory, until))

    def write(self, step: int, snapshots: Mapping[str, Snapshot]) -> Path:
        """Write the snapshots of all parts after so many steps; collective. Raises OutputError on all ranks."""

        def arrays(*kinds: str) -> dict[str, np.ndarray]:
            return {
                f"{part}/{kind}/{name}": array
                for part, snapshot in snapshots.items()
                for kind in kinds
                for name, array in snapshot.get(kind, {}).items()
            }

        cells, rows, values = arrays("cells"), arrays("particles", "sums"), arrays("values")
        counts = np.array(self._communicator.allgather([len(array) for array in rows.values()]), dtype=np.int64)
        totals, firsts = counts.sum(axis=0), counts[: self._communicator.rank].sum(axis=0)

        def lay_down(file: h5py.File) -> dict[str, h5py.Dataset]:
            file.attrs.update(format=FORMAT, step=step)
            file["scene"] = self._scene  # too long for an attribute
            for name, value in values.items():
                file[name] = value
            grids = {name: self._grid_dataset(file, name, array) for name, array in cells.items()}
            return grids | {
                name: create_dataset(file, name, (total, *array.shape[1:]), array.dtype)
                for (name, array), total in zip(rows.items(), totals.tolist(), strict=True)
            }

        pieces: list[Piece] = [
            (name, (*[0] * (block.ndim - 3), *origin.tolist()), block)
            for name, array in cells.items()
            for origin, block in zip(self._blocks.origin[:, ::-1], array, strict=True)
        ]
        for (name, array), first in zip(rows.items(), firsts.tolist(), strict=True):
            pieces.append((name, (first, *[0] * (array.ndim - 1)), array))
        path = self._directory / f"restart-{step:08d}.h5"
        write_complete(self._storage, self._communicator, path, lay_down, pieces)
        on_root(self._communicator, path, lambda: _remove_oldest(self._directory))
        return path

    def _grid_dataset(self, file: h5py.File, name: str, array: np.ndarray) -> h5py.Dataset:
        shape = (*array.shape[1:-3], *self._blocks.grid.cells[::-1])
        return create_dataset(file, name, shape, array.dtype, array.shape[1:])


def files_of(directory: Path) -> list[tuple[int, Path]]:
    """Step and path of the restart files in a directory, in the order of their steps."""
    found = directory.glob("restart-[0-9]*.h5")
    return sorted((int(path.stem.removeprefix("restart-")), path) for path in found)


def _remove_after(directory: Path, until: int | None) -> None:
    directory.mkdir(parents=True, exist_ok=True)
    later = [path for step, path in files_of(directory) if until is None or step > until]
    for path in [*later, *directory.glob("restart-[0-9]*.h5.tmp")]:
        path.unlink()


def _remove_oldest(directory: Path) -> None:
    for _, path in files_of(directory)[:-KEPT]:
        path.unlink()


# ---- reading ---------------------------------------------------------------------------------------------------------


class Restart:
    """A restart file of some run: its path, after which step and at which time [s] it was written, and the scene."""

    def __init__(self, path: Path):
        """Raises InputError when `path` is no complete restart file of this format."""
        self.path = Path(path)
        try:
            with h5py.File(path) as file:
                found, self.step = int(file.attrs["format"]), int(file.attrs["step"])
                self._scene = json.loads(file["scene"][()])
                self.time = float(file["simulation/values/time"][()])
        except (OSError, KeyError) as error:
            raise InputError([f"{path}: is no complete restart file: {error}"]) from error
        if found != FORMAT:
            raise InputError([f"{path}: has format {found}, this version of distfsi reads format {FORMAT}"])

    def changes(self, scene: Any) -> list[str]:
        """What has changed since the restart file was written and bears on the results, although it may.

        Raises InputError with one line per key that differs and may not.
        """
        now = describe(scene)
        changed = {
            key: f"{key}: {now.get(key, 'absent')}; was {self._scene.get(key, 'absent')} in {self.path}"
            for key in [*now, *(self._scene.keys() - now.keys())]
            if now.get(key) != self._scene.get(key) and not any(f"{key}.".startswith(f"{free}.") for free in FREE)
        }
        faults = [text for key, text in changed.items() if key not in REPORTED]
        if faults:
            raise InputError([*faults, f"at a restart only these may change: {', '.join([*FREE, *REPORTED])}"])
        return list(changed.values())

    def restore(self, parts: Mapping[str, Any], blocks: FilledBlocks, communicator: Communicator) -> None:
        """Collective. Bring back the parts that were kept; the others stay as they are.

        Raises InputError on all ranks when a part kept other things then than it keeps now.
        """
        with h5py.File(self.path) as file:
            for part in filter(file.__contains__, parts):
                present = parts[part].snapshot()
                if {kind: set(named) for kind, named in file[part].items()} != {k: set(v) for k, v in present.items()}:
                    raise InputError([f"{self.path}: holds another kind of '{part}' than this run has"])
                share = {
                    kind: {
                        name: READERS[kind](dataset, present[kind].get(name), blocks, communicator)
                        for name, dataset in named.items()
                    }
                    for kind, named in file[part].items()
                }
                parts[part].restore(share)


def find_restart(where: str | None, directory: Path, scene: Any, communicator: Communicator) -> Restart | None:
    """The restart file at `where`, or "auto": the newest complete one in `directory`, None if there is none.

    Collective; rank 0 tells which it is, and what of the `scene` has changed since. Raises InputError on all ranks when
    the file is unusable or belongs to another scene.
    """
    path, faults = None, []
    if communicator.rank == 0:
        try:
            path = newest_restart(directory) if where == "auto" else where
        except InputError as error:
            faults = error.faults
    path, faults = communicator.broadcast((path, faults))
    if faults:
        raise InputError(faults)
    if path is None:
        return None
    origin = Restart(path)
    changes = origin.changes(scene)
    if communicator.rank == 0:
        lines = [f"going on from {path}: step {origin.step}, t = {origin.time:.6g} s", *changes]
        print("\n".join(lines), flush=True)
    return origin


def newest_restart(directory: Path) -> Path | None:
    """The newest complete restart file in a directory, None if it has none at all.

    Raises InputError when it has some and none is complete.
    """
    faults = []
    for _, path in reversed(files_of(directory)):
        try:
            return Restart(path).path
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(faults)
    return None


def _read_cells(dataset: h5py.Dataset, present: np.ndarray, blocks: FilledBlocks, _: Communicator) -> np.ndarray:
    """Own blocks; what lies beyond the last active cell stays as it is."""
    array = np.array(present)
    for block, origin, extent in zip(array, blocks.origin[:, ::-1], blocks.extent[:, ::-1], strict=True):
        cells = tuple(slice(0, n) for n in extent)
        block[(..., *cells)] = dataset[(..., *(slice(a, a + n) for a, n in zip(origin, extent, strict=True)))]
    return array


def _read_particles(dataset: h5py.Dataset, _: np.ndarray, __: FilledBlocks, communicator: Communicator) -> np.ndarray:
    start, stop = (len(dataset) * rank // communicator.size for rank in (communicator.rank, communicator.rank + 1))
    return dataset[start:stop]


def _read_sums(dataset: h5py.Dataset, present: np.ndarray, _: FilledBlocks, communicator: Communicator) -> np.ndarray:
    counts = communicator.allgather(len(present))
    start = sum(counts[: communicator.rank])
    if sum(counts) == len(dataset):
        return dataset[start : start + len(present)]
    array = np.zeros_like(present)
    if start == 0 and len(array):
        array[0] = dataset[()].sum(axis=0)
    return array


def _read_values(dataset: h5py.Dataset, *_: object) -> np.ndarray:
    return dataset[()]


READERS = {"cells": _read_cells, "particles": _read_particles, "sums": _read_sums, "values": _read_values}


# ---- the scene as text -----------------------------------------------------------------------------------------------


def describe(scene: Any) -> dict[str, str]:
    """All that a scene says, value by value, under keys such as "fluid.phases.air.eos.gamma"."""
    return dict(_flat(scene, ()))


def _flat(value: Any, key: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    if is_dataclass(value):
        if key:
            yield ".".join(key), type(value).__name__
        for field in fields(value):
            if field.compare:
                yield from _flat(getattr(value, field.name), (*key, field.name))
    elif isinstance(value, tuple) and any(is_dataclass(entry) or isinstance(entry, tuple) for entry in value):
        for number, entry in enumerate(value):
            yield from _flat(entry, (*key, getattr(entry, "name", str(number))))
    else:
        yield ".".join(key), repr(value)
