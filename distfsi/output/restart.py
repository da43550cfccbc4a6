"""Restart files: the whole state of a run after a step, from which any number of ranks goes on to the same bits.

A file holds the snapshots of the run's parts as `/PART/KIND/NAME`. How an array is cut among the ranks depends on its
kind:

    cells      own blocks (local blocks, ..., bz, by, bx); in the file one array (..., nz, ny, nx), a chunk per block
    particles  own rows; in the file all rows, of which each rank reads an equal share
    sums       rows of contributions to a total; if blocks or tiles have changed, the first row gets the total
    values     the same on all ranks

A file has a checksum (output/checksum.py): before HDF5 sees it each of its bytes is known to be the one that was
written. Then it is compared with what this run would write: parts, kinds, names, types and shapes. All of this comes
before a run removes or overwrites anything.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from distfsi.errors import InputError
from distfsi.narrowing import present
from distfsi.output.checksum import damage
from distfsi.output.interfaces import Blocks, Communicator, FilledBlocks
from distfsi.output.manifest import owns, read, remove
from distfsi.output.scene_text import changes, describe
from distfsi.output.storage import Piece, Storage, create_dataset, on_root, write_complete

FORMAT = 3
KEPT = 2  # restart files in an output directory
NAME = re.compile(r"restart-(\d{8,})\.h5")
FARTHEST = 1e6  # from the origin, in sizes of the domain, that a particle may have flown
WATCHERS = ("gauge ", "peaks")  # how the names of parts begin that a run may have although the restart file has not

Snapshot = Mapping[str, Mapping[str, np.ndarray]]


# ---- writing ---------------------------------------------------------------------------------------------------------


class RestartWriter:
    """Writes `restart-STEP.h5` into a run's directory and keeps the last two.

    At a restart those of the run after step `until` are removed.
    """

    def __init__(
        self,
        directory: Path,
        scene: Any,
        blocks: Blocks,
        communicator: Communicator,
        storage: Storage,
        run: str,
        until: int | None = None,
    ):
        """Collective. `run`: which run it is (output/manifest.py). Raises OutputError on all ranks."""
        self._directory, self._scene, self._run = Path(directory), json.dumps(describe(scene)), run
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
            file.attrs.update(format=FORMAT, step=step, run=self._run)
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
        write_complete(self._storage, self._communicator, path, lay_down, pieces, with_checksum=True)
        on_root(self._communicator, path, lambda: _remove_oldest(self._directory))
        return path

    def _grid_dataset(self, file: h5py.File, name: str, array: np.ndarray) -> h5py.Dataset:
        shape = (*array.shape[1:-3], *self._blocks.grid.cells[::-1])
        return create_dataset(file, name, shape, array.dtype, array.shape[1:])


def files_of(directory: Path) -> list[tuple[int, Path]]:
    """Step and path of the restart files in a directory, in the order of their steps."""
    found = ((NAME.fullmatch(path.name), path) for path in directory.glob("restart-*.h5"))
    return sorted((int(name[1]), path) for name, path in found if name)


def _remove_after(directory: Path, until: int | None) -> None:
    """What is complete and what is not."""
    present = {path.with_name(path.name.removesuffix(".tmp")) for path in directory.glob("restart-*.h5*")}
    for path in sorted(present):
        name = NAME.fullmatch(path.name)
        if name and owns(path) and (until is None or int(name[1]) > until):
            remove(path)


def _remove_oldest(directory: Path) -> None:
    own = [path for _, path in files_of(directory) if owns(path)]
    for path in own[:-KEPT]:
        remove(path)


# ---- reading ---------------------------------------------------------------------------------------------------------


class Restart:
    """A restart file: its path, by which run it was written, after which step and at which time [s], and the scene as
    `describe` gives it."""

    def __init__(self, path: str | Path, communicator: Communicator | None = None):
        """Collective; None: this process alone. Raises InputError on all ranks when `path` is no complete restart file
        of this format."""
        self.path = Path(path)
        cause = damage(self.path, communicator)
        if not cause:
            found = _contents(self.path) if communicator is None or communicator.rank == 0 else None
            found = present(communicator.broadcast(found) if communicator else found)
            self.run, self.step, self.time, self.scene, cause = found
        if cause:
            raise InputError([f"{path}: is no complete restart file: {cause}"])

    def array(self, name: str) -> np.ndarray:
        """A whole array, by its name in the file."""
        with h5py.File(self.path) as file:
            return file[name][()]

    def changes(self, scene: Any) -> list[str]:
        """What has changed since the restart file was written and bears on the results, although it may.

        Raises InputError with one line per key that differs and may not.
        """
        return changes(self.scene, describe(scene), self.path)

    def restore(self, parts: Mapping[str, Any], blocks: FilledBlocks, communicator: Communicator) -> None:
        """Collective. Bring back the parts that were kept; gauges and peaks that are new stay as they are.

        Raises InputError on all ranks when a part kept other things then than it keeps now.
        """
        now = {name: part.snapshot() for name, part in parts.items()}
        shares = {}
        with h5py.File(self.path) as file:
            faults = list(_misfits(file, now, blocks, communicator))
            if faults:
                raise InputError([f"{self.path}: {fault}" for fault in faults])
            for part in filter(file.__contains__, now):
                shares[part] = {
                    kind: {
                        name: READERS[kind](dataset, now[part][kind].get(name), blocks, communicator)
                        for name, dataset in named.items()
                    }
                    for kind, named in file[part].items()
                }
        lost = [_are_lost(share.get("particles", {}).get("position"), blocks) for share in shares.values()]
        if any(map(any, communicator.allgather(lost))):
            raise InputError([f"{self.path}: holds particles that are nowhere near the domain"])
        for part, share in shares.items():
            parts[part].restore(share)


def find_restart(where: str | None, directory: Path, scene: Any, communicator: Communicator) -> Restart | None:
    """The restart file at `where`, or "auto": the newest complete one in `directory`, None if there is none.

    Collective; rank 0 tells which it is, which were passed over, and what of the `scene` has changed since. Raises
    InputError on all ranks when the file is unusable, or belongs to another scene or not to the results in `directory`.
    """
    if where is None:
        return None
    known = communicator.broadcast(read(directory) if communicator.rank == 0 else None)
    if known and known.aside:
        if where == "auto":
            return None
        text = f"{directory}: its results are being moved to {known.aside} for a new run; start that once more"
        raise InputError([f"{text}, without --restart"])
    origin, passed_over = _newest(directory, communicator) if where == "auto" else (Restart(where, communicator), [])
    if origin is None:
        return None
    changes = origin.changes(scene)
    if known and known.files and known.run != origin.run:
        text = f"{origin.path}: is not of the run whose results are in {directory}"
        raise InputError([f"{text}; choose another output.directory, or move them away"])
    if communicator.rank == 0:
        lines = [*passed_over, f"going on from {origin.path}: step {origin.step}, t = {origin.time:.6g} s", *changes]
        print("\n".join(lines), flush=True)
    return origin


def newest_restart(directory: Path) -> Path | None:
    """The newest complete restart file in a directory, None if it has none at all.

    Raises InputError when it has some and none is complete.
    """
    newest, _ = _newest(directory, None)
    return newest.path if newest else None


def _newest(directory: Path, communicator: Communicator | None) -> tuple[Restart | None, list[str]]:
    """Collective. The newest complete restart file, and what is wrong with those that are newer."""
    paths = [path for _, path in reversed(files_of(directory))]
    faults: list[str] = []
    for path in communicator.broadcast(paths) if communicator else paths:
        try:
            return Restart(path, communicator), faults
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(faults)
    return None, []


def _contents(path: Path) -> tuple[str, int, float, dict[str, str], str]:
    """Run, step, time [s] and scene of a restart file, and what is wrong with it."""
    try:
        with h5py.File(path) as file:
            found = int(file.attrs["format"])
            if found != FORMAT:
                return "", 0, 0.0, {}, f"it has format {found}, this version of distfsi reads format {FORMAT}"
            run, step = str(file.attrs["run"]), int(file.attrs["step"])
            scene = {str(key): str(value) for key, value in json.loads(file["scene"][()]).items()}
            values = {name: file[f"simulation/values/{name}"][()].item() for name in ("time", "steps")}
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError, OverflowError) as error:
        return "", 0, 0.0, {}, str(error)
    time, steps = float(values["time"]), int(values["steps"])
    if not (0.0 <= time < math.inf and steps == step >= 0):
        return "", 0, 0.0, {}, f"it is of step {step}, but holds the state at t = {time} s after {steps} steps"
    return run, step, time, scene, ""


def _misfits(
    file: h5py.File, present: Mapping[str, Snapshot], blocks: Blocks, communicator: Communicator
) -> Iterator[str]:
    """Collective. What a file holds otherwise than the parts of this run, of which these are snapshots."""
    cells = tuple(blocks.grid.cells[::-1])
    for part, snapshot in present.items():
        cut = {
            kind: {name: len(array) for name, array in snapshot.get(kind, {}).items()} for kind in ("particles", "sums")
        }
        every = communicator.allgather(cut)
        if part not in file:
            if not part.startswith(WATCHERS):
                yield f"holds no '{part}'"
            continue
        kinds = {kind: set(named) if isinstance(named, h5py.Group) else set() for kind, named in file[part].items()}
        if kinds != {kind: set(named) for kind, named in snapshot.items()}:
            yield f"holds another kind of '{part}' than this run has"
            continue
        for kind, named in snapshot.items():
            for name, array in named.items():
                array, found = np.asarray(array), file[part][kind][name]
                if not isinstance(found, h5py.Dataset):
                    yield f"{part}/{kind}/{name} holds no values"
                    continue
                rows = sum(counts[kind][name] for counts in every) if kind in cut else 0
                some = found.shape[0] if found.shape and min(found.shape[0], rows) > 0 else rows
                expected = {
                    "cells": (*array.shape[1:-3], *cells),
                    "particles": (rows, *array.shape[1:]),
                    "sums": (some, *array.shape[1:]),  # of blocks or tiles, of which there may be others now
                    "values": array.shape,
                }[kind]
                if found.dtype != array.dtype or found.shape != expected:
                    was, now = f"{found.dtype} {found.shape}", f"{array.dtype} {expected}"
                    yield f"{part}/{kind}/{name} is {was}, in this run {now}"


def _are_lost(positions: np.ndarray | None, blocks: Blocks) -> bool:
    """Whether some of the positions (n, D) [m] are where no particle of a run has ever come."""
    if positions is None:
        return False
    size = max(n * h for n, h in zip(blocks.grid.cells, blocks.grid.spacing, strict=True))
    return not (np.abs(positions) <= FARTHEST * (size + np.abs(blocks.grid.lower).max())).all()


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
