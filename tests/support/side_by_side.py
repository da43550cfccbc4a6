"""Every call of a kernel made twice: on the CPU, and by its CUDA C on the host. All arrays must come out with the same
bits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from distfsi.device import cpu
from distfsi.device.host import HostKernel
from distfsi.device.kernel import Kernel
from distfsi.device.source import flat_values


class SideBySide:
    """In the place of `Cpu.build` while it is installed.

    calls: how often each kernel was compared; unlike: kernels and arguments that differed
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, but_for: Sequence[str] = ()):
        """Kernels `but_for` those named are run on the CPU alone."""
        self.calls, self.unlike, self.but_for = Counter(), Counter(), but_for
        self._build = cpu.build
        monkeypatch.setattr(cpu.Cpu, "build", self.build)

    def build(self, drivers, constants, bindings=None, real="float64") -> SimpleNamespace:
        kernels = [Kernel(driver, constants, bindings or {}, real) for driver in drivers]
        compiled = self._build([kernel.driver for kernel in kernels], constants, bindings, real)
        pairs = {kernel.name: getattr(compiled, kernel.name) for kernel in kernels}
        others = {k.name: self._both(HostKernel(k), pairs[k.name]) for k in kernels if k.name not in self.but_for}
        return SimpleNamespace(**pairs | others)

    def _both(self, host: HostKernel, compiled: Callable) -> Callable:
        def call(begin: int, end: int, *arguments) -> None:
            name = host.kernel.name
            arguments = list(flat_values(arguments))
            copies = copies_of(arguments)
            compiled(begin, end, *arguments)
            host(end - begin, host.kernel.given(copies), reverse=self.calls[name] % 2 == 1)
            self.calls[name] += 1
            for place, (mine, other) in enumerate(zip(arguments, copies, strict=True)):
                if isinstance(mine, np.ndarray) and mine.tobytes() != other.tobytes():
                    self.unlike[name, place] += 1

        return call


def copies_of(arguments: Sequence[object]) -> list[object]:
    """Copies of the arrays among the arguments; two that are one array stay one."""
    copies: dict[tuple, np.ndarray] = {}
    out = []
    for argument in arguments:
        if isinstance(argument, np.ndarray):
            identity = argument.ctypes.data, argument.shape, argument.dtype
            out.append(copies.setdefault(identity, argument.copy()))
        else:
            out.append(argument)
    return out
