"""The conservation budget of fluid and solid together: what leaves through the ends has left, gravity is booked."""

import pytest

from distfsi.diagnostics.budget import Budget
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation

BALL = """
[domain]
lower = [0, 0]
upper = ["0.4 m", "0.2 m"]
cells = [16, 8]
x = ["outflow", "outflow"]
y = ["wall", "wall"]
[time]
end = "1.5 ms"
[fluid.phases.air]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "air"
density = 1.2
pressure = "1 bar"
[solid.bodies.ball]
shape = { kind = "ball", center = ["0.34 m", "0.1 m"], radius = "50 mm" }
spacing = "12.5 mm"
density = "1000 kg/m3"
velocity = ["100 m/s", 0]
eos = { kind = "linear", bulk_modulus = "100 MPa" }
strength = { kind = "elastic", shear_modulus = "40 MPa" }
"""


def budget_of(tmp_path, *settings):
    """The last row of a run of the ball, and what its summary says."""
    path = tmp_path / "ball.toml"
    path.write_text(BALL)
    simulation = Simulation.of(load(path, settings), Communicator(), 1)
    budget = Budget(simulation.fluid, simulation.solid, simulation.coupling)
    budget.row(simulation)
    while not simulation.done:
        simulation.step()
    return simulation, budget.row(simulation), budget.summary(simulation)


def drifts(row):
    return [abs(value) for name, value in row.items() if name.startswith("drift")]


def test_a_body_that_leaves_has_left(tmp_path):
    """Before, what passes the end with it was made by the coupling."""
    simulation, row, text = budget_of(tmp_path)
    assert simulation.solid.columns["position"][:, 0].min() > 0.4
    assert max(drifts(row)) < 1e-12
    made = [value for name, value in row.items() if name.startswith("coupling ")]
    assert max(map(abs, made)) < 1e-12 * row["fluid energy [J/m]"]
    assert abs(simulation.coupling.budget_by_cause()["sides"]).max() > 0.0
    assert "Conservation error" in text


@pytest.mark.parametrize("scheme", ["cut_cells", "staircase"])
def test_gravity_on_fluid_and_body_closes(tmp_path, scheme):
    """A heavy gas, so that its weight counts."""
    slow = ("solid.bodies.ball.velocity=[0, 0]", "solid.bodies.ball.shape.center=['0.2 m', '0.1 m']")
    heavy = ("fluid.regions.0.density=100", "domain.gravity=[0, -1000]", "time.maximum_steps=20")
    simulation, row, _ = budget_of(tmp_path, f"coupling.scheme={scheme}", *slow, *heavy)
    assert max(drifts(row)) < 1e-12
    gas = (0.4 * 0.2 - 3.1416 * 0.05**2) * 100.0
    given = row["body force momentum_y [N s/m]"]
    assert given == pytest.approx(-1000.0 * gas * simulation.time, rel=0.03)
    assert abs(row["body force energy [J/m]"]) > 0.0
