"""NVIDIA's compiler takes every kernel, without a GPU: nothing is spilled in the stage, float32 stays float32."""

import pytest

from distfsi.device import nvrtc
from distfsi.mesh.communicator import Communicator
from distfsi.study import kernels, works
from mpi_solid import bursting_ball, step
from test_cuda_text import NOT_REACHED

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


def coupled_kernels():
    """All that a coupled scene calls."""
    return kernels.coupled_kernels(works.blast_on_copper(8, 2), Communicator())


def kernels_of_debris():
    """What no other scene calls."""
    team = kernels.Listening()
    ball, _ = bursting_ball(team)
    for _ in range(62):
        step(ball)
    found = [(kernel, arguments) for kernel, arguments in team.kept.values() if kernel.name in NOT_REACHED]
    assert {kernel.name for kernel, _ in found} == set(NOT_REACHED)
    return found


@pytest.mark.parametrize("found", [coupled_kernels, kernels_of_debris])
def test_solid_and_coupling_compile(found):
    """They are compiled once and kept."""
    names = {kernel.name for kernel, arguments in found() if nvrtc.cubin(kernel.name, kernel.text(arguments), "sm_90")}
    assert "fill_cells" in names or "cut" in names


@pytest.mark.full
@pytest.mark.parametrize("found", [coupled_kernels, kernels_of_debris])
def test_solid_and_coupling_fit_into_registers(found):
    """For all architectures."""
    for row in kernels.rows("", 2, found()):
        assert 0 < row["registers"] < 255, row


def test_a_text_that_is_no_cuda_is_refused():
    with pytest.raises(nvrtc.CompileError, match="identifier"):
        nvrtc.compile_text("__global__ void f() { nonsense(); }", "sm_90")
