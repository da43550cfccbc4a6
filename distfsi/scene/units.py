"""Units at the door: "7.81 GPa", "1.225 kg/m3", "500 m/s" -> SI numbers, with the dimensions checked.

A dimension is the exponents of (metre, kilogram, second, kelvin). Temperatures are absolute, so only kelvin is known.
Factors are fractions, so that "20 us" is the very number 2e-5.
"""

from __future__ import annotations

import difflib
import math
import re
from fractions import Fraction

Dimension = tuple[int, ...]
Unit = tuple[Fraction, Dimension]

NUMBER = (0, 0, 0, 0)
LENGTH, MASS, TIME, TEMPERATURE = (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)
PRESSURE, ENERGY = (-1, 1, -2, 0), (2, 1, -2, 0)
PREFIXES = {"": 0, "n": -9, "u": -6, "µ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
PREFIXED: dict[str, tuple[str, Dimension]] = {
    "m": ("1", LENGTH),
    "g": ("1e-3", MASS),
    "s": ("1", TIME),
    "Hz": ("1", (0, 0, -1, 0)),
    "N": ("1", (1, 1, -2, 0)),
    "Pa": ("1", PRESSURE),
    "bar": ("1e5", PRESSURE),
    "J": ("1", ENERGY),
    "cal": ("4.184", ENERGY),
    "W": ("1", (2, 1, -3, 0)),
}
PLAIN: dict[str, tuple[str | float, Dimension]] = {
    "K": ("1", TEMPERATURE),
    "t": ("1e3", MASS),
    "lb": ("0.45359237", MASS),
    "in": ("0.0254", LENGTH),
    "ft": ("0.3048", LENGTH),
    "l": ("1e-3", (3, 0, 0, 0)),
    "cc": ("1e-6", (3, 0, 0, 0)),
    "min": ("60", TIME),
    "h": ("3600", TIME),
    "atm": ("101325", PRESSURE),
    "psi": ("6894.757293168361", PRESSURE),
    "rad": ("1", NUMBER),
    "deg": (math.pi / 180.0, NUMBER),
    "%": ("1e-2", NUMBER),
    "1": ("1", NUMBER),
}
UNITS: dict[str, Unit] = {
    prefix + name: (Fraction(scale) * Fraction(10) ** exponent, dimension)
    for name, (scale, dimension) in PREFIXED.items()
    for prefix, exponent in PREFIXES.items()
} | {name: (Fraction(scale), dimension) for name, (scale, dimension) in PLAIN.items()}

LONGEST = 400  # letters of a value

_VALUE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)\s*(.*?)\s*")
_TOKEN = re.compile(
    r"\s*(?:(?P<name>1(?!\d)|[A-Za-zµ%]+)(?:(?:\^|\*\*)?(?P<power>[-+]?\d)(?!\d))?|(?P<sign>[*·./()]))\s*"
)


def parse_unit(text: str) -> Unit:
    """Factor to SI and dimension of a product, quotient or power of units, for example "J/(kg K)" or "kg m-3".

    Raises ValueError naming what is not understood.
    """
    tokens, position = [], 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            raise ValueError(f"has a unit that is not understood at '{text[position:]}'")
        tokens.append(match)
        position = match.end()
    unit = _product(tokens) if tokens else UNITS["1"]
    if tokens:
        raise ValueError("has a unit with a ')' too many")
    return unit


def _product(tokens: list[re.Match[str]]) -> Unit:
    factor, dimension = _factor(tokens)
    while tokens and tokens[0]["sign"] != ")":
        sign = tokens.pop(0)["sign"] if tokens[0]["sign"] not in (None, "(") else "*"
        power = -1 if sign == "/" else 1
        scale, exponents = _factor(tokens)
        factor *= scale**power
        dimension = tuple(a + power * b for a, b in zip(dimension, exponents, strict=True))
    return factor, dimension


def _factor(tokens: list[re.Match[str]]) -> Unit:
    token = tokens.pop(0) if tokens else None
    if token and token["sign"] == "(":
        unit = _product(tokens)
        if not tokens:
            raise ValueError("has a unit that lacks a ')'")
        tokens.pop(0)
        return unit
    if token is None or token["sign"]:
        raise ValueError("has a unit in which a name is missing")
    power = int(token["power"] or 1)
    scale, exponents = _look_up(token["name"])
    return scale**power, tuple(power * a for a in exponents)


def _look_up(name: str) -> Unit:
    if name in UNITS:
        return UNITS[name]
    if name in ("C", "F", "degC", "degF"):
        raise ValueError(f"has the unknown unit '{name}'; temperatures are given in K")
    near = difflib.get_close_matches(name, UNITS, n=1)
    raise ValueError(f"has the unknown unit '{name}'" + (f"; did you mean '{near[0]}'?" if near else ""))


def to_si(value: object, unit: str) -> float:
    """`value` in SI: a number is in `unit` (an SI unit, or "1" for a pure number), a string carries its own unit.

    Raises ValueError when the value is no finite number or has other dimensions than `unit`.
    """
    try:
        number = _text_to_si(value, unit) if isinstance(value, str) else _number_to_float(value, unit)
    except OverflowError:
        raise ValueError("is too large") from None
    if not math.isfinite(number):
        raise ValueError("is not finite")
    return number


def length_factor(unit: str) -> Fraction:
    """Metres in a `unit`. Raises ValueError when it is none of length."""
    factor, dimension = parse_unit(unit)
    if dimension != LENGTH:
        raise ValueError(f"has the unit '{unit}', needs one of length")
    return factor


def _number_to_float(value: object, unit: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("is no number; expected one" + ("" if unit == "1" else f' or a text such as "2.5 {unit}"'))
    return float(value)


def _text_to_si(text: str, unit: str) -> float:
    example = "a number" if unit == "1" else f'a number or a text such as "2.5 {unit}"'
    match = _VALUE.fullmatch(text) if len(text) <= LONGEST else None
    if match is None:
        raise ValueError(f"is not understood; expected {example}")
    number, given = match.groups()
    factor, dimension = parse_unit(given)
    if dimension != parse_unit(unit)[1]:
        has, needs = given or "no units", "a pure number" if unit == "1" else unit
        raise ValueError(f"has {'units ' if given else ''}{has}, needs {needs}")
    return float(Fraction(number) * factor)
