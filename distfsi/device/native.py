"""Drivers in machine code: from a driver and a scene to a function that Python calls, by numba, kept on disk.

A driver's module in the cache folder is a few lines that call the LLVM IR of device/llvm_text.py (device/runtime.py).
It is named by its text, which tells all that the IR can depend on but the types of a call; numba keeps the machine code
for these beside it. A text that does not belong to its name is not executed but written anew.
"""

from __future__ import annotations

import ast
import hashlib
import re
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from distfsi.device.cache import file_name, kernel_cache, locked, write_whole
from distfsi.device.emit import Emission, Numbers, callees_first, given_numbers
from distfsi.device.fingerprint import fingerprint, texts_depend_on
from distfsi.device.llvm_text import module_of
from distfsi.device.llvm_types import Type
from distfsi.device.source import Bound, flat_values
from distfsi.errors import OutputError

OWN_NAME = "?"  # in the place of a module's name in the text that it is named by
MODULE_NAME = re.compile(r"(\w+)_[0-9a-f]{20}")


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
        known = kernel_cache() / f"{self.driver.__name__}_{key}.name"
        name = known.read_bytes().decode(errors="replace") if known.exists() else ""
        if _text_of(name) is None:
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
        parameters = ", ".join(argument.arg for argument in emission.functions[root][1].args.args)
        lines = [
            f"# {self.driver.__module__}, {digest.hexdigest()}",
            "from distfsi.device.runtime import body_of, driver",
            "",
            f"NUMBERS = {tuple(emission.numbers)!r}",
            f'written_ = body_of("{OWN_NAME}")',
            "",
            "",
            "@driver",
            f"def {self.driver.__name__}({parameters}):",
            f"    return written_(({parameters},))",
            "",
        ]
        name = file_name(self.driver.__name__, "\n".join(lines))
        return name, "\n".join(lines).replace(f'"{OWN_NAME}"', f'"{name}"')


def _path(name: str) -> Path:
    return kernel_cache() / f"{name}.py"


def _text_of(name: str) -> str | None:
    """The text of a module on disk; None without one, or when it is not the text that the name stands for."""
    named = MODULE_NAME.fullmatch(name)
    if named is None or not _path(name).exists():
        return None
    text = _path(name).read_bytes().decode(errors="replace")
    return text if file_name(named[1], text.replace(f'"{name}"', f'"{OWN_NAME}"')) == name else None


def _loaded(name: str) -> ModuleType:
    full_name = f"distfsi_kernels.{name}"
    if full_name not in sys.modules:
        text = _text_of(name)
        if text is None:
            raise OutputError(f"{_path(name)} is not the kernel that was written there")
        module = ModuleType(full_name)
        module.__file__ = str(_path(name))
        # The text that was compared, and not what Python may have compiled of another one.
        exec(compile(text, module.__file__, "exec"), module.__dict__)
        sys.modules[full_name] = module
    return sys.modules[full_name]
