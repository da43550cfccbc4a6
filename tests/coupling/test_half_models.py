"""Half a model at a symmetry plane is the whole one."""

import numpy as np
import pytest

from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation

HALF = """
[domain]
lower = ["-48 mm", 0]
upper = ["48 mm", "48 mm"]
cells = [48, 24]
y = ["symmetry", "outflow"]
[time]
end = "15 us"
[fluid.phases.products]
eos = "jwl"
rho0 = 1630
A = "371.2 GPa"
B = "3.21 GPa"
R1 = 4.15
R2 = 0.95
omega = 0.3
[fluid.phases.air]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "air"
density = 1.225
pressure = 101325
[[fluid.regions]]
phase = "products"
density = 1630
energy = "4.29 MJ/kg"
shape = { kind = "ball", center = [0, 0], radius = "12 mm" }
[solid.bodies.block]
shape = { kind = "box", lower = ["20 mm", 0], upper = ["28 mm", "14 mm"] }
spacing = "1 mm"
density = 7830
eos = { kind = "mie_grueneisen", c0 = 4569, s1 = 1.49, gamma0 = 2.17, a = 0.46 }
strength = { kind = "perfectly_plastic", shear_modulus = "80 GPa", yield_stress = "0.8 GPa" }
"""
WHOLE = (
    'domain.y=["outflow", "outflow"]',
    'domain.lower=["-48 mm", "-48 mm"]',
    "domain.cells=[48, 48]",
    'solid.bodies.block.shape.lower=["20 mm", "-14 mm"]',
)


def test_a_free_block_whose_middle_is_the_plane(tmp_path):
    """A charge squeezes it, so that particles beside the plane are wider than apart: the cubes that make its wall reach
    beyond the plane, which took what does: 1e-4 of the state."""
    (tmp_path / "half.toml").write_text(HALF)
    half, whole = (Simulation.of(load(tmp_path / "half.toml", changes), Communicator(), 1) for changes in ((), WHOLE))
    for _ in range(60):
        half.step()
        whole.step()
        assert half.dt == pytest.approx(whole.dt, rel=1e-10)
    found = []
    for c in (half.solid.columns, whole.solid.columns):
        chosen = np.flatnonzero(c["reference"][:, 1] > 0.0)
        order = chosen[np.lexsort(np.round(c["reference"][chosen], 6).T)]
        found.append(np.hstack([c["velocity"], c["deviator"], c["pressure"][:, None]])[order])
    own, other = found
    assert np.abs(own[:, 0]).max() > 50.0
    assert np.all(np.abs(own - other).max(axis=0) < 1e-10 * np.abs(other).max(axis=0))
    totals = [s.fluid.totals(s.coupling.volume)[0] for s in (half, whole)]
    assert 2.0 * totals[0][[0, 1, 2, 4]] == pytest.approx(totals[1][[0, 1, 2, 4]], rel=1e-11)
