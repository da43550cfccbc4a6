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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from distfsi.device.cache import cache_directory, file_name, locked, write_whole
from distfsi.device.emit import Emission, Numbers, callees_first, given_numbers
from distfsi.device.fingerprint import fingerprint, texts_depend_on
from distfsi.device.llvm_text import module_of
from distfsi.device.llvm_types import Type
from distfsi.device.source import Bound, flat_values
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
    def announced(self, listener: Callable[[int], None]) -> Iterator[None]:
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
        self,
        driver: Callable[..., Any],
        constants: Mapping[str, object],
        bindings: Mapping[str, Bound | type],
        real: str,
    ):
        self.driver, self.constants, self.bindings, self.real = driver, constants, bindings, real
        self._compiled = False
        self._lock = threading.Lock()

    def __call__(self, *arguments: Any) -> Any:
        """Raises NotInSubset, and TypeError for what no kernel takes."""
        if not self._compiled:
            self._compile(arguments)
        return self.dispatcher(*flat_values(arguments), *self.numbers())

    def _compile(self, arguments: Sequence[Any]) -> None:
        """For the types of these; one process of a machine at a time, so that others find it on disk."""
        with self._lock, locked(_path(self.name)):
            if not self._compiled:
                values = [*flat_values(arguments), *self.numbers()]
                self.dispatcher.compile(tuple(map(self.dispatcher.typeof_pyval, values)))
                self._compiled = True

    @cached_property
    def dispatcher(self) -> Any:
        """numba's."""
        return getattr(self.module, self.driver.__name__)

    @cached_property
    def numbers(self) -> Numbers:
        """What the scene measures, as the driver gets it."""
        values = {"given": given_numbers(self.constants, self.bindings)}
        return Numbers((eval(expression, values) for expression in self.module.NUMBERS), np.dtype(self.real).type)

    @cached_property
    def module(self) -> ModuleType:
        """The driver's module."""
        from distfsi.device import runtime

        runtime.WRITERS[self.name] = self.body
        return _loaded(self.name)

    @cached_property
    def name(self) -> str:
        """The name of the driver's module, which is on disk. It is found without folding where it was made before."""
        key = fingerprint(self.driver, self.constants, self.bindings, self.real)
        known = cache_directory() / f"{self.driver.__name__}_{key}.name"
        name = known.read_text() if known.exists() else ""
        if not (name and _path(name).exists()):
            name, text = self._module_text()
            write_whole(_path(name), text.encode())
            write_whole(known, name.encode())
        return name

    def body(self, types: tuple[Type, ...]) -> tuple[str, str, Type | None]:
        """For arguments of such types the name of the driver's body, the LLVM IR that defines it, and the type that it
        returns."""
        compilation.begin()
        module, driver = module_of(self.driver, self.constants, self.bindings, self.real, types)
        # The linker takes functions of one name for one function, also those that other processes have left on disk.
        name = f"{self.name}.{hashlib.sha256(repr(types).encode()).hexdigest()[:16]}"
        own = re.compile(rf"^define internal (.*)@{re.escape(driver.name)}\(", re.MULTILINE)
        return name, own.sub(rf"define linkonce_odr \1@{name}(", module.text()), driver.returns

    def _module_text(self) -> tuple[str, str]:
        """The name and the text of the driver's module."""
        emission = Emission(self.constants, self.bindings)
        root = emission.root(self.driver)
        functions = callees_first(emission.functions)
        digest = hashlib.sha256(texts_depend_on() + self.real.encode())
        for source, tree in functions:
            digest.update(f"{source.kind} {ast.unparse(tree)}\n".encode())
        name = file_name(self.driver.__name__, digest.hexdigest())
        parameters = ", ".join(argument.arg for argument in emission.functions[root][1].args.args)
        lines = [
            f"# {functions[-1][0].location}",
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
