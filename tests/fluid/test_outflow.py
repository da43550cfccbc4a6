"""How much of a wave comes back from an end of kind outflow."""

import numpy as np
import pytest

from distfsi.scene.description import FluidState, Region
from fluids import AIR, WATER
from tubes import OPEN, centers, fields, scene_of, start

STATES = {"air": (AIR, 1.2, 1.4, 0.0), "water": (WATER, 1000.0, 4.4, 6e8)}
AMBIENT = 1e5


def left_behind(name, amplitude, cells=200):
    """What is left of a wave that has gone out, over its height: a hump in x = 0.5 m that runs to the right, of an
    overpressure of `amplitude` rho c^2."""
    eos, density, gamma, p_inf = STATES[name]
    c = np.sqrt(gamma * (AMBIENT + p_inf) / density)
    regions = (Region(FluidState(0, density, AMBIENT, (0.0,)), None),)
    simulation = start(
        scene_of((eos,), regions, (0.0,), (1.0,), (cells,), 0.95 / c, (OPEN,), reconstruction="van_leer")
    )
    # a simple wave: density and pressure on the isentrope, u - 2 c/(gamma - 1) as in front of it
    rho = density * (1.0 + amplitude * np.exp(-(((centers(simulation)[0] - 0.5) / 0.08) ** 2)))
    p = (AMBIENT + p_inf) * (rho / density) ** gamma - p_inf
    u = 2.0 / (gamma - 1.0) * (np.sqrt(gamma * (p + p_inf) / rho) - c)
    simulation.fluid.cells(0)[:, 0, 0] = np.array(simulation.fluid.model.formula("conserved")((rho, u, p)))
    simulation.fluid.changed()
    simulation.fluid.wake(np.array([True]))
    while not simulation.done:
        simulation.step()
    return np.abs(fields(simulation)["pressure"] - AMBIENT).max() / (p - AMBIENT).max()


@pytest.mark.parametrize(
    ("name", "amplitude", "part"),
    [("air", 1e-4, 1e-6), ("air", 0.1, 1e-3), ("water", 1e-4, 2e-5), ("water", 0.01, 2e-3)],
)
def test_a_wave_that_meets_an_outflow_straight_leaves_nothing(name, amplitude, part):
    """What repeats the last cell reflects a straight wave by less than `part`."""
    assert left_behind(name, amplitude) < part
