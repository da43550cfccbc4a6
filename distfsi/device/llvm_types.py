"""Types and values of LLVM IR (device/llvm_text.py).

A value is a type and its *leaves*, operands of LLVM: one of a number; the address and the lengths of an array; those of
its parts, one after the other, of a tuple.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from distfsi.narrowing import of_kind

INTEGER, SHORT, BOOL = "i64", "i32", "i1"  # SHORT: counts in loops that must vectorise
REALS = {"float64": "double", "float32": "float"}
STORED = {"float64": "double", "float32": "float", "bool": "i8", "int64": "i64", "int32": "i32", "int8": "i8"}
STORED |= {"uint8": "i8"}  # how values of an array lie in memory


@dataclass(frozen=True)
class Array:
    """The type of a contiguous array: numpy's name of its values' type, and its axes."""

    element: str
    axes: int


Type: TypeAlias = "str | Array | tuple[Type, ...]"


class Value(NamedTuple):
    """A value in the text being written."""

    type: Type
    leaves: tuple[str, ...]


class Slot(NamedTuple):
    """Memory of a name that is assigned to more than once: an address per leaf."""

    type: Type
    addresses: tuple[str, ...]


def type_of(argument: object) -> Type:
    """The type of what a driver is called with. Raises TypeError for what no kernel takes."""
    if isinstance(argument, tuple):
        return tuple(map(type_of, argument))
    if isinstance(argument, np.ndarray) and argument.ndim:
        if argument.dtype.name not in STORED or not argument.flags.c_contiguous:
            raise TypeError(f"kernels take contiguous arrays of numbers, not of {argument.dtype}")
        return Array(argument.dtype.name, argument.ndim)
    dtype = np.asarray(argument).dtype
    kind = {"b": BOOL, "i": INTEGER, "u": INTEGER}.get(dtype.kind) or REALS.get(dtype.name)
    if kind is None:
        raise TypeError(f"kernels take no {type(argument).__name__}")
    return kind


def array_of(value: Value) -> Array:
    """The type of a value that is an array."""
    return of_kind(Array, value.type)


def leaf_types(kind: Type) -> list[str]:
    """The LLVM types of a type's leaves."""
    if isinstance(kind, Array):
        return ["ptr", *[INTEGER] * kind.axes]
    if isinstance(kind, tuple):
        return [leaf for part in kind for leaf in leaf_types(part)]
    return [kind]


def packed_type(kind: Type | None) -> str:
    """The LLVM type in which a function returns a type."""
    leaves = [] if kind is None else leaf_types(kind)
    return "void" if not leaves else leaves[0] if len(leaves) == 1 else f"{{{', '.join(leaves)}}}"


def parts_of(value: Value) -> list[Value]:
    """The parts of a tuple."""
    parts, start = [], 0
    for kind in of_kind(tuple, value.type):
        end = start + len(leaf_types(kind))
        parts.append(Value(kind, value.leaves[start:end]))
        start = end
    return parts


def joined(parts: Sequence[Value]) -> Value:
    """A tuple of parts."""
    return Value(tuple(part.type for part in parts), tuple(leaf for part in parts for leaf in part.leaves))


def number(value: float, real: str) -> str:
    """A literal of the real type: the bits of a double."""
    (bits,) = struct.unpack("<Q", struct.pack("<d", np.float32(value) if real == "float" else value))
    return f"0x{bits:016X}"


@dataclass
class Function:
    """A function that is written: its name, the type it returns, its text."""

    name: str
    returns: Type | None
    text: str
