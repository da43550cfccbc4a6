"""Where compiled kernels are kept on disk, and how several processes share them."""

from __future__ import annotations

import fcntl
import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from distfsi.errors import InputError

PRIVATE = 0o700
NUMBAS = "__pycache__"  # where numba keeps machine code, beside the modules


def cache_directory() -> Path:
    """Where compiled modules live: $DISTFSI_CACHE, else the user's cache folder."""
    if (root := os.environ.get("DISTFSI_CACHE")) is not None:
        return Path(root)
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "distfsi"


def kernel_cache() -> Path:
    """The same folder, made if there is none. What lies in it is executed: raises InputError where others can write."""
    faults = cache_faults()
    if faults:
        raise InputError(faults)
    directory = cache_directory()
    for folder in (directory, directory / NUMBAS):
        folder.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
    return directory


def cache_faults() -> list[str]:
    """Why the cache folder is not trusted: it, or where numba keeps machine code in it, belongs to somebody else, or
    others can write into it."""
    faults = []
    for folder in (cache_directory(), cache_directory() / NUMBAS):
        try:
            found = folder.stat()
        except OSError:
            continue
        remedy = "its kernels would be executed; set DISTFSI_CACHE to a folder of your own"
        if found.st_uid not in (os.getuid(), 0):
            faults.append(f"the cache of kernels {folder} belongs to another user: {remedy}")
        elif found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            faults.append(f"the cache of kernels {folder} can be written by others: {remedy}, or chmod go-w {folder}")
    return faults


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that other processes see all of it or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(f".{os.getpid()}")
    unfinished.write_bytes(content)
    os.replace(unfinished, path)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock that belongs to the file `path`: one process of a machine at a time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path.with_suffix(".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def file_name(name: str, text: str) -> str:
    """The name under which what is compiled from a text is kept."""
    return f"{name}_{hashlib.sha256(text.encode()).hexdigest()[:20]}"
