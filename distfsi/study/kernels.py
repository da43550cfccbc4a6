"""What the compiler makes of each kernel for a GPU: registers, spills, instructions. `python -m distfsi study kernels`.

It needs NVRTC but no GPU. It writes gpu-kernels.csv: every kernel of the standard scenes for each architecture.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device import nvrtc
from distfsi.device.cpu import Team
from distfsi.device.gpu import Gpu, Queue
from distfsi.device.kernel import Kernel, Launch
from distfsi.mesh.communicator import Communicator
from distfsi.scene.description import Scene
from distfsi.simulation import Simulation
from distfsi.study import works

ARCHITECTURES = ("sm_80", "sm_89", "sm_90", "sm_120")
CELLS = {1: (256,), 2: (32, 32), 3: (16, 16, 32)}
FLUIDS = {
    "one gas": ((works.AIR,), (1.0, 1e6), (1.0, 1e5)),
    "two gases": ((works.HELIUM, works.AIR), (1.0, 1e6), (1.0, 1e5)),
    "TNT and air": ((works.TNT, works.AIR), works.BURNT_TNT, works.AMBIENT_AIR),
}
BANDWIDTH = {"A100": 2.04e12, "H100": 3.35e12, "RTX 4090": 1.01e12}  # B/s, of the data sheets


class Survey:
    """A runtime that compiles nothing and runs nothing, but keeps what it is asked for."""

    def __init__(self):
        self.kept: list[tuple[Kernel, list[Any]]] = []

    def compile(self, kernel: Kernel, arguments: Sequence[Any]) -> None:
        self.kept.append((kernel, list(arguments)))

    def launch(self, compiled: Any, launch: Launch, count: int, arguments: Sequence[Any], queue: Queue) -> None:
        pass

    def empty(self, shape: tuple[int, ...], dtype: np.dtype) -> Any:
        return _Memory(shape, dtype)

    def zeros(self, shape: tuple[int, ...], dtype: np.dtype) -> Any:
        return _Memory(shape, dtype)

    def pinned(self, count: int, dtype: np.dtype) -> np.ndarray:
        return np.empty(count, dtype)

    def upload(self, there: Any, host: np.ndarray, queue: Queue) -> None:
        pass

    def download(self, host: np.ndarray, there: Any, queue: Queue) -> None:
        host[...] = 0

    def order(self, first: Queue, then: Queue) -> None:
        pass

    def synchronise(self, queue: Queue) -> None:
        pass


@dataclass(frozen=True)
class _Memory:
    """An array without values."""

    shape: tuple[int, ...]
    dtype: np.dtype

    @property
    def ndim(self) -> int:
        return len(self.shape)

    def reshape(self, count: int) -> _Memory:
        return _Memory((count,), self.dtype)


class Listening(Team):
    """One thread that runs kernels and keeps what they are called with."""

    def __init__(self):
        super().__init__(1)
        self.kept: dict[tuple, tuple[Kernel, list[Any]]] = {}

    def build(self, drivers, constants, bindings=None, real="float64") -> SimpleNamespace:
        drivers = list(drivers)
        compiled = Team.build(drivers, constants, bindings, real)

        def listening(kernel: Kernel):
            run = getattr(compiled, kernel.name)

            def call(*arguments):
                if len(arguments) > 2 and isinstance(arguments[0], int):
                    self.kept.setdefault((kernel.name, kernel.signature(arguments[2:])), (kernel, arguments[2:]))
                return run(*arguments)

            return call

        return SimpleNamespace(**{d.__name__: listening(Kernel(d, constants, bindings or {}, real)) for d in drivers})


def fluid_kernels(scene: Scene, communicator: Communicator) -> list[tuple[Kernel, list[Any]]]:
    """The kernels of a fluid, and arguments like those they get."""
    survey = Survey()
    fluid = Simulation.of(scene, communicator, device=Gpu(survey)).fluid
    fluid.advance_stage(fluid.stages[0], 1.0)
    fluid.fastest_signal()
    return survey.kept


def coupled_kernels(scene: Scene, communicator: Communicator) -> list[tuple[Kernel, list[Any]]]:
    """The kernels of solid and coupling, and arguments that they got in two steps."""
    team = Listening()
    simulation = Simulation.of(scene, communicator, device=team)
    for _ in range(2):
        simulation.step()
    ours = ("advance_tiles", "fastest_signals", "copy_regions")
    return [(kernel, arguments) for kernel, arguments in team.kept.values() if kernel.name not in ours]


def rows(name: str, dimensions: int, kernels: list[tuple[Kernel, list[Any]]]) -> Iterator[dict[str, Any]]:
    """What the compiler says of each kernel for each architecture. Raises CompileError."""
    for kernel, arguments in kernels:
        launch = kernel.launch(arguments)
        for architecture in ARCHITECTURES:
            code, log = nvrtc.compile_text(kernel.text(arguments), architecture)
            yield {
                "scene": name,
                "dimensions": dimensions,
                "kernel": kernel.name,
                "real": kernel.real,
                "architecture": architecture,
                "threads": launch.threads,
                "shared memory [B]": launch.shared,
                **nvrtc.usage(log),
                **nvrtc.instructions(code),
            }


def bytes_per_cell(dimensions: int, variables: int, real: str) -> float:
    """Bytes that a stage moves per cell if a tile reads and writes everything once: U with ghosts, U_n, U_new."""
    gpu = Gpu(Survey())
    tile = np.array(gpu.tile_cells((4096,) * dimensions))
    ghosts = float(((tile + 4) / tile).prod())
    return variables * np.dtype(real).itemsize * (ghosts + 2.0)


def survey(communicator: Communicator, dimensions: Sequence[int] = (1, 2, 3)) -> Iterator[dict[str, Any]]:
    """All rows."""
    for D in dimensions:
        for name, materials in FLUIDS.items():
            for real in ("float64", "float32"):
                yield from rows(name, D, fluid_kernels(works.gases(CELLS[D], *materials, real), communicator))
        yield from rows("TNT, air and copper", D, coupled_kernels(works.blast_on_copper(8, D), communicator))


def main(communicator: Communicator, overrides: list[str]) -> None:
    """Write gpu-kernels.csv and print the stage's part of it."""
    path = Path("gpu-kernels.csv")
    with open(path, "w", newline="") as file:
        writer = None
        for row in survey(communicator):
            writer = writer or _begun(file, row)
            writer.writerow(row)
            if row["kernel"] == "advance_tiles":
                print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    print(f"{path}, by NVRTC {nvrtc.version()}")


def _begun(file: Any, row: dict[str, Any]) -> csv.DictWriter:
    writer = csv.DictWriter(file, list(row))
    writer.writeheader()
    return writer
