"""Files that have their names only once they are complete and on disk."""

from __future__ import annotations

import os
from pathlib import Path


def replace(temporary: Path, path: Path) -> None:
    """Give a complete file its final name so that it is found whole even after a crash of the machine."""
    sync(temporary)
    os.replace(temporary, path)
    sync(path.parent)


def write_text(path: Path, text: str) -> None:
    """Write a file that is found whole, or as it was before."""
    temporary = unfinished(path)
    temporary.write_text(text, newline="")
    replace(temporary, path)


def unfinished(path: Path) -> Path:
    """Where a file lies before it is complete."""
    return path.with_name(path.name + ".tmp")


def sync(path: Path) -> None:
    """Have what is known of a file or a folder on disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
