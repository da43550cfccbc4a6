"""Every row pass of the fluid must come out as packed arithmetic: read from the machine code, not from a clock."""

import platform
import re
import sys

import numpy as np
import pytest
from llvmlite.binding import get_host_cpu_features
from numba import typeof

from distfsi.coupling.cut_cells.kernels import forces, nodal_distance
from distfsi.coupling.kernels import spreading
from distfsi.device import llvm_text
from distfsi.device.native import Native
from distfsi.device.source import parameters_of
from distfsi.diagnostics.kernels import peaks
from distfsi.fluid.kernels import rows as fluid
from distfsi.fluid.kernels.records import StageStep
from distfsi.fluid.kernels.signals import signal_row
from fluids import model_of

pytestmark = pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"), reason="reads the instructions of x86-64 only"
)

ROWS = (fluid.primitives_row, fluid.increments_row, fluid.flux_row, fluid.update_row, signal_row, peaks.peaks_row)
REALS = {"rx", "ry", "rz", "limits_ambient", "limits_arrival", "step_time", "faces_rate"}
REALS |= {f"step_{name}" for name in StageStep._fields}
ARRAYS = ("states_", "step_before", "step_after")
SCENES = {
    "water-air-2D": (("water", "air"), 2, "float64"),
    "products-air-3D": (("tnt", "air"), 3, "float64"),
    "air-3D": (("air",), 3, "float64"),
    "products-air-2D-single": (("tnt", "air"), 2, "float32"),
}
AROUND = {"water-air-axis": (("water", "air"), 2, "float64"), "air-point-single": (("air",), 1, "float32")}
METHOD = {
    "water-air-2D": {"riemann": "hllc", "sharpening": True},
    "products-air-3D": {"riemann": "adaptive", "limiter": "weno5"},
    "air-3D": {"riemann": "adaptive"},
    "products-air-2D-single": {"riemann": "hll"},
    "water-air-axis": {"riemann": "adaptive", "sharpening": True, "symmetry": "axisymmetric"},
    "air-point-single": {"symmetry": "spherical"},
}
WIDE = ("ymm", "zmm") if get_host_cpu_features().get("avx") else ("xmm",)


@pytest.fixture(autouse=True)
def _nothing_compiled_before(tmp_path, monkeypatch):
    """What is found on disk cannot be looked at; nor what another test of this process has found there."""
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path))
    for name in [name for name in sys.modules if name.startswith("distfsi_kernels.")]:
        monkeypatch.delitem(sys.modules, name)


def native_row(row, scene):
    """A row for a scene, as if it were a driver, and arguments: arrays (upper-case names), reals and integers."""
    names, dimensions, real = (SCENES | AROUND)[scene]
    model = model_of(*names, dimensions=dimensions, **{"limiter": "van_leer"} | METHOD[scene])
    arguments = [
        np.zeros(1, np.uint8 if name == "K" else real)
        if name.isupper() or name.startswith(ARRAYS)
        else np.dtype(real).type(0)
        if name in REALS
        else 0
        for name in parameters_of(row, 0)
    ]
    return Native(row, model.constants, model.bindings, real), arguments


def machine_code(native, arguments):
    """What numba makes of a driver for such arguments."""
    numbers = native.numbers()
    native.dispatcher.compile(tuple(map(typeof, [*arguments, *numbers])))
    return "\n".join(native.dispatcher.inspect_asm().values())


def count(code, operations, kind, registers):
    """Instructions such as vmulpd (kind "pd") on the given registers."""
    lines = re.findall(rf"^\s+v?(?:{operations}){kind}\b.*$", code, re.MULTILINE)
    return sum(any(f"%{register}" in line for register in registers) for line in lines)


CASES = [(row, scene) for row in ROWS for scene in SCENES]
CASES += [(row, scene) for row in (fluid.increments_in_r_row, fluid.flux_row, fluid.update_row) for scene in AROUND]


@pytest.mark.parametrize(("row", "scene"), CASES, ids=lambda value: getattr(value, "__name__", value))
def test_rows_are_packed(row, scene):
    """Each loop has a packed body without any scalar arithmetic; scalar is only the remainder."""
    names, dimensions, real = (SCENES | AROUND)[scene]
    own, other = ("d", "s") if real == "float64" else ("s", "d")
    code = machine_code(*native_row(row, scene))
    bodies = [part for part in re.split(r"^\.?\w+:", code, flags=re.MULTILINE) if count(part, "mul", "p" + own, WIDE)]
    loops = model_of(*names, dimensions=dimensions).variables if row.__name__.startswith("increments") else 1
    assert len(bodies) >= loops
    assert sum(count(body, "mul|div|sqrt", "s" + own, ["xmm"]) for body in bodies) == 0
    for operation in ("mul", "div", "sqrt"):
        scalar, packed = count(code, operation, "s" + own, ["xmm"]), count(code, operation, "p" + own, WIDE)
        assert bool(packed) == bool(scalar), operation
    assert count(code, "mul|add|sub|div|sqrt", "[ps]" + other, ["xmm", *WIDE]) == 0


@pytest.mark.parametrize("row", [fluid.flux_row, fluid.update_row], ids=lambda row: row.__name__)
def test_without_the_promise_of_no_alias_rows_are_scalar(row, monkeypatch, tmp_path):
    """So that the test above does fail on the day the promise is no longer heard."""
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path))
    text = llvm_text.Module.text
    monkeypatch.setattr(llvm_text.Module, "text", lambda self: text(self).replace("ptr noalias", "ptr"))
    native, arguments = native_row(row, "water-air-2D")
    sys.modules.pop(native.module.__name__)
    code = machine_code(Native(row, native.constants, native.bindings, native.real), arguments)
    assert count(code, "mul", "sd", ["xmm"]) > 10
    assert count(code, "mul", "pd", WIDE) == 0


POINTS = (nodal_distance.add_spheres, forces.interpolate, spreading.spread)
INTEGERS = ("order", "start", "low", "window", "strides", "chosen", "band", "walled", "home")
INTEGERS += ("shape", "steps", "cells", "origin", "extent", "seen")
TABLES = ("position", "values", "mean", "image", "gained", "origin", "extent", "seen")
COUNTS, AMOUNTS = ("begin", "end", "width", "giver"), ("size", "radius", "largest", "reach")


def example(name):
    """An argument of the type that a driver has under this name; fields of records by their last word."""
    if name in COUNTS:
        return 0
    *_, word = name.split("_")
    if word in AMOUNTS:
        return 1.0
    if name == "kind":
        return np.zeros(1, np.int8)
    dimensions = 5 if name == "field" else 2 if word in TABLES or name == "grid_spacing" else 1
    return np.zeros((1,) * dimensions, np.int64 if word in INTEGERS else float)


@pytest.mark.full
@pytest.mark.parametrize("driver", POINTS, ids=lambda driver: driver.__name__)
def test_points_near_each_other_are_packed(driver):
    """What a particle is to LANES points is computed at once: in the driver, where its rows know how many there are."""
    native = Native(driver, {"DIMENSIONS": 3, "LANES": 8, "GHOSTS": 2, "TRANSFERRED": 4}, {}, "float64")
    assert count(machine_code(native, [*map(example, parameters_of(driver, 0))]), "mul", "pd", WIDE) >= 5
