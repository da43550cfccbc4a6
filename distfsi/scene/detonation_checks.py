"""Faults of what burns in the fluid: an explosive whose numbers contradict its equation of state, a wrong phase."""

from __future__ import annotations

from collections.abc import Iterator

from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.noble_abel import NobleAbel
from distfsi.laws.registry import word_of
from distfsi.narrowing import present
from distfsi.scene.description import Detonation, Fluid
from distfsi.scene.faults import Fault
from distfsi.scene.schema import FluidInput
from distfsi.scene.shocks import chapman_jouguet

GASES = (IdealGas, NobleAbel)
SPEED, PRESSURE = 0.02, 0.05  # parts by which given numbers may differ from what the equation of state gives


def check_reactions(given: FluidInput, fluid: Fluid) -> Iterator[Fault]:
    """Two phases, one of them the explosive; its states unburnt; speed and pressure that follow from its energy."""
    for name in ("detonation", "afterburn"):
        if getattr(fluid, name) is not None and len(fluid.phases) < 2:
            yield Fault(("fluid", name), "needs two phases: an explosive and what is around it")
            return
    detonation, afterburn = fluid.detonation, fluid.afterburn
    if detonation and afterburn and detonation.phase != afterburn.phase:
        name = fluid.phases[detonation.phase].name
        yield Fault(("fluid", "afterburn", "phase"), f"expected that of the detonation, '{name}'")
    if afterburn and afterburn.law.needs_air:
        for number, other in enumerate(fluid.phases):
            if number != afterburn.phase and not isinstance(other.eos, GASES):
                text = f"'{word_of(type(afterburn.law))}' burns with air, but '{other.name}' is no gas"
                yield Fault(("fluid", "afterburn", "law"), text)
    if detonation is None:
        return
    for n, region in enumerate(given.regions):
        if region.energy is not None and fluid.regions[n].state.phase == detonation.phase:
            text = "an explosive that detonates is given unburnt, by its pressure"
            yield Fault(("fluid", "regions", n, "energy"), text)
    yield from _contradictions(fluid, detonation)


def _contradictions(fluid: Fluid, detonation: Detonation) -> Iterator[Fault]:
    burn = detonation.burn
    path = ("fluid", "detonation", "burn")
    found = chapman_jouguet(fluid.phases[detonation.phase].eos, burn.density, burn.energy)
    if not abs(present(burn.speed) / found.front - 1.0) < SPEED:
        text = f"{burn.speed:.5g} m/s contradicts the equation of state, which gives {found.front:.5g} m/s"
        yield Fault((*path, "speed"), f"{text} (Chapman and Jouguet) at this density and energy")
    elif not abs(present(burn.pressure) / found.pressure - 1.0) < PRESSURE:
        text = f"{burn.pressure:.5g} Pa contradicts the equation of state, which gives {found.pressure:.5g} Pa"
        yield Fault((*path, "pressure"), f"{text} (Chapman and Jouguet) at this density and energy")
