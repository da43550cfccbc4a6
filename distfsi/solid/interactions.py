"""How particles act on each other: the parts of a solid that its scene needs."""

from __future__ import annotations

from types import SimpleNamespace

from distfsi.mesh.communicator import Communicator
from distfsi.mesh.particles import ParticleExchange
from distfsi.mesh.search import CellSort
from distfsi.narrowing import present
from distfsi.scene.description import Scene
from distfsi.solid.contact import Contact
from distfsi.solid.material_points import MaterialGroups
from distfsi.solid.neighbours import NeighbourSearch
from distfsi.solid.no_forces import NoForces
from distfsi.solid.protocol import SolidForm
from distfsi.solid.sides import Sides
from distfsi.solid.total_lagrangian import TotalLagrangian
from distfsi.solid.updated import UpdatedLagrangian
from distfsi.solid.walls import Walls


def form_of(
    scene: Scene,
    kernels: SimpleNamespace,
    exchange: ParticleExchange,
    communicator: Communicator,
    points: MaterialGroups,
    sides: Sides,
) -> SolidForm:
    """How particles of one side do."""
    forms = {present(scene.solid).form_of(body) for body in present(scene.solid).bodies}
    if forms == {"rigid"}:
        return NoForces(exchange.device)
    solid, domain, device = present(scene.solid), scene.domain, exchange.device
    search = NeighbourSearch(kernels, device, domain.lower, domain.upper)
    if forms != {"updated_lagrangian"}:
        return TotalLagrangian(kernels, exchange, search, communicator, solid, points, sides, domain.dimensions)
    repels = solid.artificial_stress > 0.0
    return UpdatedLagrangian(kernels, device, search, sides, domain.dimensions, repels)


def contacts_of(
    scene: Scene, kernels: SimpleNamespace, exchange: ParticleExchange, communicator: Communicator, sides: Sides
) -> list[Contact | Walls]:
    """What bodies run into: other sides, and walls of the domain."""
    domain, device = scene.domain, exchange.device
    walls: list[Contact | Walls] = []
    if any("wall" in ends for ends in domain.boundaries):
        walls = [Walls(kernels, device, exchange.rows, domain, exchange.blocks.local_count)]
    if not sides.meet:
        return walls
    cells = CellSort(kernels, device, domain.lower, domain.upper)
    return [Contact(kernels, device, cells, communicator, sides, present(scene.solid), domain.dimensions), *walls]
