"""What the compiler makes of each kernel for a GPU: registers, spills, instructions. `distfsi study kernels`.

It needs NVRTC and a C++ compiler, but no GPU. It writes gpu-kernels.csv: every kernel of all inputs, in float64 and
float32, and of standard fluids, for each architecture; a text that several of them need stands there once.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np

from distfsi.device import nvrtc
from distfsi.device.cpu import Cpu
from distfsi.device.gpu import Gpu, Queue
from distfsi.device.host import HostArray, HostKernel, HostRuntime
from distfsi.device.kernel import Kernel, Launch
from distfsi.errors import InputError
from distfsi.fluid.kernels.stage import advance_tiles
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.kernels.regions import pack_cells, unpack_cells
from distfsi.mesh.kernels.rows import pack_rows
from distfsi.resources import works
from distfsi.scene import load
from distfsi.scene.description import Scene
from distfsi.scene.shipped import shipped_inputs
from distfsi.simulation import Simulation
from distfsi.step import TimeStep, find_forces, make_step

REALS = ("float64", "float32")
INPUTS = shipped_inputs()
DIRECTORY = Path("out/study_kernels")
TIME_STEP = 1e-9
STEPS_OF_DEBRIS = 8
CELLS = {1: (256,), 2: (32, 32), 3: (16, 16, 32)}
FLUIDS = {
    "one gas": ((works.AIR,), (1.0, 1e6), (1.0, 1e5)),
    "two gases": ((works.HELIUM, works.AIR), (1.0, 1e6), (1.0, 1e5)),
    "TNT and air": ((works.TNT, works.AIR), works.BURNT_TNT, works.AMBIENT_AIR),
}
BANDWIDTH = {"sm_80": 2.04e12, "sm_89": 1.01e12, "sm_90": 3.35e12, "sm_120": 1.79e12}
"""[B/s], of the data sheets of A100, RTX 4090, H100, RTX 5090."""
ARCHITECTURES = tuple(BANDWIDTH)


class Survey(HostRuntime):
    """A runtime that only tells which particles have moved: memory holds zeros, or what the host put there."""

    RUNS = ("find_moved",)

    def __init__(self):
        super().__init__(late=False)

    def compile(self, kernel: Kernel, arguments: Sequence[Any]) -> HostKernel | None:
        return super().compile(kernel, arguments) if kernel.name in self.RUNS else None

    def launch(self, compiled: Any, launch: Launch, count: int, arguments: Sequence[Any], queue: Queue) -> None:
        if compiled is not None:
            super().launch(compiled, launch, count, arguments, queue)

    def empty(self, shape: tuple[int, ...], dtype: np.dtype) -> HostArray:
        return self.zeros(shape, dtype)


Call = tuple[Kernel, Sequence[Any]]
Calls = dict[tuple, Call]  # by driver and signature: a kernel, and arguments that it is called with


def key_of(kernel: Kernel, arguments: Sequence[Any]) -> tuple:
    """What tells calls of one scene apart."""
    return kernel.driver, kernel.signature(kernel.given(arguments))


class Inventory(Gpu):
    """A GPU that keeps the kernels that are built for it, and what they are called with."""

    def __init__(self):
        super().__init__(Survey())
        self.built: list[Kernel] = []
        self.calls: Calls = {}

    def build(self, *given: Any) -> SimpleNamespace:
        kernels = super().build(*given)
        self.built += vars(kernels).values()
        return kernels

    def run(self, kernel: Kernel, count: int, *arguments: Any) -> None:
        self.calls.setdefault(key_of(kernel, arguments), (kernel, arguments))
        super().run(kernel, count, *arguments)

    run_few = run


class Listening(Cpu):
    """One thread that runs kernels and keeps what they are called with."""

    def __init__(self):
        super().__init__(1)
        self.calls: Calls = {}

    def build(self, drivers, constants, bindings=None, real="float64") -> SimpleNamespace:
        drivers = list(drivers)
        compiled = Cpu.build(drivers, constants, bindings, real)

        def listening(kernel: Kernel):
            run = getattr(compiled, kernel.name)

            def call(*arguments):
                if len(arguments) > 2 and isinstance(arguments[0], int):
                    self.calls.setdefault(key_of(kernel, arguments[2:]), (kernel, arguments[2:]))
                return run(*arguments)

            return call

        return SimpleNamespace(**{d.__name__: listening(Kernel(d, constants, bindings or {}, real)) for d in drivers})


def inventory(scene: Scene, communicator: Communicator) -> Inventory:
    """The kernels that a scene builds, and those that a step of it calls, whatever comes out of them."""
    fluid = replace(scene.fluid, map=None) if scene.fluid else None  # the run that is mapped is not there
    with TemporaryDirectory() as directory:  # gauges write what they see
        return _inventory(replace(scene, fluid=fluid, output=replace(scene.output, directory=directory)), communicator)


def _inventory(scene: Scene, communicator: Communicator) -> Inventory:
    gpu = Inventory()
    simulation = Simulation.of(scene, communicator, device=gpu)
    fluid, solid, coupling = simulation.fluid, simulation.solid, simulation.coupling

    with np.errstate(all="ignore"):
        find_forces(solid, coupling, simulation.timers)
        if fluid:
            fluid.fastest_signal()
        for part in (solid, coupling):
            if part:
                part.time_step()
        make_step(fluid, solid, coupling, None, TimeStep(TIME_STEP, sub_steps=2), simulation.timers)
        if coupling and scene.coupling.scheme == "cut_cells":
            D = scene.domain.dimensions
            coupling.pressure(TIME_STEP)
            geometry, state = coupling.geometry, fluid.device_state
            coupling.absorb(geometry.lists, geometry.walls)
            coupling.trapped()
            coupling.drag(geometry, gpu.empty(1, np.int64), state, gpu.empty((solid.count, D)), TIME_STEP)
            coupling.wall.add_spheres(
                gpu.empty(1, np.int64), gpu.empty((1, D)), gpu.empty((1, 2 + D)), gpu.empty(1, np.int64)
            )
        simulation.watch()
    return gpu


def calls_of_debris(communicator: Communicator) -> Calls:
    """What particles call only where they fail, or near other ranks."""
    device = Listening()
    simulation = Simulation.of(works.bursting_ball(), communicator, device=device)
    for _ in range(STEPS_OF_DEBRIS):
        simulation.step()
    rows, reals = np.zeros(1, np.int64), [np.zeros(1, real) for real in REALS]
    packed = [(pack_rows, (rows, 1, reals[0], 1, 1, reals[0]))]
    packed += [(pack_cells, (rows, rows, rows, 1, values, 1, 1, values)) for values in reals]
    packed += [(unpack_cells, (rows, 1, 1, values, 1, 1, values)) for values in reals]
    kernels = [(Kernel(driver, {}, {}, "float64"), arguments) for driver, arguments in packed]
    return device.calls | {key_of(*call): call for call in kernels}


@dataclass
class Text:
    """The CUDA C of a kernel, arguments that it is for, and the scenes that need it."""

    kernel: Kernel
    arguments: Sequence[Any]
    dimensions: int
    scenes: dict[str, None]  # in order


def texts(scenes: Mapping[str, Scene], communicator: Communicator) -> dict[str, Text]:
    """Each text of all kernels of all scenes, once, in the order of scenes; without kernels that no scene calls."""
    debris = calls_of_debris(communicator) if any(scene.solid for scene in scenes.values()) else {}
    found = [(name, scene, inventory(scene, communicator)) for name, scene in scenes.items()]
    known: dict[tuple, Calls] = {}
    for _, scene, gpu in found:
        for key, call in {**debris, **gpu.calls}.items():
            known.setdefault((precision(scene), *takes(call[0])), {})[key] = call
    texts: dict[str, Text] = {}
    written: dict[tuple, str] = {}  # by all that a text depends on
    for name, scene, gpu in found:
        called = {id(kernel) for kernel, _ in gpu.calls.values()}
        others = [kernel for kernel in gpu.built if id(kernel) not in called]
        calls = [*gpu.calls.values()]
        shown = [(kernel, known.get((precision(scene), *takes(kernel)), {})) for kernel in others]
        calls += [(kernel, arguments) for kernel, ones in shown for _, arguments in ones.values()]
        for kernel, arguments in calls:
            given = kernel.given(arguments)
            key = repr(kernel), kernel.signature(given)
            text = written.get(key) or written.setdefault(key, kernel.text(given))
            of = texts.setdefault(text, Text(kernel, given, scene.domain.dimensions, {}))
            of.scenes[name] = None
    return texts


def takes(kernel: Kernel) -> tuple[Callable, frozenset]:
    """What says which arguments a kernel takes: its driver, and the fields of the records that a scene gives it."""
    records = {(name, given) for name, given in kernel.bindings.items() if isinstance(given, type)}
    return kernel.driver, frozenset((name, getattr(record, "_fields", record)) for name, record in records)


def precision(scene: Scene) -> str:
    """The real type of the scene's fluid; without one that of the solid."""
    return scene.fluid.precision if scene.fluid else "float64"


def shipped(inputs: Path) -> dict[str, Scene]:
    """All scenes of a folder with their stages, those with a fluid in both precisions."""
    scenes = {}
    for path in sorted(inputs.glob("*.toml")):
        for real in REALS if load(path).fluid else ("",):
            name = " ".join([path.stem, *([real] if real == "float32" else [])])
            scenes[name] = scene = load(path, (f"fluid.precision={real}",) if real else ())
            scenes |= {f"{name} stage {number}": stage for number, stage in enumerate(scene.stages, 1)}
    return scenes


def standard() -> dict[str, Scene]:
    """Fluids in one, two and three dimensions."""
    return {
        f"{name} {D}D" + (" float32" if real == "float32" else ""): works.gases(CELLS[D], *materials, real)
        for D in CELLS
        for name, materials in FLUIDS.items()
        for real in REALS
    }


def bytes_per_cell(constants: Mapping[str, Any], real: str) -> float:
    """Bytes that a stage moves per cell if a tile reads and writes everything once: U with ghosts, U_n, U_new."""
    tile = np.array(Inventory().tile_cells((4096,) * constants["DIMENSIONS"]))
    with_ghosts = float(((tile + 2 * constants["GHOSTS"]) / tile).prod())
    return constants["VARIABLES"] * np.dtype(real).itemsize * (with_ghosts + 2.0)


def estimate(of: Text, architecture: str) -> dict[str, float | str]:
    """Bytes of a cell in a stage, and an upper bound of the speed that follows from them: no measurement."""
    names = ("bytes per cell", "estimate: at most so many cells per second")
    if of.kernel.driver is not advance_tiles:
        return dict.fromkeys(names, "")
    size = bytes_per_cell(of.kernel.constants, of.kernel.real)
    return dict(zip(names, (round(size, 1), f"{BANDWIDTH[architecture] / size:.2g}"), strict=True))


def rows(text: str, of: Text, architectures: Sequence[str] = ARCHITECTURES) -> Iterator[dict[str, Any]]:
    """What the compiler says of a text for each architecture. Raises CompileError."""
    launch = of.kernel.launch(of.arguments)
    for architecture in architectures:
        code, log = nvrtc.compile_text(text, architecture)
        yield {
            "scenes": "; ".join(of.scenes),
            "dimensions": of.dimensions,
            "kernel": of.kernel.name,
            "real": of.kernel.real,
            "architecture": architecture,
            "threads": launch.threads,
            "shared memory [B]": launch.shared,
            **nvrtc.usage(log),
            **nvrtc.instructions(code),
            **estimate(of, architecture),
            "compiler": f"NVRTC {nvrtc.version()}",
        }


def quick(communicator: Communicator, overrides: Sequence[str]) -> None:
    """The kernels of Sod's tube for one architecture."""
    _study(communicator, overrides, {"sod": load(INPUTS / "sod.toml")}, ("sm_90",))


def main(communicator: Communicator, overrides: Sequence[str]) -> None:
    """Write gpu-kernels.csv into DIRECTORY and print the stage's part of it."""
    _study(communicator, overrides, {**shipped(INPUTS), **standard()}, ARCHITECTURES)


def _study(
    communicator: Communicator,
    overrides: Sequence[str],
    scenes: Mapping[str, Scene],
    architectures: Sequence[str],
) -> None:
    if communicator.size > 1 or overrides:
        raise InputError(["study kernels: runs on one rank and takes no overrides"])
    try:
        compiler = nvrtc.version()
    except nvrtc.CompileError as error:
        raise InputError([f"study kernels: {error}"]) from error
    DIRECTORY.mkdir(parents=True, exist_ok=True)
    path, found = DIRECTORY / "gpu-kernels.csv", texts(scenes, communicator)
    with open(path, "w", newline="") as file, ThreadPoolExecutor() as pool:
        writer = None
        for rows_of_text in pool.map(lambda item: [*rows(*item, architectures)], found.items()):
            for row in rows_of_text:
                writer = writer or _begun(file, row)
                writer.writerow(row)
                if row["kernel"] == "advance_tiles":
                    print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    print(f"{path}, by NVRTC {compiler}")


def _begun(file: Any, row: dict[str, Any]) -> csv.DictWriter:
    writer = csv.DictWriter(file, list(row))
    writer.writeheader()
    return writer
