"""The fluid's stage in CUDA C, on the host: the bits of the CPU for every kind of flow, and each barrier is needed."""

import re

import numpy as np
import pytest

from distfsi.device import cpu
from distfsi.device.host import HostKernel
from distfsi.device.kernel import Kernel
from distfsi.mesh.communicator import Communicator
from distfsi.scene.description import Ball, FluidState, Performance, Region
from distfsi.simulation import Simulation
from fluids import MATERIALS
from side_by_side import SideBySide, copies_of
from tubes import scene_of

PERFORMANCE = {
    1: Performance((48,), (16,)),
    2: Performance((24, 16), (8, 5)),
    3: Performance((16, 16, 16), (8, 4, 5)),
}
CELLS = {1: (100,), 2: (50, 21), 3: (28, 21, 22)}


def blast(names, dimensions, pressures=(6e9, 2e9), **method):
    """Balls of high pressure in two corners of a box with walls at the low sides; the middle is at rest."""
    D, upper = dimensions, tuple(0.02 * n for n in CELLS[dimensions])
    phases = zip((len(names) - 1, 0), pressures, strict=True)
    inner, outer = (FluidState(k, 1000.0, p, (0.0,) * D) for k, p in phases)
    return scene_of(
        tuple(MATERIALS[name] for name in names),
        (Region(outer, None), *(Region(inner, Ball(center, 0.09)) for center in ((0.05,) * D, upper))),
        (0.0,) * D,
        upper,
        CELLS[D],
        1.0,
        boundaries=(("wall", "outflow"),) * D,
        performance=PERFORMANCE[D],
        **method,
    )


CASES = {
    "1D gas": (("air",), 1, {}),
    "1D gas, float32": (("air",), 1, {"precision": "float32"}),
    "1D gas and explosive, far from one pressure": (("air", "tnt"), 1, {"pressures": (6e9, 1e6), "riemann": "hll"}),
    "1D gas, explosive and water, far from one pressure": (("air", "tnt", "water"), 1, {"pressures": (6e9, 1e6)}),
    "2D gas": (("air",), 2, {"riemann": "adaptive", "reconstruction": "weno5"}),
    "2D gas, float32, first order": (("air",), 2, {"precision": "float32", "reconstruction": "first_order"}),
    "2D water and gas": (("water", "air"), 2, {"riemann": "adaptive", "sharpening": True}),
    "3D gas": (("air",), 3, {}),
    "gas around a point": (("air",), 1, {"symmetry": "spherical", "reconstruction": "van_leer"}),
    "gas around an axis, float32": (("air",), 2, {"symmetry": "axisymmetric", "precision": "float32"}),
}
LONG = {
    "2D explosive and water, float32": (("tnt", "water"), 2, {"precision": "float32"}),
    "water and gas around an axis": (
        ("water", "air"),
        2,
        {"symmetry": "axisymmetric", "riemann": "adaptive", "sharpening": True},
    ),
    "2D four materials, float32": (
        ("water", "air", "helium", "water"),
        2,
        {"precision": "float32", "sharpening": True, "reconstruction": "van_leer", "riemann": "adaptive"},
    ),
    "2D four materials of five equations": (
        ("water", "air", "tnt", "water"),
        2,
        {"model": "five_equation", "reconstruction": "weno5"},
    ),
    "3D gas, sideways": (("air",), 3, {"riemann": "adaptive", "reconstruction": "van_leer"}),
    "3D explosive and gas": (("tnt", "air"), 3, {"riemann": "adaptive"}),
    "3D water and gas, float32": (("water", "air"), 3, {"precision": "float32", "reconstruction": "weno5"}),
}


@pytest.mark.parametrize("name", [*CASES, *(pytest.param(name, marks=pytest.mark.full) for name in LONG)])
def test_the_stage_call_by_call(monkeypatch, name):
    """Walls with their impulse, tiles that rest and tiles cut off at the end of a block, in both orders of threads."""
    names, dimensions, method = (CASES | LONG)[name]
    pair = SideBySide(monkeypatch)
    simulation = Simulation.of(blast(names, dimensions, **method), Communicator(), 1)
    for _ in range(3):
        simulation.step()
    assert not pair.unlike
    assert pair.calls["advance_tiles"] >= 9 and pair.calls["fastest_signals"] == 4
    assert simulation.fluid.share_at_rest() > 0.1
    assert np.abs(simulation.fluid.left_domain()).max() > 0.0


# ---- barriers --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def calls():
    """One call of each kernel with barriers, in 3D: the kernel, its arguments, and what they become."""
    kept = {}
    build = cpu.build

    def keep(drivers, constants, bindings=None, real="float64"):
        compiled = build(drivers, constants, bindings, real)

        def keeping(driver):
            def call(begin, end, *arguments):
                kernel = Kernel(driver, constants, bindings or {}, real)
                before = copies_of(kernel.given(arguments))
                getattr(compiled, driver.__name__)(begin, end, *arguments)
                kept[driver.__name__] = kernel, end, before, copies_of(kernel.given(arguments))

            return call

        return type("Kernels", (), {driver.__name__: staticmethod(keeping(driver)) for driver in drivers})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cpu.Cpu, "build", staticmethod(keep))
        simulation = Simulation.of(blast(("air",), 3, scheme="rk2"), Communicator(), 1)
        for _ in range(2):
            simulation.step()
    return kept


def count_unlike(kernel, end, before, after):
    """Values that come out otherwise than the CPU's, in either order of the threads."""
    unlike = 0
    for reverse in (False, True):
        copies = copies_of(before)
        HostKernel(kernel)(end, copies, reverse)
        pairs = [(a, b) for a, b in zip(after, copies, strict=True) if isinstance(a, np.ndarray)]
        unlike += sum(np.count_nonzero(~((a == b) | ((a != a) & (b != b)))) for a, b in pairs)
    return unlike


BARRIER = re.compile(r"__syncthreads\(\);|__syncthreads_count\(unlike\)")


@pytest.mark.parametrize(("name", "barriers"), [("advance_tiles", 11), ("fastest_signals", 1)])
def test_every_barrier_is_needed(monkeypatch, calls, name, barriers):
    """Without it something comes out otherwise."""
    kernel, *call = calls[name]
    assert count_unlike(kernel, *call) == 0
    text = kernel.text(call[1])
    start = text.index(f"{name}_kernel")
    found = list(BARRIER.finditer(text, start, re.compile("^#e", re.M).search(text, start).start()))
    assert len(found) == barriers
    for barrier in found:
        without = text[: barrier.start()] + ("unlike" if "count" in barrier[0] else ";") + text[barrier.end() :]
        monkeypatch.setattr(Kernel, "text", lambda self, arguments, without=without: without)
        line = text[: barrier.start()].count("\n")
        assert count_unlike(kernel, *call) > 0, "\n".join(text.splitlines()[line - 3 : line + 3])
