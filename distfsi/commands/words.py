"""Words of the command line that several commands take, and their types."""

from __future__ import annotations

import argparse


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """`--set KEY=VALUE`, as often as one likes."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a key of the input for this time: --set domain.cells=[400,400]",
    )


def positive(text: str) -> int:
    """A whole number of at least one."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text}; must be >= 1")
    return number


def seconds(text: str) -> float:
    """A time in seconds, or with its own unit."""
    return _quantity(text, "s")


def kilograms(text: str) -> float:
    """A mass in kilograms, or with its own unit."""
    return _quantity(text, "kg")


def metres(text: str) -> float:
    """A length in metres, or with its own unit."""
    return _quantity(text, "m")


def plane(text: str) -> tuple[int, float]:
    """`AXIS=POSITION`: number of the axis, position in metres or with its own unit."""
    axis, equals, position = text.partition("=")
    if axis not in ("x", "y", "z") or not equals:
        raise argparse.ArgumentTypeError(f"{text}; expected x=..., y=... or z=...")
    return "xyz".index(axis), _quantity(position, "m")


def _quantity(text: str, unit: str) -> float:
    """A number in `unit`, or a text with its own unit."""
    from distfsi.scene.units import to_si

    try:
        return float(text)
    except ValueError:
        pass
    try:
        return to_si(text, unit)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"'{text}' {error}") from error
