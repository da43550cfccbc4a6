"""The output directory of a run while the run goes on: it is there, and no other run writes into it."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import platform
import tempfile
import time as clock
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from distfsi.errors import InputError
from distfsi.output.interfaces import Communicator

LOCK = "run.lock"
WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # of file systems that have none


@contextmanager
def held(directory: Path, communicator: Communicator) -> Iterator[None]:
    """Make a directory if there is none, and keep other runs out of it within the block; an empty one is removed again.

    Collective. Raises InputError on all ranks when the directory cannot be used, or another run holds it.
    """
    holder = _Holder(directory)
    cause = communicator.broadcast(holder.take() if communicator.rank == 0 else "")
    if cause:
        raise InputError([f"output.directory: {directory} {cause}"])
    try:
        yield
    finally:
        if communicator.rank == 0:
            holder.release()


class _Holder:
    """Takes a directory: the lock lies in the kernel, which opens it when the process ends, however it does; the file
    `run.lock` only says who holds it."""

    def __init__(self, directory: Path):
        self._directory, self._path = directory, directory / LOCK
        self._made: list[Path] = []
        self._descriptor: int | None = None

    def take(self) -> str:
        """Why the directory cannot be taken; empty if it is."""
        try:
            self._made = [path for path in (self._directory, *self._directory.parents) if not path.exists()]
            self._directory.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=self._directory):
                pass
            cause = self._lock()
        except FileExistsError:
            cause = "cannot be written to: it is a file"
        except OSError as error:
            cause = f"cannot be written to: {error.strerror}"
        if cause:
            self._leave()
        return cause

    def release(self) -> None:
        """Let others in."""
        if self._descriptor is not None:
            self._path.unlink(missing_ok=True)
            os.close(self._descriptor)
        self._leave()

    def _leave(self) -> None:
        """Remove the directories that were made and are empty still."""
        for path in self._made:
            with suppress(OSError):
                path.rmdir()

    def _lock(self) -> str:
        """Lock the file; why that fails, in words."""
        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            owner = _owner(os.read(descriptor, 4096))
            if owner is None:
                os.close(descriptor)
                return f"has a file {LOCK} that no run has made; move it away or choose another directory"
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                is_held = False
            except BlockingIOError:
                is_held = True
            except OSError as error:
                if error.errno not in WITHOUT_LOCKS:
                    raise
                is_held = _lives(owner)
            if is_held:
                os.close(descriptor)
                return f"is in use by {_words(owner)}; this is {_words(_own())}"
            with suppress(FileNotFoundError):
                if os.stat(self._path).st_ino == os.fstat(descriptor).st_ino:
                    break
            os.close(descriptor)  # its owner has just removed it
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, json.dumps(_own()).encode(), 0)
        self._descriptor = descriptor
        return ""


def _own() -> dict[str, str | int]:
    """This process, as a lock names it."""
    started = psutil.Process().create_time()
    return {"host": platform.node(), "process": os.getpid(), "started": _moment(started)}


def _moment(seconds: float) -> str:
    return clock.strftime("%Y-%m-%d %H:%M:%S", clock.localtime(seconds))


def _owner(text: bytes) -> dict[str, str | int] | None:
    """Whom a lock names: nobody where it is empty, None where it is no lock."""
    try:
        owner = json.loads(text) if text else {}
    except ValueError:
        return None
    return owner if isinstance(owner, dict) and owner.keys() in (set(), {"host", "process", "started"}) else None


def _words(owner: dict[str, str | int]) -> str:
    if not owner:
        return "another run"
    return f"process {owner['process']} on {owner['host']}, started {owner['started']}"


def _lives(owner: dict[str, str | int]) -> bool:
    """Whether the process that a lock names still runs, as far as this host can tell."""
    if not owner or owner["host"] != platform.node():
        return False
    try:
        return _moment(psutil.Process(int(owner["process"])).create_time()) == owner["started"]
    except (psutil.Error, ValueError):
        return False
