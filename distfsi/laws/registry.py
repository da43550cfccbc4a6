"""All laws of a kind, found by their files."""

from __future__ import annotations

import pkgutil
from dataclasses import fields
from importlib import import_module
from typing import TypeVar

from distfsi.laws.law import Failure, Law, SolidEos, Strength

AnyLaw = TypeVar("AnyLaw", bound=Law)


def word_of(law: type[Law]) -> str:
    """The word that chooses a law in the input: the name of its file."""
    return law.__module__.rpartition(".")[2]


def laws_of(kind: type[AnyLaw]) -> tuple[type[AnyLaw], ...]:
    """The laws in the folder of a kind, those with the fewest fields first."""
    package = import_module(f"distfsi.{kind.folder.replace('/', '.')}")
    modules = [import_module(f"{package.__name__}.{each.name}") for each in pkgutil.iter_modules(package.__path__)]
    found = [law for module in modules for law in vars(module).values() if _is_law_of(law, kind, module.__name__)]
    return tuple(sorted(found, key=lambda law: (len(fields(law)), word_of(law))))


def _is_law_of(value: object, kind: type[Law], module: str) -> bool:
    return isinstance(value, type) and issubclass(value, kind) and value.__module__ == module


def column_units() -> dict[str, str]:
    """The units of what particles remember for any law of solids, but those of pure numbers."""
    laws = (law for kind in (SolidEos, Strength, Failure) for law in laws_of(kind))
    return {column.name: column.unit for law in laws for column in law.columns if column.unit != "1"}
