"""What a scene is known to have: narrows types for readers and for the type checker."""

from __future__ import annotations

from typing import TypeVar

T = TypeVar("T")


def present(part: T | None) -> T:
    """`part`, which is there. Raises AssertionError where it is not."""
    assert part is not None
    return part


def of_kind(kind: type[T], value: object) -> T:
    """`value`, which is of this kind. Raises AssertionError where it is not."""
    assert isinstance(value, kind)
    return value
