"""Which files of an output directory are the run's own: only these are replaced, moved or removed.

`manifest.jsonl` in the directory holds a line for each, which is on disk before the file is made:

    {"run": ID}         the first line; restart files tell the same
    {"file": NAME}      a file of the run, by its path in the directory
    {"removed": NAME}   the run has removed it
    {"aside": FOLDER}   a new run is moving all files to this folder; the manifest follows last

All of it is the work of rank 0.
"""

from __future__ import annotations

import json
import os
import re
import uuid
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from distfsi.errors import OutputError
from distfsi.output.files import sync, unfinished, write_text

NAME = "manifest.jsonl"
DEPTH = 3  # folders from a file up to the directory of its run: gauges/NAME/FILE
FIELD_FILES = r"(cells|particles)(-\d{6,}\.vtkhdf|\.vtkhdf\.series)"
RESERVED = re.compile(
    rf"((history|performance|balance)\.csv|run\.(json|lock)|status\.txt|summary\.png|{FIELD_FILES}|restart-\d{{8,}}\.h5"
    rf"|{re.escape(NAME)})(\.tmp)?"
)
FIELDS = re.compile(rf"{FIELD_FILES}(\.tmp)?")
EARLIER = re.compile(r"earlier-([1-9]\d*)")


@dataclass
class Manifest:
    """What the manifest in a directory says: which run, its files by name, and where they are being moved."""

    run: str = ""
    files: dict[str, None] = field(default_factory=dict)
    aside: str | None = None

    def lines(self) -> Iterator[dict[str, str]]:
        """What it says, in as few lines as it takes."""
        yield {"run": self.run}
        yield from ({"file": name} for name in self.files)


def read(directory: Path) -> Manifest | None:
    """The manifest of a directory; None without one. A line that was cut short is none."""
    try:
        lines = (directory / NAME).read_bytes().splitlines()
    except (FileNotFoundError, NotADirectoryError):
        return None
    manifest = Manifest()
    for line in lines:
        match _entry(line):
            case {"run": str(run)}:
                manifest.run = run
            case {"file": str(name)} if _inside(name):
                manifest.files[name] = None
            case {"removed": str(name)}:
                manifest.files.pop(name, None)
            case {"aside": str(folder)} if EARLIER.fullmatch(folder):
                manifest.aside = folder
    return manifest if manifest.run else None


def begin(directory: Path) -> str:
    """Lay down the manifest of a new run; the run's ID."""
    manifest = Manifest(uuid.uuid4().hex)
    _write(directory, manifest)
    return manifest.run


def resume(directory: Path) -> str:
    """Go on with the manifest of a run, or begin one; the run's ID."""
    manifest = read(directory)
    if manifest is None:
        return begin(directory)
    _write(directory, manifest)  # without lines that were cut short
    return manifest.run


def claim(path: Path) -> None:
    """Enter `path`, which is about to be made, into the manifest of its run, if it is in the directory of one.

    Raises OutputError where a file lies there that is not the run's.
    """
    known = _run_of(path)
    if known is None:
        return
    directory, name, manifest = known
    if name in manifest.files:
        return
    if os.path.lexists(path) or os.path.lexists(unfinished(path)):
        raise OutputError(f"{path} could not be written: a file that no run has made there is in the way")
    _append(directory, {"file": name})


def owns(path: Path) -> bool:
    """Whether `path` is a file of the run in whose directory it is."""
    known = _run_of(path)
    return known is not None and known[1] in known[2].files


def remove(path: Path) -> None:
    """Remove a file, finished or not; its run has it no longer."""
    for one in (path, unfinished(path)):
        one.unlink(missing_ok=True)
    known = _run_of(path)
    if known is not None and known[1] in known[2].files:
        _append(known[0], {"removed": known[1]})


def in_the_way(directory: Path, gauges: Collection[str]) -> list[Path]:
    """Files of a directory that are called like those that a run with such gauges makes, but that no run has made."""
    manifest = read(directory)
    # A run may have been killed between the lock and its manifest.
    own = {"run.lock", f"{NAME}.tmp"} | set(_with_unfinished([NAME, *manifest.files]) if manifest else ())

    def foreign(folder: Path, names: re.Pattern[str]) -> Iterator[Path]:
        for path in sorted(folder.iterdir()) if folder.is_dir() else ():
            if names.fullmatch(path.name) and path.relative_to(directory).as_posix() not in own:
                yield path

    table = re.compile(rf"({'|'.join(map(re.escape, gauges))})\.csv(\.tmp)?")
    found = [*foreign(directory, RESERVED), *foreign(directory / "gauges", table)]
    return found + [path for gauge in gauges for path in foreign(directory / "gauges" / gauge, FIELDS)]


def set_aside(directory: Path) -> Path | None:
    """Move all files of the run in a directory to a folder `earlier-N` in it, which is returned; None without any.

    It may be killed at any point, and goes on where it was when it is called again.
    """
    manifest = read(directory)
    if manifest is None:
        return None
    if manifest.aside is None and not size_of(directory):
        (directory / NAME).unlink()
        return None
    # The folder is settled before anything moves, the manifest is moved last.
    if manifest.aside is None:
        taken = [int(found[1]) for path in directory.iterdir() if (found := EARLIER.fullmatch(path.name))]
        manifest.aside = f"earlier-{1 + max(taken, default=0)}"
        _append(directory, {"aside": manifest.aside})
    earlier = directory / manifest.aside
    earlier.mkdir(exist_ok=True)
    folders = [directory, earlier]
    for name in _with_unfinished(manifest.files):
        source, target = directory / name, earlier / name
        if not os.path.lexists(source):
            continue
        if os.path.lexists(target):
            raise OutputError(f"{source} could not be moved: {target} is in the way")
        target.parent.mkdir(parents=True, exist_ok=True)
        source.rename(target)
        folders.append(target.parent)
    _remove_empty(directory, manifest)
    for folder in set(folders):
        sync(folder)
    (directory / NAME).rename(earlier / NAME)
    sync(directory)
    return earlier


def earlier_results(directory: Path) -> list[tuple[Path, int]]:
    """Folders with results that were set aside, in their order, and the bytes of their files."""
    found = [(int(name[1]), path) for path in directory.glob("earlier-*") if (name := EARLIER.fullmatch(path.name))]
    return [(path, size_of(path)) for _, path in sorted(found) if read(path) is not None]


def size_of(directory: Path) -> int:
    """Bytes of the files of the run in a directory."""
    manifest = read(directory)
    paths = [directory / name for name in _with_unfinished(manifest.files if manifest else ())]
    return sum(path.stat().st_size for path in paths if path.is_file())


def discard(directory: Path) -> bool:
    """Remove all files of the run in a directory, the manifest last, and the directory; whether nothing is left."""
    manifest = read(directory)
    if manifest is None:
        return False
    for name in _with_unfinished(manifest.files):
        (directory / name).unlink(missing_ok=True)
    _remove_empty(directory, manifest)
    (directory / NAME).unlink()
    with suppress(OSError):
        directory.rmdir()
    return not directory.exists()


def _with_unfinished(names: Collection[str]) -> Iterator[str]:
    for name in names:
        yield from (name, f"{name}.tmp")


def _remove_empty(directory: Path, manifest: Manifest) -> None:
    """Remove the folders in a directory that have lost all their files."""
    folders = {parent for name in manifest.files for parent in PurePosixPath(name).parents} - {PurePosixPath(".")}
    for folder in sorted(folders, key=lambda folder: -len(folder.parts)):
        with suppress(OSError):
            (directory / folder).rmdir()


def _run_of(path: Path) -> tuple[Path, str, Manifest] | None:
    """The directory of the run that a path is in, its name there, and the run's manifest; None in no such directory."""
    for directory in list(path.parents)[:DEPTH]:
        manifest = read(directory)
        if manifest is not None:
            return directory, path.relative_to(directory).as_posix(), manifest
    return None


def _entry(line: bytes) -> object:
    try:
        return json.loads(line)
    except ValueError:
        return None


def _inside(name: str) -> bool:
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts and "\0" not in name


def _write(directory: Path, manifest: Manifest) -> None:
    write_text(directory / NAME, "".join(json.dumps(line) + "\n" for line in manifest.lines()))


def _append(directory: Path, entry: dict[str, str]) -> None:
    with (directory / NAME).open("r+b") as file:
        whole = not file.seek(0, os.SEEK_END) or (file.seek(-1, os.SEEK_END), file.read(1))[1] == b"\n"
        file.write((b"" if whole else b"\n") + json.dumps(entry).encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())
