"""Where compiled kernels are kept on disk, and how several processes share them."""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def cache_directory() -> Path:
    """Where compiled modules live: $DISTFSI_CACHE, else the user's cache folder."""
    if (root := os.environ.get("DISTFSI_CACHE")) is not None:
        return Path(root)
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "distfsi"


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
