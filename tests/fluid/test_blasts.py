"""Blasts and implosions against the exact solutions of Sedov and Noh, in one, two and three dimensions."""

import pytest

from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.scene.description import FluidState, Region
from distfsi.study.exact_cases import half_way, radial_mean
from fluids import AIR
from tubes import advance, fields, radii, scene_of, start

MONATOMIC = IdealGas(5.0 / 3.0)
QUADRANT = ("symmetry", "outflow")
SHARP = {"reconstruction": "van_leer", "riemann": "adaptive"}

full = pytest.mark.full


# E and the shock's radius at time 1 in air of density 1 (Kamm and Timmes; in one dimension for both sides), and the
# pressure at 0.4 of the radius (Sedov), None: not told.
SEDOV = {1: (2 * 0.0673185, 0.5, None), 2: (0.311357, 0.75, 0.04376), 3: (0.851072, 1.0, 0.0487351)}


def sedov(dimensions, cells):
    """Radius of the shock and central pressure at time 1 over exact ones, and the largest density; `cells` reach from
    the centre to 1.2 of the exact radius.

    The shock is where the mean pressure of a ring is half the exact one behind it.
    """
    D, (energy, radius, central) = dimensions, SEDOV[dimensions]
    size = 1.2 * radius
    regions = (Region(FluidState(0, 1.0, 1e-6, (0.0,) * D), None),)
    scene = scene_of((AIR,), regions, (0.0,) * D, (size,) * D, (cells,) * D, 1.0, (QUADRANT,) * D, **SHARP)
    simulation = start(scene)
    h = size / cells
    inside = [r < 2.5 * h for r in radii(simulation)]
    share = energy / 2**D / (sum(part.sum() for part in inside) * h**D)
    for block, part in enumerate(inside):
        simulation.fluid.cells(block)[-1][part] += share
    advance(simulation)
    r, p = radial_mean(simulation, "pressure")
    speed = 2.0 / (D + 2.0) * radius
    shock = half_way(r, p, 0.5 * (2.0 / 2.4 * speed**2))
    pressure = p[r < 0.4 * radius][-1] / central if central else 1.0
    return shock / radius, pressure, fields(simulation)["density"].max()


@pytest.mark.parametrize(
    ("dimensions", "cells", "radius", "density"),
    [
        (1, 200, 0.005, 5.0),
        pytest.param(2, 80, 0.0075, 4.0, marks=full),
        pytest.param(2, 120, 0.005, 4.5, marks=full),
        pytest.param(3, 64, 0.01, 4.0, marks=full),
    ],
)
def test_sedov(dimensions, cells, radius, density):
    """The shock's radius, the pressure inside within 5 %, the density's peak of 6.

    The radius is off by half a cell on all meshes: 0.5 % takes 100 cells to the shock, in three dimensions, too.
    """
    shock, pressure, peak = sedov(dimensions, cells)
    assert shock == pytest.approx(1.0, abs=radius)
    assert pressure == pytest.approx(1.0, abs=0.05)
    assert peak > density


def noh(dimensions, cells, **method):
    """Gas that falls to the centre with speed 1 from everywhere, at time 0.6: r and density over its exact 4^D."""
    D = dimensions
    regions = (Region(FluidState(0, 1.0, 1e-6, (0.0,) * D), None),)
    simulation = start(
        scene_of((MONATOMIC,), regions, (0.0,) * D, (1.0,) * D, (cells,) * D, 0.6, (QUADRANT,) * D, **method)
    )
    domain = simulation.blocks
    for block, r in enumerate(radii(simulation)):
        U = simulation.fluid.cells(block)
        for d, x in enumerate(domain.cell_centers(block)[:D]):
            U[1 + d] = -x.reshape([-1 if axis == 2 - d else 1 for axis in range(3)]) / r
        U[-1] += 0.5
    r, density = radial_mean(advance(simulation), "density")
    return r, density / 4**D


@pytest.mark.parametrize(
    ("dimensions", "cells", "plateau"),
    [(1, 200, 0.01), pytest.param(2, 100, 0.03, marks=full), pytest.param(3, 48, 0.12, marks=full)],
)
def test_noh(dimensions, cells, plateau, record_property, capsys):
    """The shock stands at r = 0.2, within a cell; behind it the density is 4^D, but for the wall heating, printed."""
    r, density = noh(dimensions, cells, **SHARP)
    behind = (r > 0.08) & (r < 0.16)
    assert density[behind].mean() == pytest.approx(1.0, abs=plateau)
    ahead = 4.0 ** (dimensions - 1) / 4.0**dimensions
    off = (half_way(r, density, 0.5 * (1.0 + ahead)) - 0.2) * cells
    record_property("shock off, in cells", float(off))
    record_property("density at the centre, over the exact one", float(density[0]))
    with capsys.disabled():
        print(
            f"\nNoh {dimensions}D, {cells} cells: shock off by {off:+.2f} cells, density at the centre {density[0]:.3f}"
        )
    assert abs(off) <= 1.0
