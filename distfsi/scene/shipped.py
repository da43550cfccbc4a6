"""The inputs that come with distfsi: where they lie, and what their first lines say about them.

The first comment of an input is one line that says what it is, the second how large it is and how long it takes.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import NamedTuple


class Example(NamedTuple):
    """A shipped input: its name, its file, what it is, and its size with a rough time."""

    name: str
    file: Path
    description: str
    size: str


def shipped_inputs() -> Path:
    """The folder of the shipped inputs: in the package where that is installed, beside it in a checkout."""
    package = Path(str(resources.files("distfsi")))
    inside = package / "inputs"
    return inside if inside.is_dir() else package.parent / "inputs"


def examples() -> list[Example]:
    """All shipped inputs, by name."""
    found = []
    for file in sorted(shipped_inputs().glob("*.toml")):
        comments = [line for line in file.read_text(encoding="utf-8").splitlines() if line.startswith("# ")]
        description, size = (comment.removeprefix("# ") for comment in comments[:2])
        found.append(Example(file.stem, file, description, size))
    return found
