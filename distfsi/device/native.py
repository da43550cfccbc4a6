"""Drivers in machine code: from a driver and a scene to a function that Python calls, by numba, kept on disk.

A driver's module in the cache folder is a few lines that call the LLVM IR of device/llvm_text.py (device/runtime.py).
It is named by all that the IR can depend on but the types of a call; numba keeps the machine code for these beside it.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import re
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from distfsi.device.cache import cache_directory, file_name, locked, write_whole
from distfsi.device.emit import Emission, callees_first
from distfsi.device.fingerprint import fingerprint, texts_depend_on
from distfsi.device.fold import Bound, flat_values, given_floats
from distfsi.device.llvm_text import module_of
from distfsi.device.llvm_types import Type
from distfsi.narrowing import present


@dataclass
class Compilation:
    """What this process has compiled: `made` drivers."""

    made: int = 0
    _listener: Callable[[int], None] | None = None

    def begin(self) -> None:
        """A driver is about to be compiled."""
        self.made += 1
        if self._listener:
            self._listener(self.made)

    @contextmanager
    def told(self, listener: Callable[[int], None]) -> Iterator[None]:
        """Meanwhile `listener` gets the number of each driver that is about to be compiled."""
        self._listener = listener
        try:
            yield
        finally:
            self._listener = None


compilation = Compilation()


class Native:
    """A driver, specialised for a scene, for Python to call. It gets the scene's numbers behind its arguments; numba
    compiles it for each list of types that it is called with."""

    def __init__(
        self, driver: Callable[..., Any], constants: Mapping[str, object], bindings: Mapping[str, Bound], real: str
    ):
        self.driver, self.constants, self.bindings, self.real = driver, constants, bindings, real
        self._numbers: tuple[np.floating, ...] = ()
        self._call: Callable[..., Any] = self._first_call
        self._lock = threading.Lock()

    def __call__(self, *arguments: Any) -> Any:
        """Raises NotInSubset, and TypeError for what no kernel takes."""
        return self._call(*flat_values(arguments), *self._numbers)

    def _first_call(self, *arguments: Any) -> Any:
        """One process of a machine at a time compiles a driver: others then find it on disk."""
        with self._lock:
            if self._call == self._first_call:
                module = self.module
                self._numbers = self.numbers
                with locked(_path(module.__name__.rpartition(".")[2])):
                    result = self.dispatcher(*arguments, *self._numbers)
                self._call = self.dispatcher
                return result
        return self.dispatcher(*arguments, *self._numbers)

    @property
    def dispatcher(self) -> Any:
        """numba's."""
        return getattr(self.module, self.driver.__name__)

    @property
    def numbers(self) -> tuple[np.floating, ...]:
        """What the scene measures, as the driver gets it."""
        values, real = {"given": given_floats(self.constants, self.bindings)}, np.dtype(self.real).type
        return tuple(real(eval(expression, values)) for expression in self.module.NUMBERS)

    @cached_property
    def module(self) -> ModuleType:
        """The driver's module. Its text is found without folding where it was made before."""
        from distfsi.device import runtime

        key = fingerprint(self.driver, self.constants, self.bindings, self.real)
        known = cache_directory() / f"{self.driver.__name__}_{key}.name"
        name = known.read_text() if known.exists() else ""
        if not (name and _path(name).exists()):
            name, text = self._module_text()
            write_whole(_path(name), text.encode())
            write_whole(known, name.encode())
        runtime.WRITERS[name] = self.body
        return _loaded(name)

    def body(self, types: tuple[Type, ...]) -> tuple[str, str, Type | None]:
        """For arguments of such types the name of the driver's body, the LLVM IR that defines it, and the type that it
        returns."""
        compilation.begin()
        module, driver = module_of(self.driver, self.constants, self.bindings, self.real, types)
        name = f"{self.module.__name__}.{compilation.made}"  # no other in this process has it
        own = re.compile(rf"^define internal (.*)@{re.escape(driver.name)}\(", re.MULTILINE)
        return name, own.sub(rf"define linkonce_odr \1@{name}(", module.text()), driver.returns

    def _module_text(self) -> tuple[str, str]:
        """The name and the text of the driver's module."""
        emission = Emission(self.constants, self.bindings)
        root = emission.root(self.driver)
        functions = callees_first(emission.functions)
        told = hashlib.sha256(texts_depend_on() + self.real.encode())
        for source, tree in functions:
            told.update(f"{source.kind} {ast.unparse(tree)}\n".encode())
        name = file_name(self.driver.__name__, told.hexdigest())
        parameters = ", ".join(argument.arg for argument in emission.functions[root][1].args.args)
        lines = [
            f"# {functions[-1][0].place}",
            "from distfsi.device.runtime import body_of, driver",
            "",
            f"NUMBERS = {tuple(emission.numbers)!r}",
            f'written_ = body_of("{name}")',
            "",
            "",
            "@driver",
            f"def {self.driver.__name__}({parameters}):",
            f"    return written_(({parameters},))",
            "",
        ]
        return name, "\n".join(lines)


def _path(name: str) -> Path:
    return cache_directory() / f"{name}.py"


def _loaded(name: str) -> ModuleType:
    full_name = f"distfsi_kernels.{name}"
    if full_name in sys.modules:
        return sys.modules[full_name]
    loader = SourceFileLoader(full_name, str(_path(name)))
    module = importlib.util.module_from_spec(present(importlib.util.spec_from_loader(full_name, loader)))
    sys.modules[full_name] = module
    loader.exec_module(module)
    return module
