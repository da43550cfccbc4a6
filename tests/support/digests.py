"""Digests of all that a run leaves behind: a short sum per array, by which two versions of the code are compared.

`python tests/support/digests.py [case ...]` runs the cases named, or all, and writes their digests into digests.json.
To be used when results are meant to change; where only the structure of the code changes, the table stays.
"""

from __future__ import annotations

import csv
import hashlib
import json
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np
from llvmlite.binding import get_host_cpu_features

from launch import ROOT, run_ranks

TABLE = Path(__file__).with_suffix(".json")
PACKAGES = ("numba", "llvmlite", "numpy", "scipy")

# Arrays that have other names now than in the table, for every case: {name in the table: name now}.
RENAMED: dict[str, str] = {}

# The text of the scene: it tells of folders, and no step reads it. How evenly ranks share the work, and how
# long it takes, is no result.
NO_RESULT = ("restart/scene", "balance.csv/", "performance.csv/")

# A particle whose ball has no radius is none. Where it would point is not read, and depends on the particles that are
# looked at together with it, and so on the number of ranks.
BALLS = "solid/particles/inflation"

Digests = dict[str, str]


@dataclass(frozen=True)
class Case:
    """A run of an input: its restart file after so many steps, or the last before its end; its fields a step later."""

    input: str
    steps: int = 40
    settings: tuple[str, ...] = ()


COARSE_TUBE = ("domain.cells=[40, 40]", "solid.bodies.tube.spacing=1.2 mm")
GAUGES = (
    'gauges.wall={kind="point", position=["36 mm", "1 mm"]}',
    'gauges.ray={kind="line", from=[0, 0], to=["50 mm", "50 mm"], points=20}',
    'gauges.plane={kind="plane", axis="y", position="1 mm"}',
    'gauges.particle={kind="particle", body="tube", position=["32 mm", 0]}',
    'gauges.tube={kind="body", body="tube"}',
)
BRITTLE = (
    "domain.cells=[96, 96]",
    "solid.bodies.tube.spacing=1.25 mm",
    "solid.bodies.tube.failure.D1=0.01",
    "solid.bodies.tube.failure.D2=0.1",
)
SINGLE = ("fluid.precision=float32",)

# All inputs, and runs of choices that no input makes; small where what matters comes late.
CASES: Mapping[str, Case] = {
    **{path.stem: Case(path.stem) for path in sorted((ROOT / "inputs").glob("*.toml"))},
    "airblast_far": Case(
        "airblast_far", settings=("domain.cells=115", "stages.0.domain.cells=130", "stages.0.time.end=20 us")
    ),
    "bubble": Case("bubble", settings=("domain.cells=180", "stages.0.domain.cells=120", "stages.0.time.end=50 us")),
    "undex_sphere": Case(
        "undex_sphere", settings=("domain.cells=180", "stages.0.domain.cells=90", "stages.0.time.end=50 us")
    ),
    "undex_plate": Case("undex_plate", settings=("stages.0.domain.cells=190", "stages.0.time.end=50 us")),
    "surface_burst": Case("surface_burst", settings=("domain.cells=[40, 30]",)),
    "wall_blast": Case(
        "wall_blast", settings=("domain.cells=[20, 12, 12]", "stages.0.domain.cells=100", "stages.0.time.end=40 us")
    ),
    "sod float32": Case("sod", settings=SINGLE),
    "sedov float32": Case("sedov", settings=SINGLE),
    "tnt_air float32": Case("tnt_air", settings=SINGLE),
    "sod hll": Case("sod", settings=("fluid.riemann=hll", "fluid.reconstruction=first_order")),
    "sedov rusanov": Case("sedov", settings=("fluid.riemann=rusanov", "output.schlieren=true", "output.peaks=true")),
    "tnt_air weno5": Case("tnt_air", settings=("fluid.reconstruction=weno5", "fluid.sharpening=true")),
    "water_air five_equation": Case("water_air", settings=("fluid.model=five_equation",)),
    "gas_piston immersed_boundary": Case(
        "gas_piston", settings=("coupling.scheme=immersed_boundary", "coupling.sub_steps=1")
    ),
    "thin_plate staircase": Case("thin_plate", settings=("coupling.scheme=staircase",)),
    "steel_tube immersed_boundary": Case(
        "steel_tube", settings=(*COARSE_TUBE, "coupling.scheme=immersed_boundary", "coupling.sub_steps=1")
    ),
    "steel_tube gauges": Case("steel_tube", settings=(*COARSE_TUBE, *GAUGES, "solid.objective_rate=green_naghdi")),
    "steel_tube dropped": Case("steel_tube", 110, (*COARSE_TUBE, "coupling.drop_below=1 GPa")),
    "burst_tube debris": Case("burst_tube", 120, BRITTLE),
}


def run_case(case: Case, ranks: int, directory: Path, seconds: float = 600.0) -> Digests:
    """Run a case on so many ranks of one thread each, into an empty `directory`; the digests of what it leaves.

    There is a restart file after each step, and of them the last is read; so is the last of each kind of fields. Raises
    AssertionError when the run fails or takes longer than `seconds`.
    """
    settings = (
        f"time.maximum_steps={case.steps + 1}",
        "output.restart_every=1 ns",
        "output.restart_at_end=false",
        "output.fields_every=0",
        "output.history_every=1",
        f"output.directory={directory}",
        *case.settings,
    )
    words = [word for setting in settings for word in ("--set", setting)]
    run_ranks(ranks, ["-m", "distfsi", "run", ROOT / f"inputs/{case.input}.toml", "--threads", "1", *words], seconds)
    return digests_of(directory)


def digests_of(directory: Path) -> Digests:
    """The digests of all arrays in an output directory, by name, such as "restart/solid/particles/velocity"."""
    found = {}
    for pattern, read in READERS.items():
        last = {(path.parent, path.name.split("-")[0]): path for path in sorted(directory.rglob(pattern))}
        for path in last.values():
            name = str(path.relative_to(directory).with_name(path.name.split("-")[0]))
            found |= {f"{name}/{array}": digest(values) for array, values in read(path).items()}
    return {name: text for name, text in sorted(found.items()) if not name.startswith(NO_RESULT)}


def digest(array: np.ndarray) -> str:
    """16 hexadecimal digits of the SHA-256 of an array's type, shape and bytes."""
    array = np.ascontiguousarray(array)
    return hashlib.sha256(f"{array.dtype.str} {array.shape} ".encode() + array.tobytes()).hexdigest()[:16]


def differences(expected: Digests, found: Digests) -> list[str]:
    """A line for each array whose bits differ, or that only one side has; `expected` has the names of the table."""
    expected = {RENAMED.get(name, name): text for name, text in expected.items()}
    names = sorted(expected.keys() | found.keys())
    return [
        f"{name}: {expected.get(name, 'not in the table')}, now {found.get(name, 'not written')}"
        for name in names
        if expected.get(name) != found.get(name)
    ]


# ---- reading ---------------------------------------------------------------------------------------------------------


def _read_restart(path: Path) -> dict[str, np.ndarray]:
    """The datasets of a restart file; the rows of particles by id, of sums of integers the total."""
    with h5py.File(path) as file:
        arrays = _datasets(file)
    for name, values in arrays.items():
        if "/sums/" in name and values.dtype.kind == "i":  # some have a row per rank
            arrays[name] = values.sum(axis=0)
    if BALLS in arrays:
        arrays[BALLS][arrays[BALLS][:, 0] == 0.0] = 0.0
    return _by_id(arrays, "solid/particles/id", "solid/particles/")


def _read_fields(path: Path) -> dict[str, np.ndarray]:
    """Time and values of a file of cells or particles; the rows of particles by id."""
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        arrays = {"time": root["FieldData/TimeValue"][()]}
        if "CellData" in root:
            return arrays | _datasets(root["CellData"])
        return arrays | _by_id({"position": root["Points"][()], **_datasets(root["PointData"])}, "id", "")


def _datasets(group: h5py.Group) -> dict[str, np.ndarray]:
    found = {}
    group.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return {name: np.asarray(values, "S" if isinstance(values, bytes) else None) for name, values in found.items()}


def _by_id(arrays: dict[str, np.ndarray], identity: str, columns: str) -> dict[str, np.ndarray]:
    """The same with the rows of those whose names begin with `columns` in the order of the ids."""
    if identity not in arrays:
        return arrays
    order = np.argsort(arrays[identity])
    return {
        name: values[order] if name.startswith(columns) and len(values) == len(order) else values
        for name, values in arrays.items()
    }


def _read_csv(path: Path) -> dict[str, np.ndarray]:
    """The columns of a table as text, in which floats have all their bits."""
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return {name: np.array([row[i].encode() for row in rows], "S") for i, name in enumerate(header)}


READERS: Mapping[str, Callable[[Path], dict[str, np.ndarray]]] = {
    "restart-*.h5": _read_restart,
    "*.vtkhdf": _read_fields,
    "*.csv": _read_csv,
}


# ---- the table -------------------------------------------------------------------------------------------------------


def machine() -> dict[str, str | int]:
    """What may decide bits besides the code: the libraries, and the widest vectors of the CPU."""
    features = get_host_cpu_features()
    bits = next((bits for name, bits in (("avx512f", 512), ("avx2", 256)) if features.get(name)), 128)
    libraries = {name: version(name) for name in PACKAGES}
    return {**libraries, "C library": " ".join(platform.libc_ver()), "CPU": platform.machine(), "vector bits": bits}


def read_table() -> dict[str, dict]:
    """The table: "machine", and "digests" by case."""
    return json.loads(TABLE.read_text())


def record(names: list[str]) -> None:
    """Run these cases on one rank and write their digests into the table, which loses what is no case any more."""
    here = machine()
    table = read_table() if TABLE.exists() else {}
    if table.get("machine") != here:
        if set(names) != set(CASES):
            raise SystemExit(f"the table is of another machine, so all cases must run anew: {table.get('machine')}")
        table = {"machine": here, "digests": {}}
    for name in names:
        started = time.perf_counter()
        with tempfile.TemporaryDirectory() as directory:
            table["digests"][name] = run_case(CASES[name], 1, Path(directory))
        print(f"{name}: {len(table['digests'][name])} arrays in {time.perf_counter() - started:.1f} s", flush=True)
        table["digests"] = {case: table["digests"][case] for case in CASES if case in table["digests"]}
        TABLE.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    record(sys.argv[1:] or list(CASES))
