"""What makes results wrong and no check refuses: told by `check`, and before a run begins."""

from __future__ import annotations

from collections.abc import Iterator

from distfsi.gauges import per_extent
from distfsi.scene.description import Body, Domain, Scene
from distfsi.scene.placed_charges import ENOUGH, Charge, charges, gap_between, losses
from distfsi.scene.plausible import far_outside

MISPLACED = 0.01  # part of a charge that may be missing in its cells


def warnings(scene: Scene) -> Iterator[str]:
    """One sentence for each thing that makes results wrong and that no check refuses."""
    bodies = scene.solid.bodies if scene.solid else ()
    for charge in charges(scene):
        for text in _charge(charge, bodies, scene.domain):
            yield f"charge '{charge.name}': {text}"
    yield from far_outside(scene.fluid, bodies)


def _charge(charge: Charge, bodies: tuple[Body, ...], domain: Domain) -> Iterator[str]:
    if charge.cells < ENOUGH:
        peak, impulse = losses(charge.cells)
        about = "more than" if charge.cells < 1.0 else "about"
        cost = f"{about} {100.0 * peak:.0f} % of the peak overpressure and puts the impulse {100.0 * impulse:.0f} % off"
        yield f"{charge.cells:.2g} cells per radius, which a few radii away costs {cost}; {ENOUGH} are better"
    if abs(charge.placed - charge.meant) > MISPLACED * charge.meant:
        per = per_extent("kg", domain.dimensions + domain.coordinates.turns)
        yield f"its cells hold {charge.placed:.4g} of the {charge.meant:.4g} {per} that are meant: the rest is hidden"
    for body in bodies:
        overlap = -gap_between(charge, body, domain)
        if overlap > 0.5 * min(domain.spacing):
            yield f"reaches {overlap:.3g} m into body '{body.name}'"
