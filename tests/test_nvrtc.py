"""NVIDIA's compiler takes every kernel, without a GPU: nothing is spilled in the stage, float32 stays float32."""

import pytest

from distfsi.device import nvrtc
from distfsi.mesh.communicator import Communicator
from distfsi.study import kernels, works

FEW = (("one gas", 1, "float32"), ("two gases", 2, "float64"), ("TNT and air", 2, "float32"))
ALL = [(name, D, real) for name in kernels.FLUIDS for D in (1, 2, 3) for real in ("float64", "float32")]
# The limiter of the faces needs more than the 255 registers that there are; without it these spilled nothing.
SPILLING = [("two gases", 3, "float64"), ("TNT and air", 3, "float64")]
SPILLS = pytest.mark.xfail(strict=True, reason="255 registers do not hold a limited face in 3D and float64")


def stage_rows(name, dimensions, real, architectures, monkeypatch):
    """What the compiler says of the stage."""
    monkeypatch.setattr(kernels, "ARCHITECTURES", architectures)
    scene = works.gases(kernels.CELLS[dimensions], *kernels.FLUIDS[name], real)
    found = kernels.fluid_kernels(scene, Communicator())
    assert {kernel.name for kernel, _ in found} == {"advance_tiles", "fastest_signals", "copy_regions"}
    return [row for row in kernels.rows(name, dimensions, found) if row["kernel"] == "advance_tiles"]


@pytest.mark.parametrize(
    ("name", "dimensions", "real", "architectures"),
    [(*case, ("sm_90",)) for case in FEW]
    + [pytest.param(*case, kernels.ARCHITECTURES, marks=pytest.mark.full) for case in ALL if case not in SPILLING]
    + [pytest.param(*case, kernels.ARCHITECTURES, marks=[pytest.mark.full, SPILLS]) for case in SPILLING],
)
def test_the_stage_spills_nothing(monkeypatch, name, dimensions, real, architectures):
    for row in stage_rows(name, dimensions, real, architectures, monkeypatch):
        assert row["spill stores"] == row["spill loads"] == row["stack"] == row["local memory"] == 0, row
        assert row["shared memory [B]"] <= 99 * 1024  # what every one of the architectures has
        if real == "float32":  # what leaves through the domain's sides is summed in float64
            assert row["float64"] < 40 < row["float32"]


@pytest.mark.parametrize(
    "architectures", [("sm_90",), pytest.param(kernels.ARCHITECTURES, marks=pytest.mark.full)], ids=len
)
def test_solid_and_coupling_compile(monkeypatch, architectures):
    """All that a coupled scene calls."""
    monkeypatch.setattr(kernels, "ARCHITECTURES", architectures)
    found = kernels.coupled_kernels(works.blast_on_copper(8, 2), Communicator())
    rows = list(kernels.rows("", 2, found))
    assert "fill_cells" in {row["kernel"] for row in rows}
    assert len({row["kernel"] for row in rows}) > 20
    assert all(0 < row["registers"] < 255 for row in rows)


def test_a_text_that_is_no_cuda_is_refused():
    with pytest.raises(nvrtc.CompileError, match="identifier"):
        nvrtc.compile_text("__global__ void f() { nonsense(); }", "sm_90")
