"""From the words of a scene to formulas: the only place where a name in the input meets a function.

A new equation of state is one file in laws/fluid/.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from distfsi.device.emit import plain
from distfsi.device.source import Bound
from distfsi.fluid.formulas import (
    euler,
    five_equation,
    five_equation_many,
    hydrostatics,
    limiters,
    positivity,
    reconstruction,
    relaxation,
    relaxation_many,
    riemann,
    six_equation,
    six_equation_many,
)
from distfsi.laws.body_force import BodyForce
from distfsi.laws.law import FluidEos
from distfsi.narrowing import of_kind, present
from distfsi.scene.description import Fluid, Scene
from distfsi.scene.thermodynamics import energy

RECONSTRUCTIONS = {  # from the cells around, with this limiter, so many ghost layers
    "first_order": (reconstruction.muscl, limiters.first_order, 2),
    "minmod": (reconstruction.muscl, limiters.minmod, 2),
    "van_leer": (reconstruction.muscl, limiters.van_leer, 2),
    "weno5": (reconstruction.weno5, limiters.van_leer, 3),
}
# bounding speeds, diffusion across contacts, viscosity along faces
RIEMANN_SOLVERS: dict[str, tuple[Callable[..., Any], ...]] = {
    "hllc": (riemann.einfeldt_speeds, riemann.sharp, riemann.inviscid),
    "hll": (riemann.einfeldt_speeds, riemann.contact_diffusion, riemann.inviscid),
    "rusanov": (riemann.rusanov_speeds, riemann.contact_diffusion, riemann.inviscid),
    "adaptive": (riemann.einfeldt_speeds, riemann.sharp, riemann.shear_along_shocks),
}
MODELS = {  # of two phases, and of more
    "six_equation": (six_equation, six_equation_many),
    "five_equation": (five_equation, five_equation_many),
}


@dataclass(frozen=True)
class FluidModel:
    """Everything the fluid's kernels are specialised with, and the meaning of its variables; `carried`: what the shares
    are called that a phase carries; `names`: those of the phases."""

    constants: dict[str, object]
    bindings: dict[str, Bound]
    eos: tuple[FluidEos, ...]
    dimensions: int
    body_force: BodyForce
    carried: tuple[str, ...] = ()
    names: tuple[str, ...] = ()

    @property
    def phases(self) -> int:
        """How many materials there are."""
        return len(self.eos)

    @property
    def variables(self) -> int:
        """Stored fields per cell."""
        return of_kind(int, self.constants["VARIABLES"])

    @property
    def fraction(self) -> int:
        """Index of the first volume fraction of several phases."""
        return self.conserved

    @property
    def conserved(self) -> int:
        """Masses, momentum and energy; volume fractions behind them are not conserved."""
        return self.phases + self.dimensions + 1

    @property
    def mirror(self) -> np.ndarray:
        """(variables,) the axis whose reflection changes the sign of each, -1 for none."""
        axes = np.full(self.variables, -1, dtype=np.int64)
        axes[self.phases : self.phases + self.dimensions] = np.arange(self.dimensions)
        return axes

    def formula(self, name: str) -> Callable[..., Any]:
        """One of the model's formulas ("primitives", "conserved" …) in plain Python, also for arrays."""
        if name not in self._made:
            bound = self.bindings[name]
            self._made[name] = plain(bound.function, {**self.constants, **bound.constants}, self.bindings)
        return self._made[name]

    @cached_property
    def _made(self) -> dict[str, Callable[..., Any]]:
        """The formulas that were asked for before."""
        return {}


def fluid_model(scene: Scene) -> FluidModel:
    """The formulas and constants of the scene's fluid."""
    fluid = present(scene.fluid)
    dimensions, phases = scene.domain.dimensions, len(fluid.phases)
    eos = tuple(phase.eos for phase in fluid.phases)
    carried = held_energies(fluid)
    variables = 2 * phases + dimensions + len(carried)
    model = euler if phases == 1 else MODELS[fluid.model][phases > 2]
    relaxes = phases > 1 and fluid.model == "six_equation"
    closed = all(e.closed_form for e in eos)
    reconstructed, limiter, ghosts = RECONSTRUCTIONS[fluid.reconstruction]
    asymmetric = reconstructed is reconstruction.weno5
    body_force, radial = BodyForce(scene.sources, dimensions), scene.domain.coordinates.radial
    constants = {
        "DIMENSIONS": dimensions,
        "PHASES": phases,
        "VARIABLES": variables,
        "FLUXES": variables + (phases if relaxes else 0) + (phases > 1),
        "CARRIED": len(carried),
        "CARRIER": carrier_of(fluid),
        "HELD_ENERGY": tuple(carried.values()),
        "BURNS": fluid.detonation is not None,
        "AFTERBURNS": fluid.afterburn is not None,
        "RELAXES": relaxes,
        "BODY_FORCE": body_force.acceleration,
        "MINIMUM_FRACTION": fluid.minimum_volume_fraction,
        "CLOSED_FORM": closed,
        "BISECTION_FALLBACK": relaxes and (phases > 2 or not closed),
        "GHOSTS": ghosts,
        "SHARPENED": phases > 1 and (fluid.sharpening or asymmetric),
        "ASYMMETRIC": asymmetric or radial,
        "TRANSVERSE_SENSOR": dimensions > 1 and fluid.riemann == "adaptive",
        "HYDROSTATIC": any(body_force.acceleration),
        "RADIAL": radial,
        "SHARES": 2 * dimensions + radial,
        "FRACTIONAL": scene.solid is not None and scene.coupling.scheme != "immersed_boundary",
    }
    names = ("primitives", "conserved", "face_flux", "updated", "bulk_modulus", "sound_speed")
    bindings = {name: Bound(getattr(model, name)) for name in names}
    if constants["BISECTION_FALLBACK"] and phases == 2:
        bindings |= {name: Bound(getattr(model, name)) for name in ("before_relaxation", "fraction_after")}
        bindings |= {name: Bound(getattr(relaxation, name)) for name in ("range_of_change", "halved_range")}
    elif constants["BISECTION_FALLBACK"]:
        bindings |= {name: Bound(getattr(model, name)) for name in ("before_relaxation", "fractions_after")}
        halving = ("range_of_pressure", "range_of_growths", "halved_growths", "changes_between")
        bindings |= {name: Bound(getattr(relaxation_many, name)) for name in halving}
    if constants["HYDROSTATIC"]:
        bindings |= {name: Bound(getattr(hydrostatics, name)) for name in ("falls", "beyond_rest")}
    bindings["state_behind_wave"] = Bound(model.behind_wave)
    positive = ("limiter_indicator", "is_admissible", "limited_flux")
    bindings |= {name: Bound(getattr(positivity, name)) for name in positive}
    bindings |= {"reconstructed": Bound(reconstructed), "limited_slope": Bound(limiter)}
    if radial:
        bindings["reconstructed_in_r"] = Bound(reconstruction.muscl_in_r)
    bindings["sharpened"] = Bound(reconstruction.overbee if fluid.sharpening else reconstruction.muscl)
    solver = zip(
        ("bounding_speeds", "contact_jump_diffusion", "slip_viscosity"), RIEMANN_SOLVERS[fluid.riemann], strict=True
    )
    bindings |= {name: Bound(function) for name, function in solver}
    for k, phase in enumerate(fluid.phases, 1):
        bindings |= {f"{name}_{k}": Bound.of(phase.eos, name, f"phase {k}") for name in ("reference", "grueneisen")}
        bindings[f"stored_reference_{k}"] = _stored_reference(fluid, k)
    if fluid.detonation:
        bindings["unburnt_share"] = Bound.of(fluid.detonation.burn, "unburnt", "burn")
    if fluid.afterburn:
        bindings["afterburn_left"] = Bound.of(fluid.afterburn.law, "left", "afterburn")
    return FluidModel(
        constants, bindings, eos, dimensions, body_force, tuple(carried), tuple(p.name for p in fluid.phases)
    )


def carrier_of(fluid: Fluid) -> int:
    """Index of the phase that carries shares along; 0 where none does."""
    reaction = fluid.detonation or fluid.afterburn
    return reaction.phase if reaction else 0


def held_energies(fluid: Fluid) -> dict[str, float]:
    """What the carrier's shares are called, and the energy [J/kg] that each holds back.

    An explosive is its products without the energy of detonation and without pressure at its density: a stiff matter.
    """
    held = {}
    if fluid.detonation:
        burn, eos = fluid.detonation.burn, fluid.phases[fluid.detonation.phase].eos
        held["unburnt"] = burn.energy - energy(eos, burn.density, 0.0)
    if fluid.afterburn:
        held["afterburn"] = fluid.afterburn.law.energy
    return held


def ghost_layers(scene: Scene) -> int:
    """Layers of ghost cells on each side of a block that the scene's method asks for."""
    return RECONSTRUCTIONS[scene.fluid.reconstruction if scene.fluid else "minmod"][2]


def _stored_reference(fluid: Fluid, k: int) -> Bound:
    """The reference to the energies of phase k that cells hold: in float32 those of the laws that can are counted from
    the phase's first state without pressure."""
    eos, owner = fluid.phases[k - 1].eos, f"phase {k}"
    first = next((region.state for region in fluid.regions if region.state.phase == k - 1), None)
    if fluid.precision == "float32" and hasattr(eos, "shifted_reference") and first is not None:
        bound = Bound.of(eos, "shifted_reference", owner)
        return replace(bound, constants={**bound.constants, "REST_DENSITY": first.density})
    return Bound.of(eos, "reference", owner)
