"""Constants far outside those of known materials: most often a unit or a sign that was not meant."""

from __future__ import annotations

from collections.abc import Iterator

from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.narrowing import present
from distfsi.scene.description import Body, Fluid
from distfsi.scene.thermodynamics import energy, solid_sound

FAR = 30.0  # times beyond what is known
EXPLOSIVES = 900.0, 2100.0  # kg/m3
DETONATIONS = 1e6, 1.2e7  # J/kg
LIQUIDS = 500.0, 14000.0  # kg/m3
SOLIDS = 500.0, 22600.0  # kg/m3, foams apart
SOUND = 50.0, 18000.0  # m/s in rubber and in diamond
STIFF = 1000.0  # m/s: solids with less may have units of their own
LIQUID_STIFFNESS = 1e7  # Pa


def far_outside(fluid: Fluid | None, bodies: tuple[Body, ...]) -> Iterator[str]:
    """A sentence for each constant that no known material comes near to."""
    for number, region in enumerate(fluid.regions if fluid else ()):
        phase, state = present(fluid).phases[region.state.phase], region.state
        where = f"fluid.regions.{number} ('{phase.name}')"
        if isinstance(phase.eos, Jwl):
            yield from _beyond(where, "density", state.density, EXPLOSIVES, "explosives", "kg/m3")
            e = energy(phase.eos, state.density, state.pressure)
            burns = present(fluid).detonation is not None
            if region.shape is not None and not burns and not DETONATIONS[0] / FAR <= e <= 2.0 * DETONATIONS[1]:
                yield f"{where}: an energy of {e:.3g} J/kg; explosives have 3e6 to 1.2e7 J/kg (not J/m3)"
        if isinstance(phase.eos, StiffenedGas) and phase.eos.p_inf > LIQUID_STIFFNESS:
            yield from _beyond(where, "density", state.density, LIQUIDS, "liquids", "kg/m3")
    for body in bodies:
        if not body.motion:  # rigid parts have the numbers that their scene wants
            yield from _body(body)


def _body(body: Body) -> Iterator[str]:
    where, sound = f"body '{body.name}'", solid_sound(body)
    if sound > STIFF:
        yield from _beyond(where, "density", body.density, SOLIDS, "solids", "kg/m3")
    if SOLIDS[0] <= body.density <= SOLIDS[1] and not SOUND[0] / FAR <= sound <= SOUND[1] * FAR**0.5:
        yield (
            f"{where}: its moduli and its density make sound {sound:.3g} m/s fast; known solids have "
            f"{SOUND[0]:g} to {SOUND[1]:g} m/s"
        )
    d3 = getattr(body.failure, "D3", None)
    if d3 is not None and d3 > 0.0:
        yield f"{where}: failure.D3 = {d3:g} makes it tougher in tension than in compression; of metals it is negative"


def _beyond(where: str, what: str, value: float, known: tuple[float, float], kind: str, unit: str) -> Iterator[str]:
    low, high = known
    if not low / FAR <= value <= high * FAR:
        yield f"{where}: a {what} of {value:.4g} {unit}; known {kind} have {low:g} to {high:g} {unit}"
