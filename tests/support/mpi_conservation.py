"""Explosions in closed and periodic boxes, that every rank runs; started by test_conservation.py.

mpi_conservation.py NAME ...    rank 0 prints for each: its name, a digest of the cells, the drift of each total;
                                and what an exchange costs, for the last
"""

import hashlib
import json
import sys
from dataclasses import replace

from distfsi.coordinates.axisymmetric import Axisymmetric
from distfsi.diagnostics.budget import Budget
from distfsi.mesh.communicator import Communicator, install_abort_on_exception
from distfsi.resources.bench_ranks import measure
from distfsi.resources.works import AIR, AMBIENT_AIR, BURNT_TNT, TNT, WATER, gases
from distfsi.scene.description import Domain, Performance, Scene
from distfsi.simulation import Simulation
from mpi_rest import cells_of

STEPS = 150
WALLS, PERIODIC = ("wall", "wall"), ("periodic", "periodic")
WATER_AIR = (WATER, AIR), (1000.0, 1e8), (1.2, 1e5)
TNT_AIR = (TNT, AIR), BURNT_TNT, AMBIENT_AIR
BOXES = {
    "closed": ((48, 36), WATER_AIR, WALLS),
    "periodic": ((48, 36), WATER_AIR, PERIODIC),
    "around an axis": ((48, 36), WATER_AIR, WALLS),
    "closed in space": ((20, 16, 18), TNT_AIR, WALLS),
    "periodic in space": ((20, 16, 18), TNT_AIR, PERIODIC),
}


def box(name: str) -> Scene:
    """A ball off the middle of a box, small blocks; long enough for its waves to meet all sides and each other."""
    cells, flow, ends = BOXES[name]
    scene, D = gases(cells, *flow), len(cells)
    outside, inside = scene.fluid.regions
    ball = replace(inside.shape, center=tuple(0.4 * n for n in cells))
    regions = (outside, replace(inside, shape=ball))
    domain = replace(scene.domain, boundaries=(ends,) * D)
    return replace(
        scene,
        domain=around_axis(domain) if name == "around an axis" else domain,
        fluid=replace(scene.fluid, regions=regions),
        time=replace(scene.time, maximum_steps=STEPS),
        performance=Performance((12, 9, 8)[:D], (12, 3, 4)[:D]),
    )


def around_axis(domain: Domain) -> Domain:
    """The low end along x is the axis."""
    low, *others = domain.boundaries
    return replace(domain, coordinates=Axisymmetric(), boundaries=(("axis", low[1]), *others))


def main():
    communicator = Communicator()
    install_abort_on_exception(communicator)
    for name in sys.argv[1:]:
        simulation = Simulation.of(box(name), communicator, threads=1)
        budget = Budget(simulation.fluid, None, None)
        budget.row(simulation)
        while not simulation.done:
            simulation.step()
        row, cells = budget.row(simulation), cells_of(simulation)
        if communicator.rank == 0:
            drift = {key: value for key, value in row.items() if key.startswith("drift")}
            print(json.dumps({"name": name, "digest": hashlib.sha256(cells.tobytes()).hexdigest()} | drift), flush=True)
    costs = measure(box(sys.argv[-1]), communicator, 1)
    if communicator.rank == 0:
        print(json.dumps({"name": "costs"} | costs), flush=True)


if __name__ == "__main__":
    main()
