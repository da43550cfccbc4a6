"""distfsi: shock waves and blasts that hit structures until they bend, crack and fly apart.

`distfsi.load`, `distfsi.run` and `distfsi.open` are those of distfsi/api.py, which is imported when it is asked for.
"""

from importlib import import_module
from typing import Any

__version__ = "0.2.0"

API = ("load", "run", "open", "InputError", "Diverged", "OutputError", "Stopped", "DistfsiError")


def __getattr__(name: str) -> Any:
    if name in API:
        return getattr(import_module("distfsi.api"), name)
    raise AttributeError(f"module 'distfsi' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *API]
