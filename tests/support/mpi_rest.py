"""Scenes with much that is at rest, and the run that every rank makes; started by test_rest.py.

mpi_rest.py SCENE ...    runs the scenes; rank 0 prints their names, digests and shares at rest
"""

import hashlib
import sys
import tempfile
from pathlib import Path

import numpy as np

from distfsi.diagnostics.budget import Budget
from distfsi.mesh.communicator import Communicator, install_abort_on_exception
from distfsi.scene import load
from distfsi.simulation import Simulation
from launch import ROOT

PLANE = """
title = "at rest"
[domain]
symmetry = "{symmetry}"
lower = [0, 0]
upper = [{cells[0]}, {cells[1]}]
cells = {cells}
x = {x}
y = ["symmetry", "wall"]
[time]
end = 1e9
maximum_steps = {steps}
scheme = "{scheme}"
[fluid]
riemann = "adaptive"
{inflow}
[fluid.phases]
gas = {{ eos = "ideal_gas", gamma = 1.4 }}
[[fluid.regions]]
phase = "gas"
density = 1
pressure = 1
velocity = {velocity}
[[fluid.regions]]
phase = "gas"
density = 3
pressure = {pressure}
shape = {{ kind = "ball", center = {center}, radius = 3.3 }}
[performance]
block_cells = {block}
tile_cells = {tile}
"""
STREAM = 'inflow = { x_low = { phase = "gas", density = 2, pressure = 3, velocity = [1.5, 0] } }'
SPACE = """
title = "at rest in three dimensions"
[domain]
lower = [0, 0, 0]
upper = [24, 22, 26]
cells = [24, 22, 26]
x = ["symmetry", "outflow"]
y = ["wall", "outflow"]
z = ["periodic", "periodic"]
[time]
end = 1e9
maximum_steps = 12
[fluid]
precision = "float32"
[fluid.phases]
gas = { eos = "ideal_gas", gamma = 1.4 }
[[fluid.regions]]
phase = "gas"
density = 1
pressure = 1
[[fluid.regions]]
phase = "gas"
density = 3
pressure = 10
shape = { kind = "ball", center = [1, 2, 3], radius = 2.5 }
[performance]
block_cells = [12, 8, 9]
tile_cells = [12, 4, 3]
"""
FALLING = """
title = "uniform gas that falls between walls"
[domain]
gravity = [-0.1]
lower = [0]
upper = [40]
cells = [40]
x = ["wall", "wall"]
[time]
end = 1e9
maximum_steps = 5
[fluid.phases]
gas = { eos = "ideal_gas", gamma = 1.4 }
[[fluid.regions]]
phase = "gas"
density = 1
pressure = 1
[performance]
block_cells = [20]
tile_cells = [4]
"""
INTERFACE = """
title = "water and air in balance, and a wave on its way to them"
[domain]
lower = [0]
upper = [96]
cells = [96]
x = ["wall", "wall"]
[time]
end = 1e9
maximum_steps = 60
[fluid.phases]
air = { eos = "ideal_gas", gamma = 1.4 }
water = { eos = "stiffened_gas", gamma = 4.4, p_inf = 6e8 }
[[fluid.regions]]
phase = "air"
density = 1.2
pressure = 1e5
[[fluid.regions]]
phase = "water"
density = 1000
pressure = 1e5
shape = { kind = "half_space", point = [44.0], normal = [-1] }
[[fluid.regions]]
phase = "water"
density = 1010
pressure = 3e7
shape = { kind = "half_space", point = [88.0], normal = [-1] }
[performance]
block_cells = [24]
tile_cells = [8]
"""


def plane(**given):
    """A ball of gas at high pressure near a corner of a block, in gas at rest, 2D."""
    values = {
        "cells": [64, 44],
        "x": ["outflow", "wall"],
        "steps": 24,
        "scheme": "rk3",
        "inflow": "",
        "velocity": [0, 0],
        "pressure": 20,
        "center": [27.5, 8.5],
        "block": [16, 12],
        "tile": [8, 4],
        "symmetry": "planar",
    }
    return PLANE.format(**values | given)


SCENES = {
    "corner": plane(),
    "large blocks": plane(block=[64, 44], tile=[16, 11], velocity=[-0.0, 0]),
    "thin tiles": plane(block=[21, 9], tile=[4, 1]),
    "two stages": plane(scheme="rk2", velocity=[0, -0.0]),
    "periodic": plane(x=["periodic", "periodic"], center=[2, 40], steps=16),
    "inflow": plane(x=["inflow", "outflow"], inflow=STREAM, pressure=1),
    "stream": plane(x=["periodic", "periodic"], velocity=[0.3, 0]),
    "axis": plane(symmetry="axisymmetric", x=["axis", "wall"]),
    "along the axis": plane(symmetry="axisymmetric", x=["axis", "outflow"], velocity=[-0.0, 0.3], steps=10),
    "away from the axis": plane(symmetry="axisymmetric", x=["axis", "outflow"], velocity=[0.3, 0]),
    "falling": FALLING,
    "space": SPACE,
    "interface": INTERFACE,
}
TUBE = [
    "domain.cells=[48, 48]",
    "domain.upper=['96 mm', '96 mm']",
    "solid.bodies.tube.spacing=1.3 mm",
    "time.maximum_steps=30",
    "performance.block_cells=[16, 12]",
    "performance.tile_cells=[8, 4]",
]


def simulation_of(name):
    """The simulation of one of SCENES or of the tube."""
    if name == "tube":
        return Simulation.of(load(ROOT / "inputs/steel_tube.toml", TUBE), Communicator(), threads=1)
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory, "scene.toml")
        path.write_text(SCENES[name])
        return Simulation.of(load(path), Communicator(), threads=1)


def cells_of(simulation):
    """(variables, z, y, x) of all ranks' cells."""
    fluid, blocks = simulation.fluid, simulation.blocks
    whole = np.zeros((fluid.model.variables, *blocks.grid.cells[::-1]), dtype=fluid.state.dtype)
    parts = [(blocks.origin[b][::-1], fluid.cells(b)) for b in range(blocks.local_count)]
    for origin, cells in sum(simulation.communicator.allgather(parts), []):
        whole[(slice(None), *(slice(o, o + n) for o, n in zip(origin, cells.shape[1:], strict=True)))] = cells
    return whole


def follow(name):
    """Run a scene: per step the time step, at the end the cells and the row of the history; and the share at rest."""
    simulation = simulation_of(name)
    budget = Budget(simulation.fluid, simulation.solid, simulation.coupling)
    budget.row(simulation)
    steps = []
    while not simulation.done:
        simulation.step()
        steps.append(simulation.dt)
    row = budget.row(simulation)
    return {
        "time steps": np.array(steps),
        "cells": cells_of(simulation),
        "history": np.array([value for value in row.values() if not isinstance(value, str)]),
    }, simulation.fluid.share_at_rest()


def digest(found):
    """Hash of what `follow` gives, signs of zeros included."""
    return hashlib.sha256(b"".join(values.tobytes() for values in found.values())).hexdigest()


def main():
    communicator = Communicator()
    install_abort_on_exception(communicator)
    for name in sys.argv[1:]:
        found, share = follow(name)
        if communicator.rank == 0:
            print(f"{name}: {digest(found)} {share:.6f}", flush=True)


if __name__ == "__main__":
    main()
